//! The plots of a component of the state: units, ranges, and the places of the legends.

use crate::axis::{self, Scale};
use crate::corner::{Legend, Place, quietest};
use crate::history::Row;
use crate::time_axis::end_of_run;

/// Share of the run at its begin whose bounds do not count for a range: a wide prior would flatten
/// the rest of the plot.
const BEGIN: f64 = 0.1;
/// Size of an error before that, in errors and bounds after it, up to which it counts for a range.
const EARLY: f64 = 2.0;
/// Share of the largest errors of a run that counts for the unit of its errors.
const LARGER: f64 = 0.1;
/// Least range of the plot of a sigma, in powers of ten.
const DECADES: f64 = 1.0;

/// The plots of a component.
pub struct Plots {
    /// The unit of the estimate.
    pub value: Scale<'static>,
    /// The unit of error and sigma.
    pub error: Scale<'static>,
    /// Range of estimate and truth, over the run and at its end.
    pub values: [[f64; 2]; 2],
    /// Range of the error and its bounds, over the run and at its end; `None` without a truth.
    pub errors: Option<[[f64; 2]; 2]>,
    /// Set where a truth is known at some time.
    pub known: bool,
    /// Range of the decimal logarithm of sigma and error.
    pub logarithms: [f64; 2],
    /// The places of the legends.
    pub legends: Legends,
}

/// The places of the legends of a component.
pub struct Legends {
    /// In the plot of the estimate.
    pub value: Place,
    /// In the plot of the error.
    pub error: Place,
    /// In the plot of sigma.
    pub sigma: Place,
    /// In the plot of the error in sigma.
    pub normalised: Place,
}

impl Legends {
    /// Those of estimate, error and sigma, which stand in a column each.
    pub fn columns(&self) -> [&Place; 3] {
        [&self.value, &self.error, &self.sigma]
    }
}

impl Plots {
    /// The ranges in the unit of the block; `filtered` has the filter's own estimates and sigmas in a run that is
    /// smoothed.
    pub fn new(
        rows: &[Row<4>],
        filtered: &[Row<2>],
        own: f64,
        sizes_of_legends: [Legend; 4],
    ) -> Option<Self> {
        let (first, last) = (rows.first()?.0, rows.last()?.0);
        let span = (last - first) as f64;
        let begin = first + (BEGIN * span) as i64;
        let end = end_of_run(first, last);
        let over = |from: i64, bounds_from: i64, values: &dyn Fn(&[f64; 4]) -> [f64; 4]| {
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for (time, row) in rows.iter().filter(|row| row.0 >= from) {
                let values = values(row);
                let count = if *time >= bounds_from { 4 } else { 2 };
                for v in values[..count].iter().filter(|v| v.is_finite()) {
                    range = [range[0].min(*v), range[1].max(*v)];
                }
            }
            range
        };
        let value = |r: &[f64; 4]| [r[0], r[2], r[0] + 3.0 * r[1], r[0] - 3.0 * r[1]];
        let error = |r: &[f64; 4]| match r[3].is_finite() {
            true => [r[3], -r[3], 3.0 * r[1], -3.0 * r[1]],
            false => [f64::NAN; 4],
        };
        let known = |r: &[f64; 2]| r[0] <= r[1];
        // the first errors are as large as a prior: the plot of sigma shows their size
        let (usual, all) = (over(begin, begin, &error), over(first, begin, &error));
        let whole = [all[0].max(EARLY * usual[0]), all[1].min(EARLY * usual[1])];
        let errors = [if known(&usual) { whole } else { all }, over(end, end, &error)];
        let sizes = |r: &[f64; 4]| match r[1] > 0.0 {
            true => [r[1], r[3].abs(), r[1], r[1]],
            false => [f64::NAN; 4],
        };
        let [low, high] = over(first, first, &sizes);
        let sigmas = rows.iter().map(|r| r.1[1]).filter(|s| *s > 0.0);
        let least = sigmas.fold(f64::INFINITY, f64::min);
        let scale = Scale { unit: "", size: 1.0 };
        let values = [over(first, begin, &value), over(end, end, &value)];
        // an error near zero has no lower bound on this axis
        let low = (0.1 * least).max(low);
        let high = filtered.iter().map(|row| row.1[1]).fold(high, f64::max);
        let [low, high] = [low, high].map(f64::log10);
        // a sigma that hardly changes is a flat line, and no enlarged rounding
        let spare = (0.5 * (DECADES - (high - low))).max(0.0);
        let logarithms = [low - spare, high + spare];
        let ratio = |r: &[f64; 4]| [r[3] / r[1].hypot(own), 3.0, -3.0];
        let size = rows.iter().map(|row| ratio(&row.1)[0].abs()).fold(4.0, f64::max);
        let [of_value, of_error, of_sigma, of_ratio] = sizes_of_legends;
        let (span, within) =
            ((first, last), |r: &[f64; 4]| [error(r)[0], error(r)[2], error(r)[3]]);
        let both = rows.iter().map(|(time, r)| (*time, [r[1], r[3].abs()].map(f64::log10)));
        let of_filter = filtered.iter().map(|(time, r)| (*time, [r[1].log10(), f64::NAN]));
        let sigmas: Vec<Row<2>> = both.chain(of_filter).collect();
        let legends = Legends {
            value: quietest(rows, value, (span, values[0]), of_value),
            error: quietest(rows, within, (span, errors[0]), of_error),
            sigma: quietest(&sigmas, |r: &[f64; 2]| *r, (span, logarithms), of_sigma),
            normalised: quietest(rows, ratio, (span, [-size, size]), of_ratio),
        };
        Some(Self {
            value: scale,
            error: scale,
            values,
            errors: errors.iter().all(known).then_some(errors),
            known: rows.iter().any(|row| row.1[3].is_finite()),
            logarithms,
            legends,
        })
    }

