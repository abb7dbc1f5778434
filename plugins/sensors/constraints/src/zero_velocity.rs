//! Zero velocity of a vehicle that stands still (Groves section 15.3), and, where the scenario asks
//! for it, zero rotation (section 15.4.1).
//!
//! `0 = v^n + noise`, and `0 = w_eb^b + noise`.

use crate::standstill::{LONGEST, Settings, Standstill};
use navfuse_core::prelude::*;
use navfuse_core::units::Duration;
use navfuse_ins::Navigation;

/// Zero velocity of a vehicle that stands still. It needs no sensor of its own: the vehicle stands
/// where specific force and angular rate of the IMU are quiet over a window, and where an odometer,
/// if one is named, shows no speed.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ZeroVelocity {
    /// 1-sigma of the velocity at a standstill, north, east and down alike. Default: 1 cm/s.
    #[serde(default = "one_centimetre")]
    pub noise: Sigma<Speed>,
    /// 1-sigma of the angular rate at a standstill, vibration included. With it the filter also
    /// applies zero rotation, which shows the biases of the gyros. Default: not applied.
    pub rotation_noise: Option<Sigma<AngularRate>>,
    /// Window of the detector. Default: 1 s.
    #[serde(default = "one_second")]
    pub window: Positive<Duration>,
    /// Largest standard deviation of the specific force over the window, one value or one for each
    /// axis. A running engine must stay below, a rolling vehicle above. Default: 15 mg.
    pub quiet_force: Option<Positive<Triple<Acceleration>>>,
    /// Largest mean of the angular rate over the window, one value or one for each axis, bias
    /// included. Default: 1 deg/s.
    pub quiet_rotation: Option<Positive<Triple<AngularRate>>>,
    /// Odometer whose speed must also be zero over the window: the name of a sensor with a channel
    /// `speed`. Default: none.
    pub odometer: Option<String>,
    /// Largest speed that the odometer reports at a standstill. Default: 5 cm/s.
    #[serde(default = "five_centimetres")]
    pub quiet_speed: Positive<Speed>,
    /// Rate at which the filter applies the pseudo-measurement at a standstill. Default: 1 Hz.
    #[serde(default = "one_hertz")]
    pub rate: Positive<Frequency>,
    /// Process whose velocity is zero.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

fn one_centimetre() -> Sigma<Speed> {
    Sigma::from_si(0.01)
}
fn five_centimetres() -> Positive<Speed> {
    Positive::from_si(0.05)
}
fn one_second() -> Positive<Duration> {
    Positive::from_si(1.0)
}
fn one_hertz() -> Positive<Frequency> {
    Positive::from_si(1.0)
}

/// Default limit of the standard deviation of the specific force, m/s^2: 15 mg.
const QUIET_FORCE: f64 = 15e-3 * 9.806_65;
/// Default limit of the mean angular rate, rad/s: 1 deg/s.
const QUIET_ROTATION: f64 = std::f64::consts::PI / 180.0;

const VELOCITY: [(&str, &str); 3] = [("vel_n", "mps"), ("vel_e", "mps"), ("vel_d", "mps")];
const ROTATION: [(&str, &str); 3] = [("rate_x", "radps"), ("rate_y", "radps"), ("rate_z", "radps")];

impl SensorType for ZeroVelocity {
    const TYPE: &'static str = "zero-velocity";

    fn channels(&self) -> Vec<Channel> {
        match self.rotation_noise {
            Some(_) => [Channel::all(VELOCITY), Channel::all(ROTATION)].concat(),
            None => Channel::all(VELOCITY).into(),
        }
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let window = self.window.value().si();
        if window > LONGEST {
            let text = format!("{window} s is too long a window: give at most {LONGEST} s");
            return Err(ComposeError::new("window", text));
        }
        let (name, turns) = (&self.navigation, self.rotation_noise.is_some());
        let model = ZeroVelocityModel {
            navigation: Navigation::find_turning(composer, name, "rotation_noise", turns)?,
            velocity: self.noise.value().si(),
            rotation: self.rotation_noise.map_or(0.0, |noise| noise.value().si()),
        };
        composer.detected_by(Standstill::new(Settings {
            window,
            force: self
                .quiet_force
                .map_or(Vector3::repeat(QUIET_FORCE), |limit| limit.value().si()),
            rotation: self
                .quiet_rotation
                .map_or(Vector3::repeat(QUIET_ROTATION), |limit| limit.value().si()),
            odometer: self.odometer,
            speed: self.quiet_speed.value().si(),
            period: 1.0 / self.rate.value().si(),
        }));
        Ok(match self.rotation_noise {
            Some(_) => Role::measurement::<_, 6>(model),
            None => Role::measurement::<_, 3>(model),
        })
    }
}

/// The measurement model of [`ZeroVelocity`]: three rows for the velocity, and three more for the
/// rotation.
#[derive(Clone, Debug)]
struct ZeroVelocityModel {
    navigation: Navigation,
    /// 1-sigma, m/s.
    velocity: f64,
    /// 1-sigma, rad/s.
    rotation: f64,
}

impl MeasurementModel<3> for ZeroVelocityModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        x.get(self.navigation.velocity)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal_element(self.velocity * self.velocity)
    }
}

impl MeasurementModel<6> for ZeroVelocityModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 6> {
        let (v, w) = (x.get(self.navigation.velocity), self.navigation.angular_rate(x));
        SVector::from([v.x, v.y, v.z, w.x, w.y, w.z])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 6, 6> {
        let (v, w) = (self.velocity * self.velocity, self.rotation * self.rotation);
        SMatrix::from_diagonal(&SVector::from([v, v, v, w, w, w]))
    }
}
