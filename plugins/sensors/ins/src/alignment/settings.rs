//! Settings of an alignment in SI, with their defaults and the priors that follow from them.

use super::config::{Alignment, AlignmentMethod, CoarseMethod, Formula};
use super::zero_velocity::ZeroVelocity;
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
    /// Formula that the scenario states.
    pub formula: Option<Formula>,
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
        let found = [("coarse", c.coarse.is_some())];
        let at_rest = [
            ("coarse_duration", c.coarse_duration.is_some()),
            ("rest_velocity", c.rest_velocity.is_some()),
        ];
        let moving = [("velocity", c.velocity.is_some()), ("max_gap", c.max_gap.is_some())];
        let flight = [("formula", c.formula.is_some())];
        let course = [("min_speed", c.min_speed.is_some())];
        let any = [("duration", c.duration.is_some()), ("heading_gate", c.heading_gate.is_some())];
        let (unused, why): (Vec<_>, _) = match c.method {
            AlignmentMethod::Given => (
                [&found[..], &at_rest, &moving, &flight, &course, &any].concat(),
                "of no use where attitude and velocity are given",
            ),
            AlignmentMethod::Static => {
                ([&moving[..], &flight, &course].concat(), "of no use at rest")
            }
            AlignmentMethod::InMotion => {
                ([&at_rest[..], &flight, &course].concat(), "of no use in motion")
            }
            AlignmentMethod::InFlight => ([&at_rest[..], &course].concat(), "of no use in flight"),
            AlignmentMethod::Course => (
                [&found[..], &at_rest, &moving[1..], &flight, &any[1..]].concat(),
                "of no use by the course",
            ),
        };
        if let Some((key, _)) = unused.iter().find(|k| k.1) {
            return error(key, format!("{why}: remove it, or set another alignment.method"));
        }
        if matches!(c.method, AlignmentMethod::Given | AlignmentMethod::Course) {
            return Ok(None);
        }
        let moving = c.method.moving();
        if moving && c.coarse == Some(CoarseMethod::Analytic) {
            let text = "analytic needs a vehicle at rest: give optimisation, or velocity-loci";
            return error("coarse", text.into());
        }
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
            formula: c.formula,
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
        let rate = self.bias.0.hypot(1.2 * imu.gyro_noise().amax() / t.sqrt());
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
            AlignmentMethod::InMotion | AlignmentMethod::InFlight => {
                (1_f64.to_radians(), 10_f64.to_radians())
            }
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;
    use serde_json::json;

    /// An IMU with a white noise of the gyros, in deg/h/sqrt(Hz).
    fn imu(noise: f64) -> Imu {
        let gyro = format!("{noise} deg/h/sqrt(Hz)");
        crate::testing::imu(&json!({ "gyro_noise": gyro, "accel_noise": "10 ug/sqrt(Hz)" }))
    }

    /// Degrees per hour and standard gravity, in SI.
    const DEG_PER_H: f64 = std::f64::consts::PI / 180.0 / 3600.0;
    const G: f64 = 9.8;

    fn settings(
        method: AlignmentMethod,
        time: f64,
        sway: f64,
        bias: (f64, f64),
    ) -> AlignmentSettings {
        AlignmentSettings {
            method,
            duration: 2.0 * time,
            coarse_duration: time,
            coarse: CoarseMethod::default(),
            formula: None,
            gate: 0.01,
            rest_velocity: sway,
            max_gap: 5.0,
            bias,
        }
    }

    /// Each of the three errors alone, by the equation of Groves section 5.6.3 in round numbers: an
    /// east rate of 0.01 deg/h against 10 deg/h is 1 mrad.
    #[test]
    fn the_error_of_the_coarse_heading_is_the_east_rate_over_that_of_the_earth() {
        let north = 10.0 * DEG_PER_H;
        let heading = |sway: f64, bias: f64, noise: f64| {
            settings(AlignmentMethod::Static, 100.0, sway, (bias, 0.0))
                .heading_error(&imu(noise), north)
        };
        assert!((heading(0.0, 0.01 * DEG_PER_H, 0.0) / 1e-3 - 1.0).abs() < 1e-9);
        // 1.2 times 0.1 deg/h/sqrt(Hz) over 100 s is 0.012 deg/h
        assert!((heading(0.0, 0.0, 0.1) / 1.2e-3 - 1.0).abs() < 1e-9);
        // sqrt(2) times 5 mm/s over g t^2 / 2 of 49 km s is 1.4e-7 rad/s, 0.0298 deg/h
        let rate = SQRT_2 * 5e-3 / (G * 0.5 * 1e4) / north;
        assert!((heading(5e-3, 0.0, 0.0) / rate - 1.0).abs() < 2e-3);
        // independent errors add as squares
        let all = heading(5e-3, 0.01 * DEG_PER_H, 0.1);
        assert!((all / rate.hypot(1e-3).hypot(1.2e-3) - 1.0).abs() < 2e-3);
    }

    #[test]
    fn the_prior_is_ten_times_the_error_of_the_coarse_attitude_within_limits() {
        // 1 mg is 1e-3 rad of tilt; 0.1 deg/h is 0.1 / (15.04 cos 45 deg) rad of heading
        let fine = settings(AlignmentMethod::Static, 100.0, 0.0, (0.1 * DEG_PER_H, 1e-3 * G));
        let prior = fine.attitude_prior(&imu(0.0));
        assert!((prior.x / 1e-2 - 1.0).abs() < 2e-3 && prior.x == prior.y, "{prior}");
        assert!((prior.z / (1.0 / (15.041 * FRAC_1_SQRT_2)) - 1.0).abs() < 1e-3, "{prior}");
        // the velocity at rest of 1 cm/s over 100 s is 1e-5 rad, ten times it below the least prior
        let still = settings(AlignmentMethod::Static, 100.0, 1e-2, (0.0, 0.0));
        assert!((still.tilt_error() / (1e-2 / (G * 100.0)) - 1.0).abs() < 2e-3);
        let narrow = still.attitude_prior(&imu(0.0)).map(f64::to_degrees);
        assert!((narrow.x - 0.05).abs() < 1e-9 && narrow.z >= 1.0, "{narrow}");
        let wide = settings(AlignmentMethod::Static, 100.0, 0.0, (100.0 * DEG_PER_H, G));
        let wide = wide.attitude_prior(&imu(0.0)).map(f64::to_degrees);
        assert!((wide.x - 5.0).abs() < 1e-9 && (wide.z - 30.0).abs() < 1e-9, "{wide}");
        let moving = settings(AlignmentMethod::InMotion, 100.0, 0.0, (0.0, 0.0));
        let moving = moving.attitude_prior(&imu(0.0)).map(f64::to_degrees);
        assert!((moving.x - 1.0).abs() < 1e-9 && (moving.z - 10.0).abs() < 1e-9, "{moving}");
    }

    #[test]
    fn the_prior_of_the_velocity_is_the_sway_at_rest_and_wide_in_motion() {
        let of = |method| settings(method, 100.0, 5e-3, (0.0, 0.0)).velocity_prior();
        assert_eq!(of(AlignmentMethod::Static), 5e-3);
        assert_eq!(of(AlignmentMethod::InMotion), 10.0);
    }
}
