//! All samples of a run, grouped by what they measure.

use crate::Series;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::time::Time;

/// Mean of an IMU's measurements over one interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Length of the interval that ends at the sample's time, s.
    pub dt: f64,
    /// Mean angular rate `w_ib^b` of the gyros, rad/s.
    pub rate: Vector3<f64>,
    /// Mean specific force `f^b` of the accelerometers, m/s^2.
    pub force: Vector3<f64>,
}

/// IMU: its samples and its noise.
#[derive(Clone, Debug)]
pub struct Imu {
    /// Samples.
    pub samples: Series<Inertial>,
    /// Gyro noise per axis, rad/s/sqrt(Hz).
    pub gyro_noise: Vector3<f64>,
    /// Accelerometer noise per axis, m/s^2/sqrt(Hz).
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
    /// Returns the velocity in body axes for a velocity `y` of the instrument.
    pub fn body(&self, y: &Vector3<f64>) -> Vector3<f64> {
        self.c_b_d.inverse() * y / self.k
    }

    /// Returns roll, pitch and yaw of the instrument, rad: `C_d^b = R_x(roll) R_y(pitch) R_z(yaw)`.
    pub fn angles(&self) -> Vector3<f64> {
        let (roll, pitch, yaw) = self.c_b_d.euler_angles();
        Vector3::new(roll, pitch, yaw)
    }
}

/// Sensor of the velocity in its own axes, such as a DVL.
#[derive(Clone, Debug)]
pub struct BodyVelocity {
    /// Velocity of the IMU's point in the instrument's axes, m/s. It contains scale factor and
    /// misalignment; the contribution of the lever arm in turns is subtracted, at the initial
    /// mounting.
    pub samples: Series<Vector3<f64>>,
    /// Covariance of the noise of one sample, (m/s)^2.
    pub covariance: Matrix3<f64>,
    /// Initial mounting of the filter.
    pub initial: Mounting,
    /// Prior 1-sigma of the scale factor; zero if it is fixed.
    pub scale_sigma: f64,
    /// Prior 1-sigma of roll, pitch and yaw, rad; zero if they are fixed.
    pub angle_sigma: Vector3<f64>,
    /// True mounting of a simulation.
    pub truth: Option<Mounting>,
    /// Set if the velocity is relative to the water.
    pub water: bool,
}

/// Position sensor.
#[derive(Clone, Debug)]
pub struct Positions {
    /// Position fixes.
    pub fixes: Series<PositionFix>,
    /// Lever arm from the IMU, body axes, m.
    pub lever_arm: Vector3<f64>,
    /// Initial growth of the variance of its bias, north, east, down, m^2/s.
    pub bias_walk: Vector3<f64>,
}

/// Position fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionFix {
    /// Position of the sensor; the height is NaN if the fix has none.
    pub position: Geodetic,
    /// Velocity north, east, down, m/s, if the sensor measures it.
    pub velocity: Option<Vector3<f64>>,
    /// 1-sigma north and east, m, from the noise and the varying bias.
    pub sigma: f64,
    /// 1-sigma of the height, m, from both.
    pub sigma_height: f64,
}

/// All samples of a run, grouped by what they measure.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of the scenario.
    pub name: String,
    /// Zero of the recording's clock on the run's clock.
    pub zero: Time,
    /// IMU.
    pub imu: Imu,
    /// Sensors of the velocity in body axes, in the order of the scenario.
    pub velocities: Vec<BodyVelocity>,
    /// Depths, m, positive down, with their 1-sigma.
    pub depths: Vec<(Series<f64>, f64)>,
    /// Position sensors.
    pub positions: Vec<Positions>,
    /// Reference at the IMU's point: the truth, or the best available estimate. Its rates and
    /// forces are not set.
    pub reference: Option<Series<Motion>>,
    /// Start of the filter, s.
    pub start: f64,
    /// Initial attitude in the scenario, used if no reference provides one.
    pub initial_attitude: Option<UnitQuaternion<f64>>,
    /// Initial position, used if no reference provides one.
    pub initial_position: Geodetic,
    /// Initial 1-sigma of roll, pitch and yaw, rad; zero if they are not states.
    pub attitude_sigma: Vector3<f64>,
    /// Warnings of the sources, and the number of samples of each sensor that were dropped because
    /// they were not finite.
    pub warnings: Vec<String>,
}

impl Recording {
    /// Converts a time on the recording's clock to the run's clock, s.
    pub fn clock(&self, time: f64) -> f64 {
        self.zero.seconds() + time
    }

    /// Returns the end of the last IMU interval, s.
    pub fn end(&self) -> f64 {
        self.imu.samples.time.last().copied().unwrap_or(0.0)
    }

    /// Returns the reference's attitude at a time, interpolated along the shortest rotation; `None`
    /// outside its samples.
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
