//! The simulated ship of a USBL.

use navfuse_core::prelude::*;
use std::f64::consts::TAU;

/// Simulated ship: a straight track at sea level, in a swell.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ship {
    /// Latitude at the time zero.
    pub latitude: Angle,
    /// Longitude at the time zero.
    pub longitude: Angle,
    /// Heading, and direction of the track.
    pub heading: Angle,
    /// Speed.
    pub speed: Speed,
    /// Amplitude of the roll in the swell; the pitch has half of it.
    pub swell: Angle,
}

impl Default for Ship {
    fn default() -> Self {
        let zero = Angle::from_si(0.0);
        let speed = Speed::from_si(0.0);
        Self { latitude: zero, longitude: zero, heading: zero, speed, swell: zero }
    }
}

impl Ship {
    /// Latitude, longitude (rad), height (m), roll, pitch and heading (rad) at a time, s. It rolls
    /// within 9 s and pitches within 7 s.
    pub(crate) fn pose(&self, time: f64) -> [f64; 6] {
        let (sin, cos) = self.heading.si().sin_cos();
        let start =
            Geodetic { latitude: self.latitude.si(), longitude: self.longitude.si(), height: 0.0 };
        let here = start.displaced(&(Vector3::new(cos, sin, 0.0) * (self.speed.si() * time)));
        let wave = |period: f64| self.swell.si() * (TAU * time / period).sin();
        [here.latitude, here.longitude, 0.0, wave(9.0), wave(7.0) / 2.0, self.heading.si()]
    }
}
