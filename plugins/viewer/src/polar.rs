//! A graticule around a pole, in the plan of a track: the projection of the map has no pole.

use crate::map::{LETTERS, angle};
use crate::plan::{point, round};
use crate::recording::Recording;
use crate::style::{BOUND, Colour, path};
use crate::track::{Extent, Motion, Place};
use navfuse_core::model::stream::StreamError;
use re_sdk_types::archetypes::{LineStrips2D, Points2D};
use re_sdk_types::components::{DrawOrder, Radius};

/// Least latitude of a track's farthest place, deg, and the colatitude of its start up to which the plane
/// through the pole is as good as the Earth's surface, deg: 100 km bend it by 4 m.
const NEAR: f64 = 89.5;
const FLAT: f64 = 1.0;
/// Length of a minute of latitude at a pole, m: the radius of curvature a^2/b is 6399.6 km.
const MINUTE: f64 = 1861.6;
/// Number of parallels within the longer side of the track, about.
const PARALLELS: f64 = 4.0;
/// Distance of the meridians, deg, and corners of a parallel.
const MERIDIANS: usize = 30;
const CORNERS: usize = 120;
/// Colour of the lines.
const GRID: Colour = [70, 76, 86];

/// The graticule around the pole next to a track.
#[derive(Debug)]
pub struct Polar {
    /// Colatitude, minutes, and longitude of the start, deg.
    start: [f64; 2],
    south: bool,
    /// Distance of the parallels, minutes, and their number.
    spacing: f64,
    count: usize,
}

impl Polar {
    /// The graticule around the pole next to a track; `None` far from the poles.
    pub fn of(track: &Motion) -> Option<Self> {
        Self::new(&track.extent, &track.estimate.iter().next()?)
    }

    /// The graticule around the pole of a track that begins at a place; `None` far from the poles.
    fn new(extent: &Extent, start: &Place) -> Option<Self> {
        let [latitude, longitude] = start.geo;
        let farthest = extent.geo.map(|place| place[0].abs()).into_iter().fold(0.0, f64::max);
        if !(farthest > NEAR && farthest <= 90.0 && 90.0 - latitude.abs() < FLAT) {
            return None;
        }
        let colatitude = 60.0 * (90.0 - latitude.abs());
        let side = (0..2).map(|k| extent.high[k] - extent.low[k]).fold(1.0, f32::max);
        let spacing = round(f64::from(side) / MINUTE / PARALLELS);
        // up to the farthest corner of the track, and one more
        let pole =
            Self { start: [colatitude, longitude], south: latitude < 0.0, spacing, count: 0 };
        let [low, high] = [extent.low, extent.high];
        let corners = [low[0], high[0]].into_iter().flat_map(|n| [[n, low[1]], [n, high[1]]]);
        let [north, east] = pole.place(0.0, 0.0);
        let reach = corners.map(|[n, e]| (f64::from(n) - north).hypot(f64::from(e) - east));
        let count = (reach.fold(0.0, f64::max) / MINUTE / spacing).ceil() as usize + 1;
        Some(Self { count, ..pole })
    }

    /// Metres north and east of the start, of a place with that colatitude, minutes, and longitude from that
    /// of the start, deg.
    fn place(&self, colatitude: f64, longitude: f64) -> [f64; 2] {
        let (sin, cos) = longitude.to_radians().sin_cos();
        let north = MINUTE * (self.start[0] - colatitude * cos);
        [if self.south { -north } else { north }, MINUTE * colatitude * sin]
    }

    /// The words for a title.
    pub fn title(&self) -> String {
        let pole = if self.south { "south" } else { "north" };
        format!("Around the {pole} pole, lines every {}' and {MERIDIANS} deg", self.spacing)
    }

