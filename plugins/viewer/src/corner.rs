//! The corner of a plot for its legend: the one that the lines cover least.

use crate::history::Row;
use re_sdk::blueprint::components::Corner2D;

/// Size of a legend as a share of the width and of the height of a plot.
const LEGEND: [f64; 2] = [0.33, 0.4];
/// Number of rows that are looked at, about.
const LOOKED_AT: usize = 256;
/// The corners, and whether each is on the right and at the top; the first of equal ones is taken.
const CORNERS: [(Corner2D, bool, bool); 4] = [
    (Corner2D::RightTop, true, true),
    (Corner2D::LeftTop, false, true),
    (Corner2D::RightBottom, true, false),
    (Corner2D::LeftBottom, false, false),
];

/// The corner with the fewest values of some lines, in a plot of that range: of rows at equal distances.
pub fn quietest<const N: usize, const M: usize>(
    rows: &[Row<N>],
    lines: impl Fn(&[f64; N]) -> [f64; M],
    [low, high]: [f64; 2],
) -> Corner2D {
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return CORNERS[0].0 };
    let span = (last.0 - first.0).max(1) as f64;
    let mut counts = [0_usize; CORNERS.len()];
    for (time, row) in rows.iter().step_by(rows.len().div_ceil(LOOKED_AT)) {
        let along = (time - first.0) as f64 / span;
        let values = lines(row).into_iter().map(|value| (value - low) / (high - low));
        for height in values.filter(|height| (0.0..=1.0).contains(height)) {
            for (count, (_, right, top)) in counts.iter_mut().zip(&CORNERS) {
                let x = if *right { 1.0 - along } else { along };
                let y = if *top { 1.0 - height } else { height };
                *count += usize::from(x < LEGEND[0] && y < LEGEND[1]);
            }
        }
    }
    let quietest = counts.iter().zip(&CORNERS).min_by_key(|(count, _)| **count);
    quietest.map_or(CORNERS[0].0, |(_, corner)| corner.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legend_is_where_no_line_is() {
        let rows = |line: fn(f64) -> f64| -> Vec<Row<1>> {
            (0..=100).map(|k| (k, [line(k as f64 / 100.0)])).collect()
        };
        for (line, corner) in [
            ((|_| 0.1) as fn(f64) -> f64, Corner2D::RightTop),
            (|x| x, Corner2D::LeftTop),
            (|x| if x < 0.5 { f64::NAN } else { 0.9 }, Corner2D::LeftTop),
            (|_| 0.9, Corner2D::RightBottom),
            (|x| if x < 0.5 { 0.9 } else { 0.05 + 0.9 * x }, Corner2D::RightBottom),
        ] {
            assert_eq!(quietest(&rows(line), |row| *row, [0.0, 1.0]), corner);
        }
    }
}
