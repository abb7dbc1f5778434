//! The vessel from which an acoustic positioning system measures: its positions and headings.

use navfuse_core::nalgebra::Vector3;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_frames::Stamp;
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Time in ns that positions and headings are kept; a sentence of a transponder arrives seconds after
/// its time of validity.
const KEPT: i64 = 60_000_000_000;
/// Largest number of positions or headings that are kept: 68 Hz for this time.
const MOST: usize = 4096;
/// Longest time in ns between two of them that is interpolated.
const GAP: i64 = 10_000_000_000;
/// Longest time in ns after the last of them that is extrapolated.
const AFTER: i64 = 2_000_000_000;

/// The axes along which a transponder is measured from the vessel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Starboard and forward of the vessel, level.
    HeadUp,
    /// North and east.
    NorthEast,
    /// East and north.
    EastNorth,
}

/// Values with their times in ns, in order.
#[derive(Debug)]
struct Recent<const N: usize>(VecDeque<(i64, [f64; N])>);

impl<const N: usize> Recent<N> {
    fn add(&mut self, time: i64, value: [f64; N]) {
        if self.0.back().is_some_and(|(last, _)| time < *last) {
            // a clock that goes back begins again
            self.0.clear();
        }
        if self.0.back().is_none_or(|(last, _)| time > *last) {
            self.0.push_back((time, value));
        }
        while self.0.len() > MOST || self.0.front().is_some_and(|(first, _)| time - first > KEPT) {
            self.0.pop_front();
        }
    }

    /// The value at a time, between two of the track or up to [`AFTER`] after the last; the last
    /// coordinate is an angle.
    fn at(&self, time: i64) -> Option<[f64; N]> {
        let after = self.0.partition_point(|(t, _)| *t <= time);
        let (t0, a) = self.0.get(after.checked_sub(1)?)?;
        if *t0 == time {
            return Some(*a);
        }
        let (from, to) = match self.0.get(after) {
            Some(to) => ((*t0, *a), *to),
            None if time - t0 > AFTER => return None,
            None => (*self.0.get(after.checked_sub(2)?)?, (*t0, *a)),
        };
        let interval = to.0 - from.0;
        let fraction = (time - from.0) as f64 / interval as f64;
        let value = |k: usize| {
            let mut change = to.1[k] - from.1[k];
            if k + 1 == N {
                change = (change + PI).rem_euclid(TAU) - PI;
            }
            from.1[k] + fraction * change
        };
        (interval <= GAP).then(|| std::array::from_fn(value))
    }
}

/// The recent positions and headings of a vessel.
#[derive(Debug)]
pub struct Vessel {
    positions: Recent<2>,
    headings: Recent<1>,
}

impl Default for Vessel {
    fn default() -> Self {
        Self { positions: Recent(VecDeque::new()), headings: Recent(VecDeque::new()) }
    }
}

/// The time of a stamp in ns, on the clock that all sentences of the file have.
fn nanos(stamp: Stamp) -> Option<i64> {
    match stamp {
        Stamp::Date(time) | Stamp::TimeOfDay(time) => Some(time),
        Stamp::Missing | Stamp::Elapsed(_) => None,
    }
}

impl Vessel {
    /// Takes a latitude and a longitude, rad.
    pub fn position(&mut self, stamp: Stamp, position: [f64; 2]) {
        if let Some(time) = nanos(stamp) {
            self.positions.add(time, position);
        }
    }

    /// Takes a true heading, rad.
    pub fn heading(&mut self, stamp: Stamp, heading: f64) {
        if let Some(time) = nanos(stamp) {
            self.headings.add(time, [heading]);
        }
    }

    /// Latitude and longitude of a transponder at this offset, m, from the vessel; `None` without
    /// a position of the time, or without a heading where the axes turn with the vessel.
    pub fn transponder(&self, stamp: Stamp, axes: Axes, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let time = nanos(stamp)?;
        let [latitude, longitude] = self.positions.at(time)?;
        let (north, east) = match axes {
            Axes::NorthEast => (x, y),
            Axes::EastNorth => (y, x),
            Axes::HeadUp => {
                let [heading] = self.headings.at(time)?;
                let (sin, cos) = heading.sin_cos();
                (y * cos - x * sin, y * sin + x * cos)
            }
        };
        let vessel = Geodetic { latitude, longitude, height: 0.0 };
        let found = vessel.displaced(&Vector3::new(north, east, 0.0));
        let longitude = (found.longitude + PI).rem_euclid(TAU) - PI;
        (found.latitude.abs() < PI / 2.0).then_some([found.latitude, longitude])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    #[test]
    fn a_track_is_interpolated_and_ends_after_its_last_value() {
        let mut track = Recent::<1>(VecDeque::new());
        assert_eq!(track.at(0), None);
        track.add(10 * SECOND, [3.1]);
        assert_eq!((track.at(10 * SECOND), track.at(11 * SECOND)), (Some([3.1]), None));
        // through 180 deg
        track.add(12 * SECOND, [-3.1]);
        let near = |time: i64, expected: f64| {
            track.at(time).is_some_and(|[found]| (found - expected).abs() < 1e-12)
        };
        assert!(near(11 * SECOND, PI));
        // the last two go on for 2 s
        assert!(near(13 * SECOND, 3.1 + 1.5 * (TAU - 6.2)));
        assert_eq!((track.at(15 * SECOND), track.at(9 * SECOND)), (None, None));
        // a gap is not bridged, old values are dropped, and a clock that goes back begins again
        track.add(30 * SECOND, [0.0]);
        assert_eq!(track.at(20 * SECOND), None);
        track.add(73 * SECOND, [0.0]);
        assert_eq!(track.0.len(), 2);
        track.add(5 * SECOND, [1.0]);
        assert_eq!(track.0.len(), 1);
    }
}
