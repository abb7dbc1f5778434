//! Bodies beside the vehicle, such as the ship above it, and the sensors that ride on them.

use crate::model::simulate::Scene;
use crate::state::Handle;
use crate::state::geodesy::Geodetic;
use crate::state::manifold::{Rotation, Vector};
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};
use nalgebra::{Rotation3, UnitQuaternion};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// A place and an attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the reference point.
    pub position: Geodetic,
    /// Attitude: body (forward, right, down) to north, east, down.
    pub c_b_n: UnitQuaternion<f64>,
}

impl Pose {
    /// Number of channels of a pose: latitude, longitude (rad), height (m), roll, pitch and
    /// heading (rad).
    pub const CHANNELS: usize = 6;

    /// Reads the pose in the channels of a sample from `first` on; `None` if one of them is missing.
    pub fn of(sample: &Sample, first: usize) -> Option<Self> {
        let [latitude, longitude, height, roll, pitch, heading] = sample.array(first)?;
        let c_b_n = UnitQuaternion::from_euler_angles(roll, pitch, heading);
        Some(Self { position: Geodetic { latitude, longitude, height }, c_b_n })
    }

    /// Sets the channels of a sample from `first` on.
    pub fn put(&self, sample: &mut Sample, first: usize) {
        let Geodetic { latitude, longitude, height } = self.position;
        let (roll, pitch, heading) = self.c_b_n.euler_angles();
        let channels = [latitude, longitude, height, roll, pitch, heading];
        channels.into_iter().enumerate().for_each(|(k, value)| sample.set(first + k, value));
    }

    /// The pose after a `part` of the way to another one, at constant velocity and angular rate.
    #[must_use]
    pub fn toward(&self, to: &Self, part: f64) -> Self {
        let (a, b) = (self.position, to.position);
        let turn = (b.longitude - a.longitude + PI).rem_euclid(TAU) - PI;
        let position = Geodetic {
            latitude: a.latitude + (b.latitude - a.latitude) * part,
            longitude: a.longitude + turn * part,
            height: a.height + (b.height - a.height) * part,
        };
        let rotation = (self.c_b_n.inverse() * to.c_b_n).scaled_axis();
        Self { position, c_b_n: self.c_b_n * UnitQuaternion::from_scaled_axis(rotation * part) }
    }
}

/// True motion of a body in a simulation.
///
/// A barge that lies at anchor, with its bow to the east:
/// ```
/// use nalgebra::UnitQuaternion;
/// use navfuse_core::model::sensor::body::{Pose, Track};
/// use navfuse_core::state::geodesy::Geodetic;
/// use navfuse_core::units::time::Time;
///
/// #[derive(Debug)]
/// struct Barge(Geodetic);
///
/// impl Track for Barge {
///     fn pose(&self, _: Time) -> Pose {
///         let east = std::f64::consts::FRAC_PI_2;
///         Pose { position: self.0, c_b_n: UnitQuaternion::from_euler_angles(0.0, 0.0, east) }
///     }
/// }
///
/// let barge = Barge(Geodetic { latitude: 0.75, longitude: 0.1, height: 0.0 });
/// assert_eq!(barge.pose(Time::from_nanos(0)), barge.pose(Time::from_nanos(1)));
/// ```
pub trait Track: std::fmt::Debug + Send + Sync {
    /// The pose at a time.
    fn pose(&self, time: Time) -> Pose;
}

/// A body beside the vehicle. A process declares it ([`crate::compose::Composer::moves_body`]); a
/// sensor on it finds it by the name of the process ([`crate::compose::Composer::body`]).
///
/// The navigation of the body measures its pose; the states are the errors of these measurements:
/// the true position is the measured one displaced by `position_error`, and the true attitude is
/// `exp([attitude_error x])` times the measured one, both in north, east, down.
#[derive(Clone, Debug)]
pub struct Body {
    /// Driving sensor whose first [`Pose::CHANNELS`] channels are the measured pose.
    pub sensor: String,
    /// Error of the measured position, m.
    pub position_error: Handle<Vector<3>>,
    /// Error of the measured attitude.
    pub attitude_error: Handle<Rotation>,
    /// Longest time between two samples of the pose, s.
    pub max_gap: Span,
    /// True motion in a simulation.
    pub track: Arc<dyn Track>,
}

impl Body {
    /// The pose that the navigation of the simulated body measures at the time of a sample: the true
    /// one without the true errors.
    pub fn measured(&self, scene: &Scene<'_>) -> Pose {
        let Pose { position, c_b_n } = self.track.pose(scene.to);
        let error: Rotation3<f64> = scene.truth.get(scene.layout, self.attitude_error);
        let place = scene.truth.get(scene.layout, self.position_error);
        Pose {
            position: position.displaced(&-place),
            c_b_n: UnitQuaternion::from_rotation_matrix(&error.inverse()) * c_b_n,
        }
    }
}

/// The body on which a sensor rides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ride {
    /// Index of the sensor that has the pose of the body.
    pub sensor: usize,
    /// First of the [`Pose::CHANNELS`] channels of the riding sensor that take the pose at the time
    /// of a sample.
    pub first: usize,
    /// Longest time between two samples of the pose.
    pub gap: Span,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::sample::SensorId;

    /// Half of the way across the antimeridian, with a turn of 20 deg.
    #[test]
    fn a_pose_between_two_is_on_the_shorter_way() {
        let pose = |longitude: f64, heading: f64| Pose {
            position: Geodetic { latitude: 0.5, longitude: longitude.to_radians(), height: 2.0 },
            c_b_n: UnitQuaternion::from_euler_angles(0.1, 0.0, heading.to_radians()),
        };
        let middle = pose(179.0, 350.0).toward(&pose(-179.5, 10.0), 0.4);
        assert!((middle.position.longitude.to_degrees() - 179.6).abs() < 1e-9);
        // the roll of 0.1 rad turns with the heading: both poses are one turn about the vertical apart
        let off = middle.c_b_n.angle_to(&pose(0.0, 358.0).c_b_n);
        assert!(off < 1e-9, "{off}");
        let mut sample = Sample::empty(Time::default(), SensorId(0));
        assert_eq!(Pose::of(&sample, 3), None);
        middle.put(&mut sample, 3);
        let again = Pose::of(&sample, 3).map(|p| (p.position, p.c_b_n.angle_to(&middle.c_b_n)));
        assert!(again.is_some_and(|(place, off)| place == middle.position && off < 1e-9));
    }
}
