//! All samples of a run, gathered without running the filter.

use crate::gather::Builder;
use crate::{SegmentError, Series};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::model::motion::Motion;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// What an IMU measured over one interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Length of the interval that ends at the sample's time, s.
    pub dt: f64,
    /// Mean angular rate `w_ib^b` as the gyros gave it, rad/s.
    pub rate: Vector3<f64>,
    /// Mean specific force `f^b` as the accelerometers gave it, m/s^2.
    pub force: Vector3<f64>,
}

/// The IMU: its samples, and how good it is.
#[derive(Clone, Debug)]
pub struct Imu {
    /// Its samples.
    pub samples: Series<Inertial>,
    /// Gyro noise, rad/s/sqrt(Hz), one an axis.
    pub gyro_noise: Vector3<f64>,
    /// Accelerometer noise, m/s^2/sqrt(Hz), one an axis.
    pub accel_noise: Vector3<f64>,
    /// Prior 1-sigma of the gyro bias, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Prior 1-sigma of the accelerometer bias, m/s^2.
    pub accel_bias: Vector3<f64>,
}

/// Scale factor and misalignment of a body velocity: `y = k C_b^d v^b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// Scale factor `k`.
    pub k: f64,
    /// Rotation from body to instrument axes.
    pub c_b_d: Rotation3<f64>,
}

impl Mounting {
    /// The velocity in body axes of what the instrument reads.
    pub fn body(&self, y: &Vector3<f64>) -> Vector3<f64> {
        self.c_b_d.inverse() * y / self.k
    }

    /// Roll, pitch and yaw of the instrument, rad: `C_d^b = R_x(roll) R_y(pitch) R_z(yaw)`.
    pub fn angles(&self) -> Vector3<f64> {
        let (roll, pitch, yaw) = self.c_b_d.euler_angles();
        Vector3::new(roll, pitch, yaw)
    }
}

/// A sensor of the velocity in its own axes, such as a DVL.
#[derive(Clone, Debug)]
pub struct BodyVelocity {
    /// Velocity of the IMU's point in the instrument's axes, m/s, as the instrument reads it: with its scale factor and
    /// misalignment, but what its lever arm adds in a turn is taken off, at the initial mounting.
    pub samples: Series<Vector3<f64>>,
    /// Covariance of the noise of one sample, (m/s)^2.
    pub covariance: Matrix3<f64>,
    /// The mounting that the filter starts from.
    pub initial: Mounting,
    /// Prior 1-sigma of the scale factor; zero where it is fixed.
    pub scale_sigma: f64,
    /// Prior 1-sigma of roll, pitch and yaw, rad; zero where they are fixed.
    pub angle_sigma: Vector3<f64>,
    /// The true mounting of a simulation.
    pub truth: Option<Mounting>,
    /// Whether it is relative to the water.
    pub water: bool,
}

/// A sensor of the position.
#[derive(Clone, Debug)]
pub struct Positions {
    /// Its samples.
    pub fixes: Series<PositionFix>,
    /// Its point from the IMU, body axes, m.
    pub lever_arm: Vector3<f64>,
    /// How fast its bias wanders at first, north, east, down, m^2/s: the variance of its change over a second.
    pub bias_walk: Vector3<f64>,
}

/// One fix of the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionFix {
    /// The position of the sensor's point; the height is NaN where the fix has none.
    pub position: Geodetic,
    /// Velocity north, east, down, m/s, where the sensor gives it.
    pub velocity: Option<Vector3<f64>>,
    /// 1-sigma north and east, m: of the noise, and of a bias that wanders.
    pub sigma: f64,
    /// 1-sigma of the height, m, likewise.
    pub sigma_height: f64,
}

