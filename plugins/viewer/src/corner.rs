//! The place of the legend in a plot: a corner without lines, or room above them.

use crate::axis;
use crate::blueprint::{Layout, height};
use crate::history::Row;
use re_sdk::blueprint::components::Corner2D;

/// Width of a window, and what of a plot's width the names of its vertical axis take, pixels.
const WINDOW: f64 = 1600.0;
const NAMES: f64 = 40.0;
/// Width of a letter of a legend, and what is beside the letters; height of a line, and what is around
/// the lines, pixels.
const LETTER: [f64; 2] = [7.5, 48.0];
const LINE: [f64; 2] = [23.0, 12.0];
/// Greatest share of the height of a plot that is kept free for its legend, and number of smaller ones.
const ROOM: f64 = 0.6;
const STEPS: u32 = 12;
/// The corners, and whether each is on the right and at the top; the first of equal ones is taken.
const CORNERS: [(Corner2D, bool, bool); 4] = [
    (Corner2D::RightTop, true, true),
    (Corner2D::LeftTop, false, true),
    (Corner2D::RightBottom, true, false),
    (Corner2D::LeftBottom, false, false),
];

/// The size of a legend: its lines and the letters of the longest one, in a plot of which a window of
/// 1600x1000 has that many beside and above one another.
#[derive(Clone, Copy, Debug)]
pub struct Legend {
    /// Number of lines.
    pub lines: usize,
    /// Number of letters of the longest line.
    pub letters: usize,
    /// Number of plots beside one another.
    pub columns: usize,
    /// Number of plots above one another.
    pub rows: usize,
}

impl Legend {
    /// The size as shares of the width and of the height of the plot.
    fn shares(&self) -> [f64; 2] {
        let width = WINDOW / self.columns.max(1) as f64 - NAMES;
        let wide = LETTER[0] * self.letters as f64 + LETTER[1];
        [wide / width, self.pixels() / height(self.rows)].map(|share| share.min(1.0))
    }

    /// The height, pixels.
    fn pixels(&self) -> f64 {
        LINE[0] * self.lines as f64 + LINE[1]
    }
}

/// The place of a legend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The corner.
    pub corner: Corner2D,
    /// Set where it covers no line.
    pub free: bool,
    /// Height of the legend, pixels.
    height: f64,
}

impl Default for Place {
    fn default() -> Self {
        Self { corner: CORNERS[0].0, free: true, height: 0.0 }
    }
}

impl Place {
    /// The range of a plot of that many pixels with room for a legend that would cover lines: above them, and
    /// no more than it needs on the axis of that range.
    pub fn room(&self, [low, high]: [f64; 2], pixels: f64) -> [f64; 2] {
        if self.free {
            return [low, high];
        }
        let with_room = |share: f64| [low, low + (high - low) / (1.0 - share)];
        let suffices = |range: &[f64; 2]| {
            let [bottom, top] = axis::range(range[0], range[1], pixels);
            (top - high) * pixels >= (top - bottom) * self.height
        };
        let ranges = (0..=STEPS).map(|step| with_room(ROOM * f64::from(step) / f64::from(STEPS)));
        let enough = ranges.into_iter().find(suffices);
        enough.unwrap_or_else(|| with_room((self.height / pixels).min(ROOM)))
    }
}

/// The place of a legend in a plot of that span of time and range: the first corner without values of
/// some lines.
pub fn quietest<const N: usize, const M: usize>(
    rows: &[Row<N>],
    lines: impl Fn(&[f64; N]) -> [f64; M],
    ((first, last), [low, high]): ((i64, i64), [f64; 2]),
    legend: Legend,
) -> Place {
    if low.is_nan() || high.is_nan() || low > high {
        return Place::default();
    }
    let [bottom, top] = axis::range(low, high, height(legend.rows));
    let [wide, tall] = legend.shares();
    let span = (last - first).max(1) as f64;
    let mut counts = [0_usize; CORNERS.len()];
    for (time, row) in rows {
        let along = (time - first) as f64 / span;
        for value in lines(row).into_iter().filter(|value| !value.is_nan()) {
            // a line that leaves the plot crosses its edge
            let height = ((value - bottom) / (top - bottom)).clamp(0.0, 1.0);
            for (count, (_, right, top)) in counts.iter_mut().zip(&CORNERS) {
                let x = if *right { 1.0 - along } else { along };
                let y = if *top { 1.0 - height } else { height };
                *count += usize::from(x < wide && y < tall);
            }
        }
    }
    let free = counts.iter().zip(&CORNERS).find(|(count, _)| **count == 0);
    let corner = free.map_or(CORNERS[0].0, |(_, corner)| corner.0);
    Place { corner, free: free.is_some(), height: legend.pixels() }
}

