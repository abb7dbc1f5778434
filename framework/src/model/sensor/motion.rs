//! Rigid-body motion near the Earth, as a simulation generates it and a reference records it.

use crate::state::geodesy::Geodetic;
use crate::units::time::Time;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// The motion of the body at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The time.
    pub time: Time,
    /// Position of the body's origin.
    pub position: Geodetic,
    /// Earth-referenced velocity in north, east, down, m/s.
    pub velocity: Vector3<f64>,
    /// Attitude: body to navigation frame.
    pub c_b_n: UnitQuaternion<f64>,
    /// Angular rate of the body with respect to inertial space in body axes, rad/s.
    pub w_ib_b: Vector3<f64>,
    /// Specific force in body axes, m/s^2.
    pub f_ib_b: Vector3<f64>,
}

impl Motion {
    /// A motion of which nothing is known: every number is NaN.
    pub fn unknown(time: Time) -> Self {
        let (nan, unknown) = (f64::NAN, Vector3::repeat(f64::NAN));
        Self {
            time,
            position: Geodetic { latitude: nan, longitude: nan, height: nan },
            velocity: unknown,
            c_b_n: UnitQuaternion::new_unchecked(Quaternion::new(nan, nan, nan, nan)),
            w_ib_b: unknown,
            f_ib_b: unknown,
        }
    }

    /// At rest on the equator, level and heading north, for uses in which the motion is irrelevant.
    pub(crate) fn at_rest() -> Self {
        Self {
            time: Time::default(),
            position: Geodetic { latitude: 0.0, longitude: 0.0, height: 0.0 },
            velocity: Vector3::zeros(),
            c_b_n: UnitQuaternion::identity(),
            w_ib_b: Vector3::zeros(),
            f_ib_b: Vector3::zeros(),
        }
    }
}

/// A known motion, on which sensors are simulated. Requested times do not decrease.
///
/// ```
/// use navfuse_core::model::sensor::motion::{Motion, Trajectory};
/// use navfuse_core::nalgebra::{UnitQuaternion, Vector3};
/// use navfuse_core::state::geodesy::Geodetic;
/// use navfuse_core::units::time::Time;
/// /// At rest on a planet that does not turn.
/// struct Bench;
/// const GRAVITY: f64 = 9.8;
/// impl Trajectory for Bench {
///     fn at(&mut self, time: Time) -> Motion {
///         Motion {
///             time,
///             position: Geodetic { latitude: 0.5, longitude: 0.0, height: 0.0 },
///             velocity: Vector3::zeros(),
///             c_b_n: UnitQuaternion::identity(),
///             w_ib_b: Vector3::zeros(),
///             f_ib_b: Vector3::new(0.0, 0.0, -GRAVITY),
///         }
///     }
///     fn increments(&mut self, from: Time, to: Time) -> (Vector3<f64>, Vector3<f64>) {
///         (Vector3::zeros(), Vector3::new(0.0, 0.0, -GRAVITY * to.since(from)))
///     }
/// }
/// ```
pub trait Trajectory: Send {
    /// The motion at a time.
    fn at(&mut self, time: Time) -> Motion;
    /// Integrals of angular rate (rad) and specific force (m/s) in body axes over an interval.
    fn increments(&mut self, from: Time, to: Time) -> (Vector3<f64>, Vector3<f64>);
}