/// All samples of a run by what they are.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The scenario's name.
    pub name: String,
    /// The zero of the recording's clock on the run's clock.
    pub zero: Time,
    /// The IMU.
    pub imu: Imu,
    /// Sensors of the velocity in body axes, in the order of the scenario.
    pub velocities: Vec<BodyVelocity>,
    /// Depths, m, positive down, with their 1-sigma.
    pub depths: Vec<(Series<f64>, f64)>,
    /// Sensors of the position.
    pub positions: Vec<Positions>,
    /// The reference, at the IMU's point: the truth, or the best that there is. Its rates and forces are not set.
    pub reference: Option<Series<Motion>>,
    /// When the filter starts, s.
    pub start: f64,
    /// The attitude that the filter starts from where no reference tells it: the scenario's initial value.
    pub initial_attitude: Option<UnitQuaternion<f64>>,
    /// The position that the filter starts from where no reference tells it.
    pub initial_position: Geodetic,
    /// 1-sigma of roll, pitch and yaw that the filter starts with, rad; zero where they are not states.
    pub attitude_sigma: Vector3<f64>,
    /// What the sources warned of, and how many samples of each sensor were left out as not finite.
    pub warnings: Vec<String>,
}

impl Recording {
    /// Gathers the samples of a scenario up to its `estimator.stop`, also those from before the filter's start.
    ///
    /// # Errors
    /// When the scenario does not compose, a source fails, or there is no IMU among the samples.
    pub fn read(scenario: &Scenario<'_>) -> Result<Self, SegmentError> {
        Self::gather(scenario.assemble(None)?, |_, _| {})
    }

    /// As [`Self::read`], of an assembly; `progress` is told the time reached and the end, where it is known.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn gather(
        assembly: Assembly,
        mut progress: impl FnMut(Time, Option<Time>),
    ) -> Result<Self, SegmentError> {
        let Assembly { composition, sources, .. } = assembly;
        let stop = composition.estimator.stop();
        let end = sources.iter().filter_map(|(_, s)| s.end()).max();
        let end = stop.map_or(end, |stop| Some(end.map_or(stop, |end| end.min(stop))));
        let mut samples: Vec<Vec<Sample>> =
            composition.sensors.iter().map(|_| Vec::new()).collect();
        let mut dropped = vec![0_usize; samples.len()];
        let mut warnings = Vec::new();
        let mut count = 0_u64;
        for (name, mut source) in sources {
            let mut sample = Sample::empty(Time::MIN, SensorId(0));
            while source.next(&mut sample).map_err(|e| SegmentError::Source(name.clone(), e))? {
                if stop.is_some_and(|stop| sample.time > stop) {
                    break;
                }
                if let Some((list, dropped)) =
                    samples.get_mut(sample.sensor.0).zip(dropped.get_mut(sample.sensor.0))
                {
                    if sample.not_finite().is_none() {
                        list.push(sample);
                    } else {
                        *dropped += 1;
                    }
                }
                count += 1;
                if count.is_multiple_of(16384) {
                    progress(sample.time, end);
                }
            }
            warnings.extend(source.warning().map(|text| format!("{name}: {text}")));
        }
        samples.iter_mut().for_each(|list| list.sort_by_key(|s| s.time));
        for (sensor, count) in
            composition.sensors.iter().zip(dropped).filter(|(_, count)| *count > 0)
        {
            let name = &sensor.info.name;
            warnings
                .push(format!("[sensor.{name}]: {count} samples are not finite and were left out: check its source"));
        }
        Ok(Self { warnings, ..Builder::new(&composition, samples)?.build()? })
    }

    /// The time on the run's clock, s, of a time on the recording's.
    pub fn clock(&self, time: f64) -> f64 {
        self.zero.seconds() + time
    }

    /// The end of the last IMU interval, s.
    pub fn end(&self) -> f64 {
        self.imu.samples.time.last().copied().unwrap_or(0.0)
    }

    /// The reference's attitude at a time, between its samples along the shortest way; `None` beyond them.
    pub fn reference_attitude(&self, time: f64) -> Option<UnitQuaternion<f64>> {
        let series = self.reference.as_ref()?;
        let within = series.time.first().is_some_and(|t| *t <= time)
            && series.time.last().is_some_and(|t| *t >= time);
        let (k, share) = series.place(time).filter(|_| within)?;
        let here = series.value[k].c_b_n;
        Some(match series.value.get(k + 1) {
            Some(next) if share > 0.0 => here.try_slerp(&next.c_b_n, share, 1e-9).unwrap_or(here),
            _ => here,
        })
    }
}
