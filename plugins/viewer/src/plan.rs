//! The track from above, drawn without map tiles: grid with its distances, north, start and end.

use crate::colours::ColourScale;
use crate::recording::Recording;
use crate::style::{BOUND, Colour, MARK, TRUTH, path};
use crate::track::{Extent, Place};
use navfuse_core::model::stream::StreamError;
use re_sdk_types::archetypes::{Arrows2D, LineStrips2D, Points2D};
use re_sdk_types::blueprint::archetypes::VisualBounds2D;
use re_sdk_types::components::{DrawOrder, Radius};
use re_sdk_types::datatypes::Range2D;

/// Number of grid lines over the longer side, about.
const LINES: f64 = 6.0;
/// Colour of the grid.
const GRID: Colour = [58, 62, 70];

/// East and south of the start, m: the viewer's second axis points down.
type Point = [f32; 2];

/// The point of a place north, east, down.
pub fn point(ned: [f32; 3]) -> Point {
    [ned[1], -ned[0]]
}

/// The plan of a track.
pub struct Plan {
    low: Point,
    high: Point,
    spacing: f32,
}

impl Plan {
    /// The plan around a track; `None` before the first place.
    pub fn new(extent: &Extent) -> Option<Self> {
        let (middle, _) = extent.middle()?;
        let side = (0..2).map(|k| extent.high[k] - extent.low[k]).fold(1.0, f32::max);
        let spacing = round(f64::from(side) / LINES) as f32;
        let [east, south] = point(middle);
        // the margin has room for labels, and in the west for those of the distances north
        let half = [0.5 * (extent.high[1] - extent.low[1]), 0.5 * (extent.high[0] - extent.low[0])];
        let half = half.map(|h| h.max(0.3 * side) + 0.16 * side);
        Some(Self {
            low: [east - half[0] - 0.14 * side, south - half[1]],
            high: [east + half[0], south + half[1]],
            spacing,
        })
    }

    /// The part of the plane that the view shows.
    pub fn bounds(&self) -> VisualBounds2D {
        let range = |k: usize| [f64::from(self.low[k]), f64::from(self.high[k])].into();
        let range = Range2D { x_range: range(0), y_range: range(1) };
        VisualBounds2D::new(re_sdk_types::blueprint::components::VisualBounds2D(range))
    }

    /// Draws grid, tracks and marks, with the name of the last place; places have a
    /// horizontal sigma.
    pub fn draw(
        &self,
        recording: &Recording,
        estimate: &[Place],
        truth: &[Place],
        last_place: &str,
    ) -> Result<(), StreamError> {
        self.draw_grid(recording)?;
        if truth.len() > 1 {
            let line = LineStrips2D::new([truth.iter().map(|p| point(p.ned))])
                .with_colors([TRUTH])
                .with_radii([Radius::new_ui_points(0.9)])
                .with_draw_order(DrawOrder::from(2.0));
            recording.log_static(&path(&["plan", "truth"]), &line)?;
        }
        let scale = ColourScale::over(estimate.iter().map(|p| p.sigma));
        let pieces = scale.pieces(estimate.iter().map(|p| (point(p.ned), p.sigma)));
        let line = LineStrips2D::new(pieces.iter().map(|p| p.1.iter().copied()))
            .with_colors(pieces.iter().map(|p| p.0))
            .with_radii([Radius::new_ui_points(1.8)])
            .with_draw_order(DrawOrder::from(3.0));
        recording.log_static(&path(&["plan", "estimate"]), &line)?;
        let (Some(first), Some(last)) = (estimate.first(), estimate.last()) else { return Ok(()) };
        let marks = Points2D::new([point(first.ned), point(last.ned)])
            .with_labels(["start", last_place])
            .with_colors([MARK])
            .with_radii([Radius::new_ui_points(6.0)])
            .with_show_labels(true)
            .with_draw_order(DrawOrder::from(5.0));
        recording.log_static(&path(&["plan", "marks"]), &marks)?;
        self.draw_legend(recording, &scale)
    }