    /// Draws the lines and their names in the plan.
    pub fn draw(&self, recording: &Recording) -> Result<(), StreamError> {
        let at = |colatitude: f64, longitude: f64| {
            let [north, east] = self.place(colatitude, longitude);
            point([north as f32, east as f32, 0.0])
        };
        let last = self.count as f64 * self.spacing;
        let parallels = (1..=self.count).map(|k| {
            let corner = |n: usize| at(k as f64 * self.spacing, (360 * n / CORNERS) as f64);
            (0..=CORNERS).map(corner).collect::<Vec<_>>()
        });
        let meridians = || (0..360).step_by(MERIDIANS).map(|k| k as f64);
        // from the longitude of the start to one with a round number
        let shifted = |longitude: f64| longitude - self.start[1];
        let lines = meridians().map(|k| vec![at(0.0, shifted(k)), at(last, shifted(k))]);
        let lines = LineStrips2D::new(parallels.chain(lines))
            .with_colors([GRID])
            .with_radii([Radius::new_ui_points(0.5)])
            .with_draw_order(DrawOrder::from(0.5));
        recording.log_static(&path(&["plan", "polar"]), &lines)?;
        let decimals = (-self.spacing.log10().floor()).max(0.0) as usize;
        let latitude = |k: usize| {
            let minutes = 60.0 * 90.0 - k as f64 * self.spacing;
            angle(if self.south { -minutes } else { minutes }, LETTERS[0], decimals)
        };
        let aside = 0.5 * MERIDIANS as f64;
        let parallels = (1..self.count).map(|k| {
            let colatitude = k as f64 * self.spacing;
            (at(colatitude, shifted(self.start[1].round() + aside)), latitude(k))
        });
        let meridians = meridians().map(|k| {
            let longitude = if k > 180.0 { k - 360.0 } else { k };
            let place = at(last - 0.5 * self.spacing, shifted(k));
            (place, format!("{}°{}", longitude.abs(), LETTERS[1][usize::from(longitude < 0.0)]))
        });
        let (places, names): (Vec<_>, Vec<_>) = parallels.chain(meridians).unzip();
        let names = Points2D::new(places)
            .with_labels(names)
            .with_colors([BOUND])
            .with_radii([Radius::new_ui_points(1.0)])
            .with_show_labels(true);
        recording.log_static(&path(&["plan", "polar", "names"]), &names)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 450 m before the north pole at 20 deg E the pole is 450 m north; 450 m beyond it, at 160 deg W,
    /// a place is 900 m north, and a quarter of a turn east of the start it is as far east as the pole is north.
    #[test]
    fn the_pole_is_where_the_start_sees_it() {
        let colatitude = 450.0 / MINUTE;
        let start = Place { ned: [0.0; 3], geo: [90.0 - colatitude / 60.0, 20.0], sigma: 1.0 };
        let geo = [[89.99, -180.0], [90.0, 180.0]];
        let extent = Extent { low: [-300.0, -200.0, 0.0], high: [1000.0, 100.0, 60.0], geo };
        let Some(polar) = Polar::new(&extent, &start) else { unreachable!("a pole is near") };
        let near = |found: [f64; 2], expected: [f64; 2]| {
            assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-6), "{found:?}");
        };
        near(polar.place(0.0, 0.0), [450.0, 0.0]);
        near(polar.place(colatitude, 0.0), [0.0, 0.0]);
        near(polar.place(colatitude, 180.0), [900.0, 0.0]);
        near(polar.place(colatitude, 90.0), [450.0, 450.0]);
        assert_eq!(polar.title(), "Around the north pole, lines every 0.2' and 30 deg");
        let south = Place { geo: [-start.geo[0], 20.0], ..start };
        let polar = Polar::new(&extent, &south).map(|polar| polar.place(0.0, 0.0));
        near(polar.unwrap_or_default(), [-450.0, 0.0]);
        let far = Place { geo: [60.0, 20.0], ..start };
        assert!(Polar::new(&Extent { geo: [[60.0, 20.0]; 2], ..extent }, &far).is_none());
    }
}
