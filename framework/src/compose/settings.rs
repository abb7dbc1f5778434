//! The table `[estimator]`: start, end and initial values of the filter.

use super::covariance_rate::CovarianceRate;
use crate::compose::draw::Draw;
use crate::units::time::{Span, Time};
use crate::units::{Duration, Frequency, NonNegative, Positive};
use schemars::JsonSchema;
use serde::Deserialize;
use std::num::NonZeroU32;

/// Origin of the initial values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Initial {
    /// First sample of a reference at or after the start.
    Reference,
    /// `initial` values of the states.
    Given,
}

/// `[estimator]`: start, end and initial values of the filter, and the rate of recording.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EstimatorConfig {
    /// Type of the estimator: `ekf` (error-state extended Kalman filter), `ukf` (unscented Kalman
    /// filter: sigma points pass through processes and sensors), or one that a plugin registers.
    #[serde(rename = "type", default = "ekf")]
    pub(crate) kind: String,
    /// Start of the filter. Default: the first sample.
    start: Option<Duration>,
    /// End of the run. Default: the last sample.
    stop: Option<Duration>,
    /// Origin of the initial values: `reference` (default where there is a reference) or `given`.
    pub(crate) initial: Option<Initial>,
    /// Random quantities of a simulation beside the sensors' noise: `nothing`, `start` (initial
    /// values from a reference are displaced by a draw from their prior) or `all` (every uncertain
    /// state, as in a Monte Carlo campaign).
    #[serde(default)]
    pub draw: Draw,
    /// Smooths the run: the estimate of every time is recorded as all samples determine it, also the
    /// later ones.
    #[serde(default)]
    pub smooth: bool,
    /// Smooths the run with a fixed lag while it goes on: an estimate is recorded once the filter is
    /// this time ahead of it, as the samples until then determine it.
    pub(crate) lag: Option<Positive<Duration>>,
    /// Smooths the run in up to this many passes. Each pass after the first linearises all models at
    /// the smoothed trajectory of the one before (Gauss-Newton on the whole run), until no component
    /// changes by more than 0.001 sigma.
    pub(crate) passes: Option<NonZeroU32>,
    /// Linearises the samples of this time after the start again, at their smoothed trajectory,
    /// while the filter runs: after a 64th of this time, whenever the time since the start has grown by
    /// a quarter, and after the whole of it. For a wide prior, such as a heading known to 30 deg; see
    /// the explanation of update rules. `0 s` does not. A smoothed run, an estimator other than `ekf`,
    /// and blocks that come and go leave the key without effect; an event reports it. Default: only
    /// while the product of tilt and gyro bias matters, as at rest with a wide prior, and for 30 min at
    /// most.
    relinearise: Option<NonNegative<Duration>>,
    /// Rule by which samples correct the estimate: `ekf` (one linearisation), `iekf` (iterated),
    /// `ukf` (unscented), or one that a plugin registers. A sensor's own `update` has precedence.
    #[serde(default = "ekf")]
    pub(crate) update: String,
    /// How often the covariance is propagated. The estimate takes every sample. The covariance takes the
    /// steps of several samples as one, `"bounded"`: as many as change no sigma by more than a millionth,
    /// ended by each measurement and each recorded estimate. A rate such as "5 Hz" is the least one
    /// beside this bound, and `"every sample"` takes each step by itself. Default: `"bounded"`.
    #[serde(default)]
    covariance_rate: CovarianceRate,
    /// Looks for errors that no single innovation shows: clocks, steps, lever arms, scales. `false`
    /// saves their share of a run, for a campaign whose simulation has no such error.
    #[serde(default = "yes")]
    pub(crate) hidden_errors: bool,
    /// Rate at which estimates are recorded.
    #[serde(default = "ten_hertz")]
    output_rate: Positive<Frequency>,
    /// Rate at which the newest estimate leaves over sinks such as `udp`, as it is before late samples
    /// arrive. Default: `output_rate`.
    newest_rate: Option<Positive<Frequency>>,
}

fn period(rate: Positive<Frequency>) -> Span {
    Span::from_nanos(((1e9 / rate.value().si()).round() as i64).max(1))
}

