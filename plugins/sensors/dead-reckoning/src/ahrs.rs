//! The attitude and heading reference system: a driving sensor, with its error and its simulator.

use navfuse_core::model::simulate::Simulate;
use navfuse_core::nalgebra::Rotation3;
use navfuse_core::prelude::*;
use navfuse_core::units::Duration;

/// Attitude and heading reference system (AHRS): roll, pitch and yaw of the vehicle. It drives a
/// dead-reckoning process, which estimates its slow error.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ahrs {
    /// White noise of roll, pitch and yaw from sample to sample, 1-sigma.
    pub noise: Sigma<Angle>,
    /// Slow error of roll and pitch, 1-sigma: what the data sheet calls their accuracy.
    pub tilt: Sigma<Angle>,
    /// Slow error of the heading, 1-sigma.
    pub heading: Sigma<Angle>,
    /// Correlation time of the slow error. Default: 10 min.
    #[serde(default = "ten_minutes")]
    pub correlation_time: Positive<Duration>,
    /// Declination that is added to the yaw of the samples, for headings from magnetic north; east
    /// positive. Default: zero.
    #[serde(default = "Ahrs::true_north")]
    pub declination: Angle,
    /// Longest interval between samples; on a longer one the process coasts. Default: 1 s.
    #[serde(default = "one_second")]
    pub max_gap: Positive<Duration>,
}

fn ten_minutes() -> Positive<Duration> {
    Positive::from_si(600.0)
}

fn one_second() -> Positive<Duration> {
    Positive::from_si(1.0)
}

const CHANNELS: [(&str, &str); 3] = [("roll", "rad"), ("pitch", "rad"), ("yaw", "rad")];

impl SensorType for Ahrs {
    const TYPE: &'static str = "ahrs";
    const INPUT: bool = true;

    fn channels(&self) -> Vec<Channel> {
        Channel::all(CHANNELS).into()
    }

    fn build(self, _composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Input(Box::new(self)))
    }
}

impl Ahrs {
    fn true_north() -> Angle {
        Angle::from_si(0.0)
    }

    /// Attitude `C_b^n` of a sample; `None` if channels are missing.
    pub(crate) fn attitude(&self, sample: &Sample) -> Option<Rotation3<f64>> {
        let [roll, pitch, yaw] = sample.array(0)?;
        Some(Rotation3::from_euler_angles(roll, pitch, yaw + self.declination.si()))
    }

    /// 1-sigma of the slow error about north, east and down, rad.
    pub(crate) fn error(&self) -> Vector3<f64> {
        let (tilt, heading) = (self.tilt.value().si(), self.heading.value().si());
        Vector3::new(tilt, tilt, heading)
    }
}

/// Simulates an AHRS with the true attitude and slow error of the process that it drives:
/// `C = exp([(e + w) x]) C_b^n`.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedAhrs {
    pub ahrs: Ahrs,
    pub attitude: Handle<Rotation>,
    pub error: Handle<Vector<3>>,
}

impl Simulate for SimulatedAhrs {
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let sigma = self.ahrs.noise.value().si() * scene.noise;
        let white = Vector3::from_fn(|_, _| sigma * scene.random.normal());
        let error = scene.truth.get(scene.layout, self.error) + white;
        // a truth that wanders follows no trajectory
        let c_b_n = if scene.layout.block(self.attitude).wanders {
            scene.truth.get(scene.layout, self.attitude)
        } else {
            scene.trajectory.at(scene.to).c_b_n.to_rotation_matrix()
        };
        let (roll, pitch, yaw) = (Rotation3::new(error) * c_b_n).euler_angles();
        let yaw = yaw - self.ahrs.declination.si();
        [roll, pitch, yaw].into_iter().enumerate().for_each(|(k, angle)| sample.set(k, angle));
    }

    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(self.clone())
    }
}