    /// The sizes of value and error at the end of the run, which determine the units; of errors that were far
    /// larger before, a part of their size.
    pub fn sizes(&self) -> [f64; 2] {
        let half = |[low, high]: [f64; 2]| 0.5 * (high - low);
        let error = match self.errors {
            Some([whole, end]) => half(end).max(LARGER * half(whole)),
            None => half(self.values[1]),
        };
        [self.values[1][0].abs().max(self.values[1][1].abs()), error]
    }

    /// The same in the units that fit those sizes.
    pub fn in_units(mut self, unit: &'static str, value: f64, error: f64) -> Self {
        // a ratio near one is read as a number
        let one = Scale { unit, size: 1.0 };
        let large = axis::scale(unit, value);
        // a depth of 45 m, or a height of 1600 m that changes by 3 m, is not read in the kilometres of north and east
        let [low, high] = self.values[0];
        let small = large.size > 1.0 && high - low < axis::LEAST * large.size;
        self.value = if unit.is_empty() || small { one } else { large };
        // the unit of the table of states
        self.error = axis::table(unit, error);
        let (v, e) = (self.value.size, self.error.size);
        self.values.iter_mut().flatten().for_each(|x| *x /= v);
        self.errors.iter_mut().flatten().flatten().for_each(|x| *x /= e);
        self.logarithms.iter_mut().for_each(|x| *x -= e.log10());
        self
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use re_sdk::blueprint::components::Corner2D;

    /// A car at a height of 1600 m, of which an estimate is off by 10 for 15 s, and by 0.02 at other times.
    #[test]
    fn units_follow_the_change_of_a_value_and_the_largest_errors() {
        let off = |second: i64| if (250..265).contains(&second) { 10.0 } else { 0.02 };
        let row = |k: i64| (k * 1_000_000_000, [-1600.0, 0.01, -1600.0, off(k)]);
        let rows: Vec<Row<4>> = (0..400).map(row).collect();
        let legend = Legend { lines: 1, letters: 5, columns: 4, rows: 3 };
        let of = |unit| {
            let plots = Plots::new(&rows, &[], 0.0, [legend; 4]).unwrap();
            let [value, error] = plots.sizes();
            let plots = plots.in_units(unit, value, error);
            [plots.value.unit, plots.error.unit]
        };
        assert_eq!([of("m"), of("m/s")], [["m", "m"], ["m/s", "m/s"]]);
    }

    /// The filter's sigma falls from 10 to 0.01 in the first half; that of the smoother is 0.01.
    #[test]
    fn the_plot_of_a_smoothed_sigma_has_room_for_that_of_the_filter_and_no_line_under_its_legend() {
        let rows: Vec<Row<4>> = (0..10).map(|k| (k, [0.0, 0.01, 0.0, 0.02])).collect();
        let filtered: Vec<Row<2>> =
            (0..10).map(|k| (k, [0.0, if k < 5 { 10.0 } else { f64::NAN }])).collect();
        let legend = Legend { lines: 1, letters: 5, columns: 4, rows: 3 };
        let of = |filtered: &[Row<2>]| Plots::new(&rows, filtered, 0.0, [legend; 4]).unwrap();
        let plots = of(&filtered);
        assert_eq!(plots.logarithms, [-2.0, 1.0]);
        assert!(of(&[]).logarithms[1] < 0.0);
        let turned: Vec<Row<2>> = filtered.iter().map(|(k, row)| (9 - k, *row)).collect();
        let corners = [plots, of(&turned)].map(|plots| plots.legends.sigma.corner);
        assert_eq!(corners, [Corner2D::RightTop, Corner2D::LeftTop]);
    }
}
