//! Rows of a series over a whole run in bounded memory, thinned so that extremes stay.

use navfuse_core::units::rhythm::Rhythm;
use navfuse_core::units::thin::{Merge, ROWS, Thin};
use navfuse_core::units::time::Time;
use std::collections::BTreeMap;

/// Number of stretches on both sides in which a saw has its upper edge.
const REACH: usize = 2;
/// Ratio of the largest to the smallest value of a stretch from which on it goes up or down; a saw does so in
/// several stretches.
const SAW: f64 = 1.3;

/// Finds the gaps in a sequence of times.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gaps {
    rhythm: Rhythm,
    last: Option<Time>,
}

impl Gaps {
    /// Takes the next time; returns the middle of the gap before it, ns, if there is one.
    pub fn after(&mut self, now: Time) -> Option<i64> {
        let last = self.last.replace(now)?;
        let interval = now.since(last);
        let gap = interval > self.rhythm.patience();
        self.rhythm.take(interval);
        gap.then(|| last.nanos() + (now - last).nanos() / 2)
    }
}

/// Rows of `N` values over time. A full history keeps every row. A thinned one keeps, of every
/// stretch of equal length, the rows with the smallest and the largest value of each of `K` key
/// columns; so it keeps the extremes of the run.
#[derive(Debug)]
pub struct History<const N: usize, const K: usize = 1> {
    stretches: Thin<Stretch<N, K>>,
    keys: [usize; K],
    first: Option<Row<N>>,
    last: Option<Row<N>>,
    breaks: Vec<i64>,
}

/// Time, ns, and values.
pub type Row<const N: usize> = (i64, [f64; N]);

/// The rows that are kept of a stretch: those with the smallest and the largest value of each key.
#[derive(Debug)]
struct Stretch<const N: usize, const K: usize> {
    extremes: [[Row<N>; 2]; K],
    keys: [usize; K],
    /// The smallest and the largest value of each column, of all rows.
    ranges: [[f64; 2]; N],
}

impl<const N: usize, const K: usize> Stretch<N, K> {
    /// The rows, some more than once. A row with an unknown key is no extreme.
    fn rows(&self) -> impl Iterator<Item = &Row<N>> {
        let extremes = self.extremes.iter().zip(self.keys);
        let known = extremes.filter(|(rows, key)| rows[0].1[*key].is_finite());
        known.flat_map(|(rows, _)| rows)
    }
}

impl<const N: usize, const K: usize> Merge for Stretch<N, K> {
    fn merge(&mut self, next: Self) {
        for ([least, greatest], [lower, higher]) in self.ranges.iter_mut().zip(next.ranges) {
            (*least, *greatest) = (least.min(lower), greatest.max(higher));
        }
        for ((rows, next), key) in self.extremes.iter_mut().zip(next.extremes).zip(self.keys) {
            let [least, greatest] = [rows[0].1[key], rows[1].1[key]];
            let [lower, higher] = [next[0].1[key], next[1].1[key]];
            if lower.is_finite() && !(least.is_finite() && least <= lower) {
                rows[0] = next[0];
            }
            if higher.is_finite() && !(greatest.is_finite() && greatest > higher) {
                rows[1] = next[1];
            }
        }
    }
}

impl<const N: usize, const K: usize> History<N, K> {
    /// An empty history; `keys` are the columns whose extremes stay.
    pub fn new(keys: [usize; K], full: bool) -> Self {
        Self::with_rows(keys, if full { usize::MAX } else { ROWS })
    }