impl Layout {
    /// Gives the next plot, one of `columns` beside one another, a legend with these names where it covers
    /// none of the points (time in s, value), or has room above them. Returns the range of the plot.
    pub fn legend_beside(
        &mut self,
        names: &[&str],
        points: &[[f64; 2]],
        columns: usize,
        range: [f64; 2],
    ) -> [f64; 2] {
        let rows: Vec<Row<1>> = points.iter().map(|p| ((1e9 * p[0]) as i64, [p[1]])).collect();
        let times = || rows.iter().map(|row| row.0);
        let span = self.span.or_else(|| times().min().zip(times().max()));
        let letters = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let legend = Legend { lines: names.len(), letters, columns, rows: self.rows };
        let lines = |row: &[f64; 1]| *row;
        let place = quietest(&rows, lines, (span.unwrap_or_default(), range), legend);
        self.legend_at(&place, true, (range, height(self.rows)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A legend of a third of the width and of the height of a plot of 400 pixels, on whose axis a range of one
    /// has ticks at every tenth.
    const LEGEND: Legend = Legend { lines: 5, letters: 18, columns: 3, rows: 2 };

    fn rows(line: fn(f64) -> f64) -> Vec<Row<1>> {
        (0..=100).map(|k| (k, [line(k as f64 / 100.0)])).collect()
    }

    fn place(rows: &[Row<1>]) -> Place {
        quietest(rows, |row: &[f64; 1]| *row, ((0, 100), [0.0, 1.0]), LEGEND)
    }

    #[test]
    fn a_legend_is_where_no_line_is() {
        let [wide, tall] = LEGEND.shares();
        assert!((0.3..0.4).contains(&wide) && (0.3..0.4).contains(&tall), "{wide} {tall}");
        for (line, corner) in [
            ((|_| 0.1) as fn(f64) -> f64, Corner2D::RightTop),
            (|x| x, Corner2D::LeftTop),
            (|x| if x < 0.5 { f64::NAN } else { 0.9 }, Corner2D::LeftTop),
            (|_| 0.9, Corner2D::RightBottom),
            (|x| if x < 0.5 { 0.9 } else { 0.05 + 0.9 * x }, Corner2D::RightBottom),
        ] {
            let place = place(&rows(line));
            assert_eq!((place.corner, place.free), (corner, true));
            assert_eq!(place.room([0.0, 1.0], height(LEGEND.rows)), [0.0, 1.0]);
        }
        // a line that begins in the middle of the plot leaves its left half free
        let late: Vec<Row<1>> = rows(|_| 0.9).into_iter().skip(50).collect();
        assert_eq!(place(&late).corner, Corner2D::LeftTop);
    }

    /// A comparison has one legend on its page, of a difference that ends in the corner at the top.
    #[test]
    fn a_legend_beside_points_leaves_the_corner_in_which_they_end() {
        let mut layout = Layout::new(true);
        let points: Vec<[f64; 2]> = (0..=100).map(|k| [f64::from(k), f64::from(k)]).collect();
        let range = layout.legend_beside(&["B - A"], &points, 3, [0.0, 100.0]);
        assert_eq!((layout.corner, range), (Corner2D::LeftTop, [0.0, 100.0]));
    }

    /// Lines in all corners leave the legend room above them.
    #[test]
    fn a_legend_that_would_cover_lines_has_room_above_them() {
        let covered = place(&rows(|x| (500.0 * x).sin().abs()));
        assert!(!covered.free && covered.corner == Corner2D::RightTop);
        let pixels = height(LEGEND.rows);
        let [low, high] = covered.room([0.0, 1.0], pixels);
        let [bottom, top] = axis::range(low, high, pixels);
        let [_, tall] = LEGEND.shares();
        let above = (top - 1.0) / (top - bottom);
        assert!(low == 0.0 && (tall..tall + 0.1).contains(&above), "{above} {tall}");
        // in a plot of the whole height it is a sixth
        let [_, alone] = covered.room([0.0, 1.0], height(1));
        assert!((1.1..1.2).contains(&alone), "{alone}");
    }
}
