//! The inertial measurement unit: a driving sensor, with its noise and its simulator.

use crate::coast::Coast;
use crate::screening::ImuScreening;
use nalgebra::Vector3;
use navfuse_core::compose::Composer;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::simulate::{Scene, Simulate};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::Handle;
use navfuse_core::state::manifold::Vector;
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{
    Acceleration, AccelerationNoise, AngularRate, AngularRateNoise, Duration, Positive, Sigma,
    Triple,
};
use schemars::JsonSchema;
use serde::Deserialize;

/// Quantity in the channels of an IMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Output {
    /// Mean angular rate and specific force over the interval that ends at the sample's time.
    #[default]
    Rates,
    /// Integrals of both since the previous sample.
    Increments,
}

const RATES: [(&str, &str); 6] = [
    ("gyro_x", "radps"),
    ("gyro_y", "radps"),
    ("gyro_z", "radps"),
    ("accel_x", "mps2"),
    ("accel_y", "mps2"),
    ("accel_z", "mps2"),
];

const INCREMENTS: [(&str, &str); 6] = [
    ("dtheta_x", "rad"),
    ("dtheta_y", "rad"),
    ("dtheta_z", "rad"),
    ("dvel_x", "mps"),
    ("dvel_y", "mps"),
    ("dvel_z", "mps"),
];

/// Inertial measurement unit: three gyros and three accelerometers along forward, right, down. It
/// drives a strapdown process, which estimates its biases.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Imu {
    /// Quantity in the channels: `rates` or `increments`.
    #[serde(default)]
    pub output: Output,
    /// Angular random walk: white noise of the gyros, one value or one per axis.
    pub gyro_noise: Sigma<Triple<AngularRateNoise>>,
    /// Velocity random walk: white noise of the accelerometers, one value or one per axis.
    pub accel_noise: Sigma<Triple<AccelerationNoise>>,
    /// Quantisation step of the angular rate in the recording. The filter treats the rounding as
    /// noise; a simulated IMU rounds its output to this step.
    pub gyro_quantisation: Option<Sigma<AngularRate>>,
    /// Quantisation step of the specific force in the recording.
    pub accel_quantisation: Option<Sigma<Acceleration>>,
    /// Longest interval between samples that is bridged at the mean rate; a longer one ends the
    /// run, unless the process coasts. Default: 0.1 s.
    #[serde(default = "tenth_second")]
    pub max_gap: Positive<Duration>,
    /// Motion of the vehicle on a gap longer than `max_gap`, such as
    /// `{ turn = "1 deg/s/sqrt(Hz)", acceleration = "0.1 m/s^2/sqrt(Hz)" }`: the process coasts and
    /// the other sensors carry on. Default: such a gap ends the run.
    pub coast: Option<Coast>,
    /// Faults of single samples and short spans that the filter notices and bridges: `"off"`, or a
    /// table of limits. By default, the limits are learnt from the samples.
    #[serde(default)]
    pub screening: ImuScreening,
}

fn tenth_second() -> Positive<Duration> {
    Positive::from_si(0.1)
}

impl SensorType for Imu {
    const TYPE: &'static str = "imu";
    const INPUT: bool = true;

    fn channels(&self) -> Vec<Channel> {
        match self.output {
            Output::Rates => Channel::all(RATES).into(),
            Output::Increments => Channel::all(INCREMENTS).into(),
        }
    }

    fn build(self, _composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Input(Box::new(self)))
    }
}

impl Imu {
    /// Mean angular rate (rad/s) and specific force (m/s^2) of a sample that covers `interval`
    /// seconds; `None` if channels are missing.
    #[inline]
    pub(crate) fn rates(
        &self,
        sample: &Sample,
        interval: f64,
    ) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let c: [f64; 6] = sample.array(0)?;
        let share = self.share(interval);
        Some((Vector3::new(c[0], c[1], c[2]) * share, Vector3::new(c[3], c[4], c[5]) * share))
    }

    /// Factor from the channels of a sample that covers `interval` seconds to rates.
    pub(crate) fn share(&self, interval: f64) -> f64 {
        match self.output {
            Output::Rates => 1.0,
            Output::Increments => 1.0 / interval,
        }
    }

    /// Variance of the noise of one axis, integrated over `dt` of a sample's `duration`:
    /// `S dt + step^2/12 dt duration`. The first term is white noise of density `S = noise^2`; the
    /// second is the rounding, uniform within a step (a uniform distribution has the variance
    /// `step^2/12`), of which a part of the interval has its share, so that the parts add up to the
    /// `step^2/12 duration^2` of the whole sample.
    pub(crate) fn variance(noise: f64, step: f64, dt: f64, duration: f64) -> f64 {
        noise * noise * dt + step * step * (1.0 / 12.0) * dt * duration
    }

    pub(crate) fn gyro_step(&self) -> f64 {
        self.gyro_quantisation.map_or(0.0, |q| q.value().si())
    }

    pub(crate) fn accel_step(&self) -> f64 {
        self.accel_quantisation.map_or(0.0, |q| q.value().si())
    }
}

/// Simulates an IMU with the true biases of the process that it drives.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedImu {
    pub imu: Imu,
    pub gyro_bias: Handle<Vector<3>>,
    pub accel_bias: Handle<Vector<3>>,
}

impl Simulate for SimulatedImu {
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let dt = scene.to.since(scene.from);
        let (mut dtheta, mut dvel) = scene.trajectory.increments(scene.from, scene.to);
        dtheta += scene.truth.get(scene.layout, self.gyro_bias) * dt;
        dvel += scene.truth.get(scene.layout, self.accel_bias) * dt;
        let (gyro, accel) = (self.imu.gyro_noise.value().si(), self.imu.accel_noise.value().si());
        let spread = dt.sqrt() * scene.noise;
        for k in 0..3 {
            dtheta[k] += gyro[k] * spread * scene.random.normal();
            dvel[k] += accel[k] * spread * scene.random.normal();
        }
        let share = if self.imu.output == Output::Rates { 1.0 / dt } else { 1.0 };
        let round = |x: f64, step: f64| if step > 0.0 { (x / step).round() * step } else { x };
        for k in 0..3 {
            sample.set(k, round(dtheta[k] / dt, self.imu.gyro_step()) * dt * share);
            sample.set(k + 3, round(dvel[k] / dt, self.imu.accel_step()) * dt * share);
        }
    }

    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(self.clone())
    }
}
