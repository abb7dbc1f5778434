//! The track from above, drawn without map tiles: grid with its distances, north, start and end.

use crate::colours::{ColourScale, STEPS};
use crate::recording::Recording;
use crate::style::{BOUND, Colour, MARK, TRUTH, path};
use crate::track::{Extent, Place};
use navfuse_core::model::stream::StreamError;
use re_sdk_types::archetypes::{Arrows2D, LineStrips2D, Points2D, Transform3D};
use re_sdk_types::blueprint::archetypes::VisualBounds2D;
use re_sdk_types::components::{DrawOrder, Radius};
use re_sdk_types::datatypes::Range2D;

/// Number of grid lines over the longer side, about.
const LINES: f64 = 6.0;
/// Height of the header above the grid, and distance of start and end below which they have one mark, as
/// shares of the longer side.
const HEADER: f32 = 0.17;
const NEAR: f32 = 0.07;
/// Places in the header as shares of the width: the name of the truth, the two ends of the scale of
/// colours, and north.
const NAME: f32 = 0.11;
const SCALE: [f32; 2] = [0.33, 0.73];
const NORTH: f32 = 0.93;
/// Shares of the header's height at which the arrow of north ends and begins, with its name below it.
const ARROW: [f32; 2] = [0.05, 0.55];
/// Least distance of two labels beside one another as a share of the longer side of the plan.
const BESIDE: f32 = 0.2;
/// Half the side of the square around zero that holds the plan of a run that goes on.
const SQUARE: f32 = 1.0;
/// Colour of the grid.
const GRID: Colour = [58, 62, 70];

/// East and south of the start, m: the viewer's second axis points down.
type Point = [f32; 2];

/// The point of a place north, east, down.
pub fn point(ned: [f32; 3]) -> Point {
    [ned[1], -ned[0]]
}

/// The bounds of a view between two corners.
fn between(low: Point, high: Point) -> VisualBounds2D {
    let range = |k: usize| [f64::from(low[k]), f64::from(high[k])].into();
    let range = Range2D { x_range: range(0), y_range: range(1) };
    VisualBounds2D::new(re_sdk_types::blueprint::components::VisualBounds2D(range))
}

/// The bounds of the plan of a run that goes on: the square into which [`Plan::fit`] moves it.
pub fn square() -> VisualBounds2D {
    between([-SQUARE; 2], [SQUARE; 2])
}

