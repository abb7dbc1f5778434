//! The attitude over a recording, integrated from its gyros.

use crate::{Mounting, Recording, SegmentError};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_ins::earth::LocalEarth;

/// Time for which a rate of the axes is held, s: in it, an acceleration of 1 m/s^2 changes the
/// transport rate by 1.6e-8 rad/s, 2e-4 of the Earth's rate.
const HELD: f64 = 0.1;

/// Start of an [`Attitude`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeStart {
    /// Time, s.
    pub time: f64,
    /// Attitude: body to north-east-down.
    pub c_b_n: UnitQuaternion<f64>,
    /// Position, for the Earth's rate and gravity.
    pub position: Geodetic,
}

impl AttitudeStart {
    /// Returns the scenario's initial attitude, or else the first sample of the reference at or
    /// after the filter's start.
    ///
    /// # Errors
    /// Returns an error if neither is available.
    pub fn of(recording: &Recording) -> Result<Self, SegmentError> {
        let reference = recording.reference.as_ref().and_then(|r| {
            let k = r.time.partition_point(|t| *t < recording.start);
            r.time.get(k).map(|time| Self {
                time: *time,
                c_b_n: r.value[k].c_b_n,
                position: r.value[k].position,
            })
        });
        let given = recording.initial_attitude;
        let begin = recording.start.max(recording.imu.samples.time.first().copied().unwrap_or(0.0));
        let given =
            given.map(|c_b_n| Self { time: begin, c_b_n, position: recording.initial_position });
        given.or(reference).ok_or_else(|| {
            SegmentError::Missing(
                "no initial attitude: the reference has no sample after estimator.start, or an \
                 alignment finds the attitude during the run; give process.ins.attitude.initial, \
                 process.ins.alignment = \"given\" and estimator.initial = \"given\", or a \
                 reference"
                    .into(),
            )
        })
    }
}

/// Attitude at every sample of the IMU. The gyros are integrated from one known attitude, forward
/// and backward, less the rates of the Earth and of the local axes (Pan & Wu eq. 3).
#[derive(Clone, Debug)]
pub struct Attitude {
    /// Start.
    pub start: AttitudeStart,
    /// Subtracted gyro bias, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Times of the IMU's samples, s.
    pub time: Vec<f64>,
    /// Body to north-east-down at these times.
    pub c_b_n: Vec<UnitQuaternion<f64>>,
    /// Angular rate of the body relative to north-east-down, in body axes, rad/s: the mean over the
    /// interval that ends at the time.
    pub w_nb_b: Vec<Vector3<f64>>,
}

impl Attitude {
    /// Integrates the gyros less `gyro_bias`. The transport rate follows from the first body
    /// velocity at the given mounting; without a mounting it is left out.
    pub fn integrate(
        recording: &Recording,
        start: AttitudeStart,
        gyro_bias: Vector3<f64>,
        mounting: Option<&Mounting>,
    ) -> Self {
        let imu = &recording.imu.samples;
        let n = imu.time.len();
        let earth = LocalEarth::at(start.position.latitude, start.position.height);
        let moving = mounting.zip(recording.velocities.first());
        let mut near = 0;
        let mut velocity = |t: f64, c: &UnitQuaternion<f64>| {
            let y = moving.and_then(|(m, v)| {
                let place = v.samples.place_near(&mut near, t)?;
                Some(m.body(&v.samples.value_at(place)))
            });
            y.map_or_else(Vector3::zeros, |v| c * v)
        };
        let mut held = (f64::NEG_INFINITY, Vector3::zeros());
        let mut rate_of_axes = |t: f64, c: &UnitQuaternion<f64>| {
            if (t - held.0).abs() >= HELD {
                held = (t, earth.earth_rate() + earth.transport_rate(&velocity(t, c)));
            }
            c.inverse_transform_vector(&held.1)
        };
        let mut c_b_n = vec![start.c_b_n; n];
        let mut w_nb_b = vec![Vector3::zeros(); n];
        let first = imu.time.partition_point(|t| *t <= start.time);
        let mut c = start.c_b_n;
        let mut from = start.time;
        for k in first..n {
            let (s, t) = (&imu.value[k], imu.time[k]);
            w_nb_b[k] = s.rate - gyro_bias - rate_of_axes(t, &c);
            c *= rotation(w_nb_b[k] * (t - from).min(s.dt));
            c.renormalize_fast();
            (c_b_n[k], from) = (c, t);
        }
        let (mut c, mut to) = (start.c_b_n, start.time);
        for k in (0..first).rev() {
            let (s, t) = (&imu.value[k], imu.time[k]);
            c_b_n[k] = c;
            if let Some(after) = imu.value.get(k + 1).filter(|_| to > t) {
                let w = after.rate - gyro_bias - rate_of_axes(t, &c);
                c *= rotation(-w * (to - t).min(after.dt));
                c.renormalize_fast();
                c_b_n[k] = c;
            }
            w_nb_b[k] = s.rate - gyro_bias - rate_of_axes(t, &c);
            to = t;
        }
        Self { start, gyro_bias, time: imu.time.clone(), c_b_n, w_nb_b }
    }