    fn draw_grid(&self, recording: &Recording) -> Result<(), StreamError> {
        let lines = |k: usize| {
            let first = (self.low[k] / self.spacing).ceil() as i64;
            let last = (self.high[k] / self.spacing).floor() as i64;
            (first..=last).map(|n| n as f32 * self.spacing)
        };
        let vertical = lines(0).map(|east| [[east, self.low[1]], [east, self.high[1]]]);
        let horizontal = lines(1).map(|south| [[self.low[0], south], [self.high[0], south]]);
        let grid = LineStrips2D::new(vertical.chain(horizontal))
            .with_colors([GRID])
            .with_radii([Radius::new_ui_points(0.5)])
            .with_draw_order(DrawOrder::from(0.0));
        recording.log_static(&path(&["plan", "grid"]), &grid)?;
        let number = |x: f32| distance(x, self.spacing);
        // inside of the edges, which would cut the labels
        let inside = [0, 1].map(|k| 0.07 * (self.high[k] - self.low[k]));
        let [left, bottom] = [self.low[0] + inside[0], self.high[1] - inside[1]];
        let right = self.high[0] - 0.7 * inside[0];
        let east = lines(0).filter(|x| *x > left && *x < right);
        let east = east.map(|x| ([x, bottom], number(x)));
        let north = lines(1).filter(|y| *y < bottom).map(|y| ([left, y], number(-y)));
        let (places, labels): (Vec<Point>, Vec<String>) = east.chain(north).unzip();
        let ticks = Points2D::new(places)
            .with_labels(labels)
            .with_colors([BOUND])
            .with_radii([Radius::new_ui_points(1.0)])
            .with_show_labels(true);
        recording.log_static(&path(&["plan", "distances"]), &ticks)?;
        let length = 0.09 * (self.high[1] - self.low[1]);
        let foot = [self.high[0] - 0.6 * length, self.low[1] + 1.7 * length];
        let north = Arrows2D::from_vectors([[0.0, -length]])
            .with_origins([foot])
            .with_colors([BOUND])
            .with_radii([Radius::new_ui_points(2.0)])
            .with_labels(["north"])
            .with_show_labels(true);
        recording.log_static(&path(&["plan", "north"]), &north)
    }

    /// Three points with the colours of sigma.
    fn draw_legend(&self, recording: &Recording, scale: &ColourScale) -> Result<(), StreamError> {
        let width = self.high[0] - self.low[0];
        let height = self.high[1] - self.low[1];
        let places = (0..3)
            .map(|k| [self.low[0] + (0.28 + 0.21 * k as f32) * width, self.low[1] + 0.04 * height]);
        let legend = scale.legend();
        let number = |x: f64| {
            if x >= 1000.0 { format!("{:.1} km", x / 1000.0) } else { format!("{x:.2} m") }
        };
        // the name once: in a narrow view three of them would cover each other
        let labels = legend.iter().enumerate().map(|(k, (value, _))| match k {
            0 => format!("sigma {}", number(*value)),
            _ => number(*value),
        });
        let points = Points2D::new(places)
            .with_labels(labels.collect::<Vec<_>>())
            .with_colors(legend.iter().map(|l| l.1))
            .with_radii([Radius::new_ui_points(5.0)])
            .with_show_labels(true);
        recording.log_static(&path(&["plan", "legend"]), &points)
    }
}

/// A distance as a label of a grid with that spacing: `500 m`, `20 km`.
pub fn distance(x: f32, spacing: f32) -> String {
    let (unit, size) = if spacing >= 1000.0 { ("km", 1000.0) } else { ("m", 1.0) };
    // adding zero makes a negative zero positive
    format!("{} {unit}", (1000.0 * x / size).round() / 1000.0 + 0.0)
}

/// The next 1, 2 or 5 times a power of ten.
pub fn round(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-6).log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|f| f * power).find(|r| *r >= value).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_lines_are_round() {
        assert_eq!([0.013, 1.0, 3.0, 180.0, 700.0].map(round), [0.02, 1.0, 5.0, 200.0, 1000.0]);
    }

    #[test]
    fn north_is_up() {
        assert_eq!(point([10.0, 3.0, -5.0]), [3.0, -10.0]);
    }
}
