//! A trajectory: a horizontal figure of eight with a dive.

use navfuse_core::prelude::*;
use navfuse_core::units::Duration;
use navfuse_simulation::TrajectoryType;
use std::f64::consts::TAU;

/// A figure of eight at constant horizontal speed, with one dive to twice the amplitude per round.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Eight {
    /// Latitude of the start.
    pub latitude: Angle,
    /// Longitude of the start.
    pub longitude: Angle,
    /// Horizontal speed.
    pub speed: Speed,
    /// Time of one round.
    pub round: Positive<Duration>,
    /// Number of rounds.
    pub rounds: u32,
    /// Amplitude of the depth's oscillation.
    pub amplitude: Length,
}

// ANCHOR: eight
/// Amplitude of the heading, rad: at the first zero of the Bessel function J_0 the eight closes.
const SWING: f64 = 2.404_825_557_695_773;

impl TrajectoryType for Eight {
    const TYPE: &'static str = "eight";

    fn start(&self) -> Geodetic<f64> {
        Geodetic { latitude: self.latitude.si(), longitude: self.longitude.si(), height: 0.0 }
    }

    fn duration(&self) -> f64 {
        self.round.value().si() * f64::from(self.rounds)
    }

    fn motion<T: Real>(&self, time: T) -> (Vector3<T>, Vector3<T>) {
        let rate = TAU / self.round.value().si();
        let (sin, _) = (time * convert(rate)).sin_cos();
        let (heading, speed) = (sin * convert(SWING), convert::<f64, T>(self.speed.si()));
        let down = sin * convert(self.amplitude.si() * rate);
        (
            Vector3::new(heading.cos() * speed, heading.sin() * speed, down),
            Vector3::new(T::zero(), T::zero(), heading),
        )
    }
}
// ANCHOR_END: eight
