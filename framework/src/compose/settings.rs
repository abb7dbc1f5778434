//! `[estimator]`: when and from what the filter starts.

use crate::compose::draw::Draw;
use crate::units::time::Time;
use crate::units::{Frequency, Positive, Time as Duration};
use schemars::JsonSchema;
use serde::Deserialize;

/// Where the filter's initial values come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Initial {
    /// The first sample of a reference at or after the start.
    Reference,
    /// The `initial` values of the states.
    Given,
}

/// `[estimator]`: when and from what the filter starts, and how often it is recorded.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EstimatorConfig {
    /// When the filter starts. Default: with the first sample.
    start: Option<Duration>,
    /// When the run ends. Default: with the last sample.
    stop: Option<Duration>,
    /// Where the initial values come from: `reference` (default where there is a reference) or `given`.
    pub(crate) initial: Option<Initial>,
    /// What is drawn at random in a simulation, beside the sensors' noise: `nothing`, `start` (what is taken from a
    /// reference is displaced by a draw from its prior) or `all` (every uncertain state, as in a Monte Carlo campaign).
    #[serde(default)]
    pub draw: Draw,
    /// How often estimates are recorded.
    #[serde(default = "ten_hertz")]
    output_rate: Positive<Frequency>,
}

fn ten_hertz() -> Positive<Frequency> {
    Positive::from_si(10.0)
}

impl Default for EstimatorConfig {
    fn default() -> Self {
        Self {
            start: None,
            stop: None,
            initial: None,
            draw: Draw::Nothing,
            output_rate: ten_hertz(),
        }
    }
}

impl EstimatorConfig {
    /// The key of a time that [`Time`] cannot hold.
    pub(crate) fn beyond_the_clock(&self) -> Option<&'static str> {
        let times = [("start", self.start), ("stop", self.stop)];
        times
            .into_iter()
            .find(|(_, time)| time.is_some_and(|t| Time::from_seconds(t.si()).is_none()))
            .map(|(key, _)| key)
    }

    /// When the filter starts.
    pub fn start(&self) -> Time {
        self.start.and_then(|s| Time::from_seconds(s.si())).unwrap_or(Time::MIN)
    }

    /// When the run ends.
    pub fn stop(&self) -> Option<Time> {
        self.stop.and_then(|s| Time::from_seconds(s.si()))
    }

    /// Nanoseconds between recorded estimates.
    pub fn output_period(&self) -> i64 {
        ((1e9 / self.output_rate.value().si()).round() as i64).max(1)
    }

    /// Whether the filter starts from a reference.
    pub fn from_reference(&self) -> bool {
        self.initial == Some(Initial::Reference)
    }
}
