//! The velocity that a fix of GNSS gives: measured, or from successive positions.
//!
//! Two positions give the mean velocity between them. The means of the integral of the specific
//! force and of the forward axis over the same time belong to it, so that no acceleration between
//! the positions is lost.

use super::super::inertial::Integral;
use super::{SLIP, VELOCITY};
use nalgebra::Vector3;
use navfuse_core::checkpoint::saved;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::time::{Span, Time};
use std::f64::consts::SQRT_2;

/// Least time, s, and least distance, m, between two positions that give a velocity, and the time
/// after which they give one at any distance.
const SHORTEST: f64 = 1.0;
const LEAST: f64 = 3.0;
const LONGEST: f64 = 10.0;
/// Least error of a distance between two positions, m: most of the error of a good receiver is common to both.
const DISTANCE: f64 = 0.7;
/// Least distance in errors of it: noise in the plane, of which each axis has this error, is further by
/// exp(-3^2 / 2) = 1 %.
const CLEAR: f64 = 3.0;
/// Usual slope of a path: a vertical noise above it shows no vertical velocity.
const SLOPE: f64 = 0.2;

/// The velocity at a time, and what the IMU measured until then.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fix {
    pub time: Time,
    /// Velocity north, east, down, m/s.
    pub velocity: Vector3<f64>,
    /// `int C_b^b0 f^b dt`, m/s.
    pub dvel: Vector3<f64>,
    /// `C_b^b0 [1 0 0]'`.
    pub forward: Vector3<f64>,
    /// Expected error of the velocity, m/s, and of its direction as the forward axis, rad.
    pub sigma: [f64; 2],
    /// A position and its time.
    pub place: (Time, Geodetic<f64>),
}

saved!(Fix { time, velocity, dvel, forward, sigma, place });

impl Fix {
    /// A measured velocity at a position.
    pub fn measured(
        place: (Time, Geodetic<f64>),
        velocity: Vector3<f64>,
        integral: &Integral,
    ) -> Self {
        let forward = integral.c_b_b0 * Vector3::x();
        let sigma = [VELOCITY, SLIP];
        Self { time: place.0, velocity, dvel: integral.dvel, forward, sigma, place }
    }
}

/// A position, and the integrals of velocity and forward axis until then.
#[derive(Clone, Copy, Debug, Default)]
struct Anchor {
    place: (Time, Geodetic<f64>),
    integrals: [Vector3<f64>; 2],
}

saved!(Anchor { place, integrals });

/// The positions of a receiver without velocity.
#[derive(Clone, Debug, Default)]
pub(super) struct Positions {
    /// Integrals over time of `int C_b^b0 f^b dt` and of the forward axis, and their last values.
    integrals: [Vector3<f64>; 2],
    values: [Vector3<f64>; 2],
    anchor: Option<Anchor>,
}

saved!(Positions { integrals, values, anchor });

impl Positions {
    /// Follows the IMU over an interval of `dt` seconds.
    pub fn advance(&mut self, integral: &Integral, dt: f64) {
        let values = [integral.dvel, integral.c_b_b0 * Vector3::x()];
        for ((sum, before), now) in self.integrals.iter_mut().zip(self.values).zip(values) {
            *sum += (before + now) * (0.5 * dt);
        }
        self.values = values;
    }

    /// The mean velocity since an earlier position, with this one, whose 1-sigma is horizontal and vertical, m; `None`
    /// until the two are far enough apart.
    pub fn take(&mut self, place: (Time, Geodetic<f64>), noise: [f64; 2]) -> Option<Fix> {
        let here = Anchor { place, integrals: self.integrals };
        let from = *self.anchor.get_or_insert(here);
        let (dt, mut moved) = (place.0.since(from.place.0), place.1.ned_from(&from.place.1));
        // both positions have the noise that the filter assumes to be white
        let [error, height] = noise.map(|sigma| (SQRT_2 * sigma).max(DISTANCE));
        let way = moved.xy().norm();
        if dt < SHORTEST || (way < LEAST.max(CLEAR * error) && dt < LONGEST) {
            return None;
        }
        let slope = (SLOPE * way).powi(2);
        moved.z *= slope / (slope + height * height);
        self.anchor = Some(here);
        let [dvel, forward] = [0, 1].map(|k| (here.integrals[k] - from.integrals[k]) / dt);
        let time = from.place.0 + Span::from_seconds(0.5 * dt)?;
        let sigma = [error / dt, SLIP.hypot(error / moved.norm().max(error))];
        Some(Fix { time, velocity: moved / dt, dvel, forward, sigma, place: from.place })
    }
}