fn ekf() -> String {
    "ekf".to_owned()
}

fn yes() -> bool {
    true
}

fn ten_hertz() -> Positive<Frequency> {
    Positive::from_si(10.0)
}

impl Default for EstimatorConfig {
    fn default() -> Self {
        Self {
            kind: ekf(),
            start: None,
            stop: None,
            initial: None,
            draw: Draw::Nothing,
            smooth: false,
            lag: None,
            passes: None,
            relinearise: None,
            update: ekf(),
            covariance_rate: CovarianceRate::default(),
            hidden_errors: true,
            output_rate: ten_hertz(),
            newest_rate: None,
        }
    }
}

impl EstimatorConfig {
    /// Key of a time beyond the range of [`Time`].
    pub(crate) fn beyond_the_clock(&self) -> Option<&'static str> {
        let lag = self.lag.map(|lag| lag.value());
        let span = self.relinearise.map(|span| span.value());
        let times =
            [("start", self.start), ("stop", self.stop), ("lag", lag), ("relinearise", span)];
        times
            .into_iter()
            .find(|(_, time)| time.is_some_and(|t| Time::from_seconds(t.si()).is_none()))
            .map(|(key, _)| key)
    }

    /// Start of the filter.
    pub fn start(&self) -> Time {
        self.start.and_then(|s| Time::from_seconds(s.si())).unwrap_or(Time::MIN)
    }

    /// End of the run.
    pub fn stop(&self) -> Option<Time> {
        self.stop.and_then(|s| Time::from_seconds(s.si()))
    }

    /// Fixed lag of the smoother, if there is one.
    pub fn lag(&self) -> Option<Span> {
        self.lag.and_then(|lag| Span::from_seconds(lag.value().si()))
    }

    /// Returns `true` if the run is smoothed, with or without a fixed lag.
    pub fn smooths(&self) -> bool {
        self.smooth || self.lag.is_some() || self.passes.is_some()
    }

    /// Largest number of passes of the smoother.
    pub fn passes(&self) -> u32 {
        self.passes.map_or(1, NonZeroU32::get)
    }

    /// Time after the start whose samples are linearised again.
    pub(crate) fn relinearise(&self) -> Option<Span> {
        let span = self.relinearise.and_then(|span| Span::from_seconds(span.value().si()));
        span.filter(|span| *span > Span::ZERO)
    }

    /// Returns `true` if the filter decides whether it linearises samples again.
    pub(crate) fn decides_to_relinearise(&self) -> bool {
        self.relinearise.is_none()
    }

    /// Lets every sample be linearised once.
    pub(crate) fn linearise_once(&mut self) {
        self.relinearise = Some(NonNegative::from_si(0.0));
    }

    /// Returns `true` if samples are linearised at their smoothed trajectory.
    pub(crate) fn linearises_again(&self) -> bool {
        self.relinearise().is_some() || self.passes() > 1
    }

    /// Time between recorded estimates.
    pub fn output_period(&self) -> Span {
        period(self.output_rate)
    }

    /// Time between newest estimates.
    pub fn newest_period(&self) -> Span {
        period(self.newest_rate.unwrap_or(self.output_rate))
    }

    /// How often the covariance is propagated.
    pub(crate) fn covariance_rate(&self) -> CovarianceRate {
        self.covariance_rate
    }

    /// Returns `true` if the filter starts from a reference.
    pub fn from_reference(&self) -> bool {
        self.initial == Some(Initial::Reference)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_linearised_again_from_a_second_pass_on_or_for_a_time() {
        let again = |passes: Option<u32>, relinearise: Option<f64>| {
            let passes = passes.and_then(NonZeroU32::new);
            let relinearise = relinearise.map(NonNegative::from_si);
            EstimatorConfig { passes, relinearise, ..Default::default() }.linearises_again()
        };
        assert_eq!([None, Some(1), Some(2)].map(|p| again(p, None)), [false, false, true]);
        assert_eq!([0.0, 60.0].map(|span| again(None, Some(span))), [false, true]);
        assert!(again(Some(2), Some(60.0)));
    }
}