/// The plan of a track.
pub struct Plan {
    low: Point,
    high: Point,
    /// North edge of the grid; the header is beyond it.
    edge: f32,
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
        let edge = south - half[1];
        Some(Self {
            edge,
            low: [east - half[0] - 0.14 * side, edge - HEADER * side],
            high: [east + half[0], south + half[1]],
            spacing,
        })
    }

    /// The part of the plane that the view shows.
    pub fn bounds(&self) -> VisualBounds2D {
        between(self.low, self.high)
    }

    /// Draws grid, tracks and marks; places have a horizontal sigma. The end is marked where the run is
    /// `over`; before it the vehicle is there. `compared` is the name of the truth.
    pub fn draw(
        &self,
        recording: &Recording,
        estimate: &[Place],
        (truth, compared): (&[Place], &str),
        over: bool,
    ) -> Result<(), StreamError> {
        self.draw_grid(recording)?;
        if truth.len() > 1 {
            self.draw_name(recording, compared)?;
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
        let marks: &[(Point, &str)] = match [point(first.ned), point(last.ned)] {
            [start, _] if !over => &[(start, "start")],
            [start, end] if self.near(start, end) => &[(end, "start, end")],
            [start, end] => &[(start, "start"), (end, "end")],
        };
        let marks = Points2D::new(marks.iter().map(|mark| mark.0))
            .with_labels(marks.iter().map(|mark| mark.1))
            .with_colors([MARK])
            .with_radii([Radius::new_ui_points(6.0)])
            .with_show_labels(true)
            .with_draw_order(DrawOrder::from(5.0));
        recording.log_static(&path(&["plan", "marks"]), &marks)?;
        self.draw_legend(recording, &scale)
    }

    /// Every which line north has its distance east: labels beside one another need more room than those below
    /// one another.
    fn every(&self) -> i64 {
        let longer = (self.high[0] - self.low[0]).max(self.high[1] - self.low[1]);
        if self.spacing < BESIDE * longer { 2 } else { 1 }
    }

    /// Returns `true` for two places whose names would cover each other.
    fn near(&self, a: Point, b: Point) -> bool {
        let side = (self.high[0] - self.low[0]).max(self.high[1] - self.edge);
        (a[0] - b[0]).hypot(a[1] - b[1]) < NEAR * side
    }

    /// A place in the header: shares of the width and of the header's height.
    fn header(&self, x: f32, y: f32) -> Point {
        let width = self.high[0] - self.low[0];
        [self.low[0] + x * width, self.low[1] + y * (self.edge - self.low[1])]
    }

    /// Draws the name of the truth and a piece of its line.
    fn draw_name(&self, recording: &Recording, compared: &str) -> Result<(), StreamError> {
        let line =
            LineStrips2D::new([[self.header(NAME - 0.06, 0.3), self.header(NAME + 0.06, 0.3)]])
                .with_colors([TRUTH])
                .with_radii([Radius::new_ui_points(1.2)]);
        recording.log_static(&path(&["plan", "named"]), &line)?;
        let name = Points2D::new([self.header(NAME, 0.3)])
            .with_labels([compared])
            .with_colors([TRUTH])
            .with_radii([Radius::new_ui_points(1.0)])
            .with_show_labels(true);
        recording.log_static(&path(&["plan", "named", "name"]), &name)
    }

    /// Moves and scales the plan of a run that goes on into the square that its view shows: viewers keep the
    /// bounds of the first layout.
    pub fn fit(&self, recording: &Recording) -> Result<(), StreamError> {
        let place = self.in_square();
        let [east, south] = place.1;
        let place = Transform3D::from_translation_scale([east, south, 0.0], place.0);
        recording.log_static_to_viewers(&path(&["plan"]), &place)
    }

    /// Scale and translation of the plan into the square.
    fn in_square(&self) -> (f32, Point) {
        let longer = (0..2).map(|k| self.high[k] - self.low[k]).fold(0.0, f32::max);
        let scale = 2.0 * SQUARE / longer;
        (scale, [0, 1].map(|k| -0.5 * scale * (self.low[k] + self.high[k])))
    }

    fn draw_grid(&self, recording: &Recording) -> Result<(), StreamError> {
        let lines = |k: usize| {
            let low = [self.low[0], self.edge][k];
            let first = (low / self.spacing).ceil() as i64;
            let last = (self.high[k] / self.spacing).floor() as i64;
            (first..=last).map(|n| n as f32 * self.spacing)
        };
        let vertical = lines(0).map(|east| [[east, self.edge], [east, self.high[1]]]);
        let horizontal = lines(1).map(|south| [[self.low[0], south], [self.high[0], south]]);
        let grid = LineStrips2D::new(vertical.chain(horizontal))
            .with_colors([GRID])
            .with_radii([Radius::new_ui_points(0.5)])
            .with_draw_order(DrawOrder::from(0.0));
        recording.log_static(&path(&["plan", "grid"]), &grid)?;
        let number = |x: f32| distance(x, self.spacing);
        // inside of the edges, which would cut the labels
        let inside = [0, 1].map(|k| [0.08, 0.07][k] * (self.high[k] - self.low[k]));
        let [left, bottom] = [self.low[0] + inside[0], self.high[1] - inside[1]];
        let right = self.high[0] - 0.7 * inside[0];
        let every = self.every();
        let named = |x: &f32| (x / self.spacing).round() as i64 % every == 0;
        let east = lines(0).filter(|x| *x > left && *x < right && named(x));
        let east = east.map(|x| ([x, bottom], number(x)));
        // the corner belongs to the distances east
        let above = bottom - 0.8 * inside[1];
        let north = lines(1).filter(|y| *y < above).map(|y| ([left, y], number(-y)));
        let (places, labels): (Vec<Point>, Vec<String>) = east.chain(north).unzip();
        let ticks = Points2D::new(places)
            .with_labels(labels)
            .with_colors([BOUND])
            .with_radii([Radius::new_ui_points(1.0)])
            .with_show_labels(true);
        recording.log_static(&path(&["plan", "distances"]), &ticks)?;
        // a label of the arrow itself would cover its middle
        let [tip, foot] = ARROW.map(|share| self.header(NORTH, share));
        let north = Arrows2D::from_vectors([[0.0, tip[1] - foot[1]]])
            .with_origins([foot])
            .with_colors([BOUND])
            .with_radii([Radius::new_ui_points(2.0)]);
        recording.log_static(&path(&["plan", "north"]), &north)?;
        let name = Points2D::new([foot])
            .with_labels(["north"])
            .with_colors([BOUND])
            .with_radii([Radius::new_ui_points(1.0)])
            .with_show_labels(true);
        recording.log_static(&path(&["plan", "north", "name"]), &name)
    }

    /// A bar with the colours of sigma, and under it the smallest and the largest value with the name between
    /// them: in a narrow view more words would cover each other.
    fn draw_legend(&self, recording: &Recording, scale: &ColourScale) -> Result<(), StreamError> {
        let place = |share: f32| self.header(SCALE[0] + share * (SCALE[1] - SCALE[0]), 0.3);
        let pieces = (0..STEPS).map(|k| [k, k + 1].map(|n| place(n as f32 / STEPS as f32)));
        let bar = LineStrips2D::new(pieces)
            .with_colors((0..STEPS).map(ColourScale::colour))
            .with_radii([Radius::new_ui_points(3.0)]);
        recording.log_static(&path(&["plan", "scale"]), &bar)?;
        let number = |x: f64| match x {
            _ if x >= 1000.0 => format!("{:.1} km", x / 1000.0),
            _ if x >= 10.0 => format!("{x:.1} m"),
            _ => format!("{x:.2} m"),
        };
        let legend = scale.legend();
        let labels = legend.iter().enumerate().map(|(k, (value, _))| match k {
            1 => "sigma".to_owned(),
            // the few places with a larger sigma have the last colour, too
            2 if scale.beyond => number(*value) + "+",
            _ => number(*value),
        });
        let points = Points2D::new([0.0, 0.5, 1.0].map(place))
            .with_labels(labels.collect::<Vec<_>>())
            .with_colors(legend.iter().map(|l| l.1))
            .with_radii([Radius::new_ui_points(1.0)])
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

    /// The scale of colours is no object of the map: it is beyond the grid and the tracks. The narrowest plan
    /// of a usual window, that of a survey with ten sensors, is 300 pixels wide, and a label of 7 letters of 6
    /// pixels with its margins 58: a fifth of the width.
    #[test]
    fn the_header_is_above_the_grid_and_its_labels_are_apart() {
        let extent =
            Extent { low: [-50.0, 0.0, 0.0], high: [300.0, 400.0, 5.0], geo: Extent::NONE.geo };
        let Some(plan) = Plan::new(&extent) else { unreachable!("there is a place") };
        let [_, lowest] = plan.header(0.0, 1.0);
        // north of the farthest place
        assert!(lowest < -300.0 && plan.header(0.0, 0.0)[1] == plan.low[1], "{lowest}");
        let middle = 0.5 * (SCALE[0] + SCALE[1]);
        let places = [NAME, SCALE[0], middle, SCALE[1], NORTH];
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] > 58.0 / 300.0), "{places:?}");
        assert!(plan.near([0.0, 0.0], [0.0, 20.0]) && !plan.near([0.0, 0.0], [0.0, 200.0]));
    }

    /// The plan of a usual window is 390 pixels wide and 410 high, and `-1500 m` with its margins 58 wide. Beside
    /// ten sensors it is 250 pixels high, and `600 m` is 46 wide.
    #[test]
    fn distances_east_do_not_touch_each_other() {
        for k in 0..100 {
            let side = 100.0 * 1.05f32.powi(k);
            let extent = Extent { low: [0.0; 3], high: [side, side, 0.0], geo: Extent::NONE.geo };
            let Some(plan) = Plan::new(&extent) else { unreachable!("there is a place") };
            let longer = (plan.high[0] - plan.low[0]).max(plan.high[1] - plan.low[1]);
            let pixels = 390.0 / longer * plan.spacing * plan.every() as f32;
            assert!(pixels > 58.0 && pixels * 250.0 / 390.0 > 46.0, "{side} m: {pixels}");
        }
    }

    /// A track that grows stays in view, with its header, and fills the longer side.
    #[test]
    fn the_plan_of_a_run_that_goes_on_fills_the_square_that_its_view_shows() {
        for high in [[1.0, 2.0, 0.0], [900.0, 400.0, 5.0], [2000.0, 12_000.0, 5.0]] {
            let extent = Extent { low: [-50.0, 0.0, 0.0], high, geo: Extent::NONE.geo };
            let Some(plan) = Plan::new(&extent) else { unreachable!("there is a place") };
            let (scale, moved) = plan.in_square();
            let placed = |point: Point| [0, 1].map(|k| scale * point[k] + moved[k]);
            let corners = [placed(plan.low), placed(plan.high)].concat();
            let farthest = corners.iter().map(|x| x.abs()).fold(0.0, f32::max);
            assert!((farthest - SQUARE).abs() < 1e-4, "{corners:?}");
            assert!((corners[0] + corners[2]).abs() < 1e-4, "{corners:?}");
        }
    }

    #[test]
    fn north_is_up() {
        assert_eq!(point([10.0, 3.0, -5.0]), [3.0, -10.0]);
    }
}
