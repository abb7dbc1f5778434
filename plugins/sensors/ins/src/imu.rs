//! The inertial measurement unit: a driving sensor, with its noise and its simulator.

use crate::coast::Coast;
use crate::errors::{self, Axes, GSensitivities, Scales};
use crate::grade::Grade;
use crate::screening::ImuScreening;
use nalgebra::Vector3;
use navfuse_core::compose::Composer;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::simulate::{Scene, Simulate};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{Handle, display};
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

/// Standard gravity, m/s^2.
pub(crate) const STANDARD_GRAVITY: f64 = 9.806_65;

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
    /// Class of the data sheet: `mems`, `tactical` or `navigation`. It gives every other key of noise
    /// and errors that is absent, here and among the biases of the process. Default: none, and no
    /// errors but noise and biases.
    pub grade: Option<Grade>,
    /// Angular random walk: white noise of the gyros, one value or one per axis. Required without
    /// `grade`.
    pub gyro_noise: Option<Sigma<Triple<AngularRateNoise>>>,
    /// Velocity random walk: white noise of the accelerometers, one value or one per axis. Required
    /// without `grade`.
    pub accel_noise: Option<Sigma<Triple<AccelerationNoise>>>,
    /// Scale factor errors of the gyros. Default: none, or those of the grade.
    pub gyro_scale: Option<Scales>,
    /// Scale factor errors of the accelerometers. Default: none, or those of the grade.
    pub accel_scale: Option<Scales>,
    /// Non-orthogonality of the gyros: about each axis half the angle by which the other two are
    /// closer than 90 deg. Default: none, or that of the grade.
    pub gyro_axes: Option<Axes>,
    /// Non-orthogonality of the accelerometers. Default: none, or that of the grade.
    pub accel_axes: Option<Axes>,
    /// Rotation of the gyros' axes against the body. Default: none, or that of the grade.
    pub gyro_misalignment: Option<Axes>,
    /// Rotation of the accelerometers' axes against the body. Default: none, or that of the grade.
    pub accel_misalignment: Option<Axes>,
    /// Roll, pitch and yaw of the axes of the whole unit in the body, such as
    /// `{ sigma = ["2 deg", "2 deg", "3 deg"] }` of a unit whose position in the vehicle nobody measured.
    /// Default: none, as its axes are those of the body.
    pub mounting: Option<Axes>,
    /// Sensitivity of each gyro to the specific force along its axis. Default: none, or that of the
    /// grade.
    pub g_sensitivity: Option<GSensitivities>,
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

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let imu = match self.grade {
            Some(grade) => self.complete(grade),
            None => self,
        };
        let noise =
            [("gyro_noise", imu.gyro_noise.is_some()), ("accel_noise", imu.accel_noise.is_some())];
        if let Some((key, _)) = noise.iter().find(|(_, given)| !given) {
            let message =
                format!("missing key {key:?}: give the noise of the data sheet, or a grade");
            return Err(ComposeError::new("", message));
        }
        imu.add_errors(composer)?;
        Ok(Role::Input(Box::new(imu)))
    }
}

impl Imu {
    /// Fills the keys of noise and errors that are absent with those of a grade.
    fn complete(self, grade: Grade) -> Self {
        let ([gyro, accel], [gyro_scale, accel_scale]) = (grade.noise(), grade.scales());
        let axes = Some(grade.axes());
        Self {
            gyro_noise: self.gyro_noise.or(Some(Sigma::each(gyro))),
            accel_noise: self.accel_noise.or(Some(Sigma::each(accel))),
            gyro_scale: self.gyro_scale.or(Some(gyro_scale)),
            accel_scale: self.accel_scale.or(Some(accel_scale)),
            gyro_axes: self.gyro_axes.or(axes),
            accel_axes: self.accel_axes.or(axes),
            gyro_misalignment: self.gyro_misalignment.or(axes),
            accel_misalignment: self.accel_misalignment.or(axes),
            g_sensitivity: self.g_sensitivity.or(Some(grade.g_sensitivity())),
            ..self
        }
    }

    /// Adds the states of the errors that the keys give.
    fn add_errors(&self, composer: &mut Composer) -> Result<(), ComposeError> {
        let scales = [("gyro_scale", self.gyro_scale), ("accel_scale", self.accel_scale)];
        for (name, scale) in scales {
            errors::block(scale, composer, name, display::RATIOS)?;
        }
        let axes = [
            ("gyro_axes", self.gyro_axes),
            ("gyro_misalignment", self.gyro_misalignment),
            ("accel_axes", self.accel_axes),
            ("accel_misalignment", self.accel_misalignment),
        ];
        for (name, axes) in axes {
            errors::block(axes, composer, name, errors::AXES)?;
        }
        errors::block(self.mounting, composer, "mounting", display::ANGLES)?;
        errors::block(self.g_sensitivity, composer, "g_sensitivity", errors::PER_G)
    }

    /// 1-sigma of the horizontal specific force that the axes of a level IMU at rest cause, m/s^2.
    pub(crate) fn levelling_error(&self) -> f64 {
        let sigma = |axes: Option<Axes>| axes.and_then(|a| a.sigma).map_or(0.0, |s| s.si().amax());
        let axes = sigma(self.accel_axes).hypot(sigma(self.accel_misalignment));
        STANDARD_GRAVITY * axes.hypot(sigma(self.mounting))
    }

    /// White noise of the gyros, rad/s/sqrt(Hz).
    pub fn gyro_noise(&self) -> Vector3<f64> {
        self.gyro_noise.map_or_else(Vector3::zeros, |noise| noise.si())
    }

    /// White noise of the accelerometers, m/s^2/sqrt(Hz).
    pub fn accel_noise(&self) -> Vector3<f64> {
        self.accel_noise.map_or_else(Vector3::zeros, |noise| noise.si())
    }

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
    pub gravity: Option<Handle<Vector<3>>>,
}

impl Simulate for SimulatedImu {
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let dt = scene.to.since(scene.from);
        let (mut dtheta, mut dvel) = scene.trajectory.increments(scene.from, scene.to);
        dtheta += scene.truth.get(scene.layout, self.gyro_bias) * dt;
        dvel += scene.truth.get(scene.layout, self.accel_bias) * dt;
        if let Some(gravity) = self.gravity {
            // the trajectory has normal gravity, and the specific force is acceleration less gravity
            let gravity = scene.truth.get(scene.layout, gravity);
            dvel -= scene.trajectory.at(scene.from).c_b_n.inverse() * gravity * dt;
        }
        let (gyro, accel) = (self.imu.gyro_noise(), self.imu.accel_noise());
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
