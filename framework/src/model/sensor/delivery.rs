//! Delay of delivery: the time from the instant at which a sample is valid to its arrival.

use crate::model::simulate::Random;
use crate::units::time::{Span, Time};
use crate::units::{Duration, Sigma};
use schemars::JsonSchema;
use serde::Deserialize;

/// Delay of delivery of each sample, drawn from a normal distribution and never below zero.
///
/// The draw depends on the seed, the sensor and the time of the sample alone. A log that is
/// replayed therefore has the delays of the run that recorded it.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Delay {
    /// Mean delay.
    pub mean: Sigma<Duration>,
    /// Standard deviation of the delay; samples overtake each other where it is larger than their
    /// interval. Default: zero.
    #[serde(default = "none")]
    pub sigma: Sigma<Duration>,
}

fn none() -> Sigma<Duration> {
    Sigma::from_si(0.0)
}

impl Delay {
    /// Time at which the sample of that time arrives; `purpose` names the sensor.
    pub(crate) fn arrival(&self, seed: u64, purpose: &str, time: Time) -> Time {
        // the factor, 2^64 divided by the golden ratio, spreads neighbouring times over all seeds
        let seed = seed ^ time.nanos().cast_unsigned().wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let (mean, sigma) = (self.mean.value().si(), self.sigma.value().si());
        let delay = mean + sigma * Random::new(seed, purpose).normal();
        time + Span::from_seconds(delay.max(0.0)).unwrap_or(Span::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_delays_of_a_seed_are_repeated_and_differ_from_sample_to_sample() {
        let delay = Delay { mean: Sigma::from_si(1.0), sigma: Sigma::from_si(0.1) };
        for seed in [0, 1, 0x5555_5555_5555_5555, u64::MAX] {
            let late = |k: i64| {
                let time = Time::from_nanos(k * 200_000_000);
                delay.arrival(seed, "delay of gnss", time) - time
            };
            let mut delays: Vec<Span> = (0..100).map(late).collect();
            assert!(delays.iter().enumerate().all(|(k, d)| *d == late(k as i64)), "{seed}");
            delays.sort_unstable();
            delays.dedup();
            assert_eq!(delays.len(), 100, "{seed}");
        }
    }
}