    /// Replaces the attitude by that of the reference at each of its samples; the gyros bridge the
    /// intervals between them.
    pub fn anchor(&mut self, recording: &Recording) {
        let Some(reference) = &recording.reference else { return };
        let mut next = 0;
        let mut off = UnitQuaternion::identity(); // correction to the reference, body axes
        for (k, c) in self.c_b_n.iter_mut().enumerate() {
            while let Some(t) = reference.time.get(next).filter(|t| **t <= self.time[k]) {
                let then = *c * rotation(self.w_nb_b[k] * (t - self.time[k]));
                off = then.inverse() * reference.value[next].c_b_n;
                next += 1;
            }
            *c *= off;
        }
    }

    /// Returns the gyro bias over spans at rest: the mean rate less the Earth's rate, rad/s. `None`
    /// without such spans. A heading error changes the Earth's rate in body axes, and so enters the
    /// bias; while the attitude stays, both errors cancel.
    pub fn bias_at_rest(
        recording: &Recording,
        start: &AttitudeStart,
        spans: &[[f64; 2]],
    ) -> Option<Vector3<f64>> {
        let earth = LocalEarth::at(start.position.latitude, start.position.height);
        let (mut sum, mut duration) = (Vector3::zeros(), 0.0);
        for [from, to] in spans {
            for (_, s) in recording.imu.samples.samples(*from, *to) {
                sum += s.rate * s.dt;
                duration += s.dt;
            }
        }
        let w_ie_b = start.c_b_n.inverse_transform_vector(&earth.earth_rate());
        (duration > 0.0).then(|| sum / duration - w_ie_b)
    }

    /// Returns the attitude at a time: that of the last sample at or before it, rotated by its
    /// rate. Before the first sample it is that of the first.
    pub fn at(&self, time: f64) -> UnitQuaternion<f64> {
        let after = self.time.partition_point(|t| *t <= time);
        let Some(k) = after.checked_sub(1) else {
            return self.c_b_n.first().copied().unwrap_or_default();
        };
        match self.w_nb_b.get(after) {
            Some(w) => self.c_b_n[k] * rotation(w * (time - self.time[k])),
            None => self.c_b_n[k],
        }
    }

    /// Returns the rotation from body at `to` to body at `from`, with the local axes taken as
    /// constant.
    pub fn between(&self, from: f64, to: f64) -> UnitQuaternion<f64> {
        self.at(from).inverse() * self.at(to)
    }

    /// Returns the Earth's parameters at the start.
    pub fn earth(&self) -> LocalEarth {
        LocalEarth::at(self.start.position.latitude, self.start.position.height)
    }
}

/// Squared half angle up to which [`rotation`] is a series, rad^2.
const SMALL: f64 = 1e-4;

/// Rotation by a vector `v`, with the quaternion `(cos(|v|/2), v sin(|v|/2) / |v|)`. For the small
/// angle between two samples of an IMU, the series have the terms to the sixth power of `|v|/2`; the
/// next ones are below `SMALL^4 / 8! = 2.5e-21`.
pub(crate) fn rotation(v: Vector3<f64>) -> UnitQuaternion<f64> {
    let q = 0.25 * v.norm_squared();
    if q > SMALL {
        return UnitQuaternion::from_scaled_axis(v);
    }
    let cos = 1.0 - q * (1.0 / 2.0 - q * (1.0 / 24.0 - q * (1.0 / 720.0)));
    let sinc = 1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0)));
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, v * (0.5 * sinc)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both forms round a few times: 4 units in the last place of one.
    #[test]
    fn the_rotation_by_a_small_vector_is_that_of_sine_and_cosine() {
        let axis = Vector3::new(1.0, -2.0, 2.0) / 3.0;
        // up to the limit of the series, an angle of 0.02 rad, and above it
        for angle in (0..=250).map(|k| 1e-4 * f64::from(k)) {
            let (series, exact) =
                (rotation(axis * angle), UnitQuaternion::from_scaled_axis(axis * angle));
            let difference = (series.coords - exact.coords).amax();
            assert!(difference < 4.0 * f64::EPSILON, "{angle}: {difference}");
        }
    }
}
