//! Settings of an alignment in SI, with their defaults and the priors that follow from them.

use super::zero_velocity::ZeroVelocity;
use super::{Alignment, AlignmentMethod, CoarseMethod};
use crate::earth::{EARTH_RATE, normal_gravity};
use crate::imu::Imu;
use nalgebra::Vector3;
use navfuse_core::model::error::ComposeError;
use navfuse_core::state::Handle;
use navfuse_core::state::manifold::Vector;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Shortest alignment, s: in that time gravity turns by at most 0.04 deg in inertial axes.
const SHORTEST: f64 = 10.0;
/// Ratio of the prior sigma of the fine alignment to the expected error of the coarse one. The
/// prior then has a hundredth of the information, so the samples are practically used once.
const PRIOR: f64 = 10.0;

/// Latitude whose gravity the expected errors use, rad: gravity varies by 0.5 % over the Earth.
const MIDDLE_LATITUDE: f64 = 0.8;

/// Settings of an alignment, in SI.
#[derive(Clone, Debug)]
pub(crate) struct AlignmentSettings {
    pub method: AlignmentMethod,
    pub duration: f64,
    /// Time for which the coarse alignment collects samples, s.
    pub coarse_duration: f64,
    pub coarse: CoarseMethod,
    /// 1-sigma of the heading at which the alignment may end, rad.
    pub gate: f64,
    pub rest_velocity: f64,
    pub max_gap: f64,
    /// Largest prior sigma of the gyro biases, rad/s, and of the accelerometer biases, m/s^2.
    pub bias: (f64, f64),
}

impl AlignmentSettings {
    /// The settings of an alignment that finds north by the Earth's rotation; `None` where attitude
    /// and velocity are given, or found by the course.
    ///
    /// # Errors
    /// When keys contradict one another.
    pub fn new(config: &Alignment, bias: (f64, f64)) -> Result<Option<Self>, ComposeError> {
        let c = &config.0;
        let error =
            |key: &str, text: String| Err(ComposeError::new(format!("alignment.{key}"), text));
        let at_rest = [
            ("coarse", c.coarse.is_some()),
            ("coarse_duration", c.coarse_duration.is_some()),
            ("rest_velocity", c.rest_velocity.is_some()),
        ];
        let moving = [("velocity", c.velocity.is_some()), ("max_gap", c.max_gap.is_some())];
        let course = [("min_speed", c.min_speed.is_some())];
        let any = [("duration", c.duration.is_some()), ("heading_gate", c.heading_gate.is_some())];
        let (unused, why): (Vec<_>, _) = match c.method {
            AlignmentMethod::Given => (
                [&at_rest[..], &moving, &course, &any].concat(),
                "of no use where attitude and velocity are given",
            ),
            AlignmentMethod::Static => ([&moving[..], &course].concat(), "of no use at rest"),
            AlignmentMethod::InMotion => ([&at_rest[..], &course].concat(), "of no use in motion"),
            AlignmentMethod::Course => {
                ([&at_rest[..], &moving[1..], &any[1..]].concat(), "of no use by the course")
            }
        };
        if let Some((key, _)) = unused.iter().find(|k| k.1) {
            return error(key, format!("{why}: remove it, or set another alignment.method"));
        }
        if matches!(c.method, AlignmentMethod::Given | AlignmentMethod::Course) {
            return Ok(None);
        }
        let moving = c.method == AlignmentMethod::InMotion;
        let duration = c.duration.map_or(if moving { 240.0 } else { 600.0 }, |d| d.value().si());
        if duration < SHORTEST {
            let text = format!(
                "{duration} s is too short to see the Earth turn: give at least {SHORTEST} s, better \
                 minutes"
            );
            return error("duration", text);
        }
        let default = (0.2 * duration).clamp(20.0, 120.0).min(duration);
        let coarse_duration =
            c.coarse_duration.map_or(if moving { duration } else { default }, |d| d.value().si());
        if !(SHORTEST..=duration).contains(&coarse_duration) {
            let text = format!(
                "{coarse_duration} s is not possible: give {SHORTEST} s to the duration of \
                 {duration} s"
            );
            return error("coarse_duration", text);
        }
        let rest_velocity = c.rest_velocity.map_or(5e-3, |v| v.value().si());
        Ok(Some(Self {
            method: c.method,
            duration,
            coarse_duration,
            coarse: c.coarse.unwrap_or_default(),
            gate: c.heading_gate.map_or_else(|| 1_f64.to_radians(), |g| g.value().si()),
            rest_velocity: if moving { 0.0 } else { rest_velocity },
            max_gap: c.max_gap.map_or(5.0, |g| g.value().si()),
            bias,
        }))
    }

    /// Expected error of the coarse heading, rad, for a horizontal Earth rate `north`, rad/s:
    /// `dpsi = db_E / (W cos L)` (Groves section 5.6.3).
    ///
    /// The east rate error `db_E` is the gyro bias, the mean of the gyro noise, which falls with
    /// the square root of the time, and the rotation of gravity that an unknown velocity imitates.
    pub fn heading_error(&self, imu: &Imu, north: f64) -> f64 {
        let t = self.coarse_duration;
        let rate = self.bias.0.hypot(1.2 * imu.gyro_noise.value().si().amax() / t.sqrt());
        let turned = normal_gravity(MIDDLE_LATITUDE, 0.0) * 0.5 * t * t;
        rate.hypot(self.rest_velocity * SQRT_2 / turned) / north
    }

    /// Expected error of the coarse tilt, rad: `db_a / g` (Groves section 5.6.3), and the velocity
    /// at rest over the time.
    fn tilt_error(&self) -> f64 {
        let gravity = normal_gravity(MIDDLE_LATITUDE, 0.0);
        (self.bias.1 / gravity).hypot(self.rest_velocity / (gravity * self.coarse_duration))
    }

    /// The zero-velocity update of a vehicle at rest.
    pub fn constraint(&self, velocity: Handle<Vector<3>>) -> Option<ZeroVelocity> {
        (self.method == AlignmentMethod::Static)
            .then_some(ZeroVelocity { velocity, sigma: self.rest_velocity })
    }

    /// Prior sigma of the attitude about the coarse solution, rad, so wide that it adds no
    /// information to that of the same samples in the fine alignment.
    pub fn attitude_prior(&self, imu: &Imu) -> Vector3<f64> {
        let heading = PRIOR * self.heading_error(imu, EARTH_RATE * FRAC_1_SQRT_2);
        let (tilt, least) = match self.method {
            // an error of the velocity's scale factor is one of the coarse attitude
            AlignmentMethod::InMotion => (1_f64.to_radians(), 10_f64.to_radians()),
            AlignmentMethod::Given | AlignmentMethod::Static | AlignmentMethod::Course => {
                (0.05_f64.to_radians(), 1_f64.to_radians())
            }
        };
        let tilt = (PRIOR * self.tilt_error()).clamp(tilt, 5_f64.to_radians());
        Vector3::new(tilt, tilt, heading.clamp(least, 30_f64.to_radians()))
    }

    /// Prior sigma of the velocity, m/s: at rest the velocity of sway, in motion so wide that it
    /// adds no information.
    pub fn velocity_prior(&self) -> f64 {
        if self.method == AlignmentMethod::Static { self.rest_velocity } else { 10.0 }
    }
}
