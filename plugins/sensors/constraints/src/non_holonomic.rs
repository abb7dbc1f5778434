//! The non-holonomic constraint of a wheeled vehicle (Dissanayake, Sukkarieh, Nebot &
//! Durrant-Whyte 2001): a point on the axle that is not steered moves along the vehicle's axis.
//!
//! `0 = [v_y, v_z] + noise`, with `v = R_y(pitch + e) R_z(yaw + s) (C_n^b v^n + w_eb^b x l)`, the
//! side slip `s` and the pitch `e` of the suspension.
//!
//! Tyres slip sideways in a turn, and the suspension pitches when the vehicle brakes: by an angle,
//! so that the speed across the axis grows with the speed, and for seconds. White noise alone would
//! let the filter average these errors away and become overconfident, so each angle is a state: a
//! Gauss-Markov process.

use navfuse_core::checkpoint::Io;
use navfuse_core::compose::calibration::{Calibration, LeverArm};
use navfuse_core::model::sensor::detector::Detector;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Non-holonomic constraint of a land vehicle: the point at the lever arm, on the axle that is not
/// steered, moves neither sideways nor normal to the road. It needs no sensor; the filter applies it
/// at its rate.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NonHolonomic {
    /// 1-sigma of the fast part of the sideways speed: vibration, and noise of the gyros times the
    /// lever arm.
    pub lateral_noise: Sigma<Speed>,
    /// 1-sigma of the fast part of the speed normal to the road: bumps.
    pub vertical_noise: Sigma<Speed>,
    /// Side slip of the tyres: the angle between the direction of motion and the vehicle's axis, in
    /// turns, on camber and in wind. Give its stationary `sigma` and its `correlation_time`.
    /// Default: zero.
    #[serde(default)]
    pub side_slip: Calibration<Angle, AngularRateNoise>,
    /// Pitch of the body on its suspension against the road, when it brakes and accelerates. Give
    /// its stationary `sigma` and its `correlation_time`. Default: zero.
    #[serde(default)]
    pub suspension: Calibration<Angle, AngularRateNoise>,
    /// Pitch of the vehicle's axis relative to the IMU: C_b^v = R_y(pitch) R_z(yaw). Default: zero.
    #[serde(default)]
    pub pitch: Calibration<Angle, AngularRateNoise>,
    /// Yaw of the vehicle's axis relative to the IMU. Default: zero.
    #[serde(default)]
    pub yaw: Calibration<Angle, AngularRateNoise>,
    /// Position of the middle of the unsteered axle from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Rate at which the filter applies the constraint.
    #[serde(default = "ten_hertz")]
    pub rate: Positive<Frequency>,
    /// Process whose motion is constrained.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

fn ten_hertz() -> Positive<Frequency> {
    Positive::from_si(10.0)
}

impl SensorType for NonHolonomic {
    const TYPE: &'static str = "non-holonomic";

    fn channels(&self) -> Vec<Channel> {
        ["lateral", "vertical"].map(|name| Channel::new(name, "mps")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let lever_arm =
            self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        let turns = self.lever_arm != LeverArm::default();
        let model = NonHolonomicModel {
            navigation: Navigation::find_turning(composer, &self.navigation, "lever_arm", turns)?,
            side_slip: self.side_slip.block(composer, "side_slip", &[0.0], display::YAW)?,
            suspension: self.suspension.block(composer, "suspension", &[0.0], display::PITCH)?,
            pitch: self.pitch.block(composer, "pitch", &[0.0], display::PITCH)?,
            yaw: self.yaw.block(composer, "yaw", &[0.0], display::YAW)?,
            lever_arm,
            sigma: [self.lateral_noise.value().si(), self.vertical_noise.value().si()],
        };
        composer.mounted(Mounting::at(lever_arm).pointed(model.pitch, model.yaw));
        let period = 1.0 / self.rate.value().si();
        composer.detected_by(Periodic { period, next: Time::MIN });
        Ok(Role::measurement(model))
    }
}

/// The measurement model of a [`NonHolonomic`] constraint.
#[derive(Clone, Debug)]
struct NonHolonomicModel {
    navigation: Navigation,
    side_slip: Handle<Scalar>,
    suspension: Handle<Scalar>,
    pitch: Handle<Scalar>,
    yaw: Handle<Scalar>,
    lever_arm: Handle<Vector<3>>,
    /// 1-sigma, m/s.
    sigma: [f64; 2],
}

impl MeasurementModel<2> for NonHolonomicModel {
    /// `z = [v_y, v_z]` of the velocity `v = R_y(pitch) R_z(yaw) v^b`, multiplied out: the first row
    /// of the rotation, the speed ahead, is not constrained.
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let v = self.navigation.velocity_at(x, &x.get(self.lever_arm));
        let (sin_pitch, cos_pitch) = (x.get(self.pitch) + x.get(self.suspension)).sin_cos();
        let (sin_yaw, cos_yaw) = (x.get(self.yaw) + x.get(self.side_slip)).sin_cos();
        let along = cos_yaw * v.x + sin_yaw * v.y;
        let lateral = cos_yaw * v.y - sin_yaw * v.x;
        let vertical = sin_pitch * along + cos_pitch * v.z;
        SVector::from([lateral, vertical])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::from_diagonal(&SVector::from(self.sigma.map(|s| s * s)))
    }
}

/// Applies knowledge that always holds at a rate.
#[derive(Clone)]
struct Periodic {
    /// s.
    period: f64,
    next: Time,
}

impl Detector for Periodic {
    fn detects(&mut self, sample: &Sample) -> bool {
        let due = sample.time >= self.next;
        if due {
            let period = Span::from_seconds(self.period).unwrap_or_default();
            // a grid from the first sample on, without the samples' own rounding
            let on_grid = self.next > Time::MIN && sample.time < self.next + period;
            self.next = if on_grid { self.next + period } else { sample.time + period };
        }
        due
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        io.pass(&mut self.next);
    }

    fn boxed_clone(&self) -> Box<dyn Detector> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::units::sample::SensorId;

    /// Times, in ms, of the samples at which a constraint of 10 Hz is applied.
    fn applied(samples: impl IntoIterator<Item = i64>) -> Vec<i64> {
        let mut periodic = Periodic { period: 0.1, next: Time::MIN };
        let mut due = |ms: &i64| {
            let time = Time::from_nanos(ms * 1_000_000);
            periodic.detects(&Sample::new(time, SensorId(0), &[]))
        };
        samples.into_iter().filter(|ms| due(ms)).collect()
    }

    #[test]
    fn the_constraint_is_applied_at_the_first_sample_and_at_its_rate() {
        assert_eq!(applied((0..50).map(|k| 10 * k)), [0, 100, 200, 300, 400]);
        assert_eq!(applied((0..6).map(|k| 250 * k)), [0, 250, 500, 750, 1000, 1250]);
    }

    #[test]
    fn samples_beside_the_grid_do_not_move_it() {
        // every 30 ms: the first at or after 0, 100, 200, 300, 400, 500 and 600 ms
        assert_eq!(applied((0..21).map(|k| 30 * k)), [0, 120, 210, 300, 420, 510, 600]);
    }

    #[test]
    fn after_a_gap_of_a_period_the_grid_begins_anew() {
        // 199 ms is still within the period that began at 100 ms, 200 ms is not
        assert_eq!(applied([0, 199, 200, 299, 300]), [0, 199, 200, 300]);
        assert_eq!(applied([0, 250, 300, 349, 350]), [0, 250, 350]);
    }
}