    /// An empty history of at most about that many rows.
    pub fn with_rows(keys: [usize; K], rows: usize) -> Self {
        Self {
            // a stretch keeps two rows for each key
            stretches: Thin::with_rows(rows / (2 * K)),
            keys,
            first: None,
            last: None,
            breaks: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn push(&mut self, time: i64, values: [f64; N]) {
        let row = (time, values);
        self.first.get_or_insert(row);
        self.last = Some(row);
        let (extremes, ranges) = ([[row; 2]; K], values.map(|value| [value; 2]));
        self.stretches.push(Stretch { extremes, keys: self.keys, ranges });
    }

    /// Breaks the line before a time.
    pub fn break_at(&mut self, time: i64) {
        self.breaks.push(time);
    }

    /// Set before the first row.
    pub fn is_empty(&self) -> bool {
        self.last.is_none()
    }

    /// The rows in order of time, with a row of NaN at each break; none without values.
    pub fn rows(&self) -> Vec<Row<N>> {
        if self.is_empty() {
            return Vec::new();
        }
        let stretches = self.stretches.rows().iter().flat_map(Stretch::rows);
        let mut rows: Vec<Row<N>> = self.first.iter().chain(stretches).copied().collect();
        rows.extend(self.last);
        rows.extend(self.breaks.iter().map(|time| (time - 1, [f64::NAN; N])));
        rows.sort_by_key(|row| row.0);
        rows.dedup_by_key(|row| row.0);
        rows
    }

    /// The rows, of which a column of a thinned history has the upper edge where it is a saw.
    ///
    /// A sigma falls with each sample and grows until the next one. Rows at any place of that saw would draw a
    /// pattern that the run does not have; its upper edge is one line. The last row stays.
    pub fn rows_under(&self, column: usize) -> Vec<Row<N>> {
        let mut rows = self.rows();
        let stretches = self.stretches.rows();
        if self.stretches.each() == 1 {
            return rows;
        }
        let mut edges = BTreeMap::new();
        for (k, stretch) in stretches.iter().enumerate() {
            let near = &stretches[k.saturating_sub(REACH)..stretches.len().min(k + REACH + 1)];
            let ranges = || near.iter().map(|near| near.ranges[column]);
            let high = ranges().fold(f64::NAN, |high, range| high.max(range[1]));
            // one step up or down is no saw, and stays where it is
            if ranges().filter(|[low, high]| *high > SAW * low).count() > 1 {
                let first = self.first.iter().filter(|_| k == 0);
                edges.extend(stretch.rows().chain(first).map(|row| (row.0, high)));
            }
        }
        let last = rows.len().saturating_sub(1);
        for (time, values) in &mut rows[..last] {
            // a break stays one
            let edge = edges.get(time).filter(|_| values[column].is_finite());
            values[column] = edge.copied().unwrap_or(values[column]);
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave with one spike up and one down.
    fn wave(count: i64) -> History<2> {
        let mut history = History::new([0], false);
        for t in 0..count {
            let spike = if t == 12_345 {
                50.0
            } else if t == 54_321 {
                -50.0
            } else {
                0.0
            };
            history.push(t, [(t as f64 / 700.0).sin() + spike, t as f64]);
        }
        history
    }

    #[test]
    fn a_thinned_history_keeps_both_ends_and_the_extremes_in_bounded_rows() {
        let history = wave(100_000);
        let rows = history.rows();
        assert!((ROWS / 4..=ROWS + 2).contains(&rows.len()), "{}", rows.len());
        assert_eq!((rows[0].0, rows[rows.len() - 1].0), (0, 99_999));
        assert!(rows.iter().any(|r| r.0 == 12_345) && rows.iter().any(|r| r.0 == 54_321));
        assert!(rows.windows(2).all(|w| w[0].0 < w[1].0), "in order of time, each once");
        assert!(rows.iter().all(|r| r.1[1] == r.0 as f64), "whole rows are kept");
    }

    #[test]
    fn a_short_history_and_a_full_one_keep_every_row() {
        assert_eq!(wave(500).rows().len(), 500);
        let mut full = History::new([0], true);
        (0..10_000).for_each(|t| full.push(t, [t as f64]));
        assert_eq!(full.rows().len(), 10_000);
    }

    /// A sigma that a sample at every third epoch takes from 4 to 1, with an error of any size.
    #[test]
    fn a_saw_is_its_upper_edge_once_it_is_thinned_and_a_short_one_is_itself() {
        let saw = |count: i64| {
            let mut history = History::<2, 1>::new([0], false);
            (0..count).for_each(|t| {
                history.push(t, [(0.7 * t as f64).sin(), [1.0, 2.0, 4.0][t as usize % 3]])
            });
            history
        };
        let (rows, upper) = (saw(30_000).rows(), saw(30_000).rows_under(1));
        let below = |rows: &[Row<2>]| rows.iter().filter(|row| row.1[1] < 4.0).count();
        assert!(below(&rows) > rows.len() / 2, "{} of {}", below(&rows), rows.len());
        assert_eq!(below(&upper), usize::from(upper[upper.len() - 1].1[1] < 4.0));
        assert_eq!(upper.last(), rows.last());
        assert!(upper.iter().zip(&rows).all(|(a, b)| a.0 == b.0 && a.1[0] == b.1[0]));
        assert_eq!(saw(90).rows_under(1), saw(90).rows());
    }

    /// A sigma that falls from 4 to 1 once, within 1000 of 30000 epochs, falls where it does.
    #[test]
    fn a_sigma_that_converges_once_is_no_saw() {
        let mut history = History::<2, 1>::new([0], false);
        for t in 0..30_000 {
            let sigma = 1.0 + 3.0 * (1.0 - (t - 5000) as f64 / 1000.0).clamp(0.0, 1.0);
            history.push(t, [(0.7 * t as f64).sin(), sigma]);
        }
        assert_eq!(history.rows_under(1), history.rows());
    }

    #[test]
    fn a_gap_is_a_silence_and_the_line_breaks_in_its_middle() {
        let mut gaps = Gaps::default();
        let times = [0.0, 0.2, 0.4, 5.4, 5.6, 11.6, 11.8];
        let found: Vec<_> = times.into_iter().map(|t| gaps.after(Time::from_seconds(t)?)).collect();
        // 5 s are no silence; the break is in the middle of 5.6 s and 11.6 s
        assert_eq!(found, [None, None, None, None, None, Some(8_600_000_000), None]);
    }

    #[test]
    fn a_break_is_a_row_without_values_before_its_time() {
        let mut history = History::new([0], false);
        history.push(10, [1.0]);
        history.break_at(50);
        history.push(50, [2.0]);
        let rows = history.rows();
        assert_eq!(rows.iter().map(|r| r.0).collect::<Vec<_>>(), [10, 49, 50]);
        assert!(rows[1].1[0].is_nan());
        let mut empty = History::<1>::new([0], false);
        empty.break_at(50);
        assert_eq!(empty.rows().len(), 0, "a break is no value");
    }
}
