//! Test for a time offset that is not modelled.
//!
//! A sensor that lags by `tau` measures the state of another time: `d = -dh/dt`, the slope of the
//! prediction, is in the innovations of its own samples. The slope is that between the two samples
//! before, so that the noise of the driving sensor in the innovation is not in it: `b` is then a
//! martingale for a consistent filter.
//!
//! An offset may begin at any time: one sum runs from the start, and three begin again in turn.
//! From a finding on, the covariance contains the effect of each sum that is significant.

use super::contain::Containment;
use super::effect::{Effect, Found, SUMS, Whitened};
use super::score::{SPAN, Score};
use crate::checkpoint::saved;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::covariance::Covariance;
use crate::state::{Layout, State};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// Time from the begin of one sum to that of the next, s.
const TURN: f64 = 120.0;
/// Least time over which the slope is taken, and the longest, s.
const SLOPE: (f64, f64) = (0.1, 1.5);
/// Largest offset to which the test is linear, s: `d = -dh/dt` is known as a mean over a slope.
const LINEAR: f64 = SLOPE.1;
/// Score in sigma at which an offset is significant: while a car with an IMU of MEMS finds its heading,
/// the curvature of its track gives one of 5.2 in 3 of 200 runs.
const SIGNIFICANT: f64 = 6.0;

/// Test of one sensor.
#[derive(Clone, Default)]
pub(super) struct Offset {
    effect: Effect,
    /// The next sum to begin again.
    next: usize,
    /// State after the sample at which the slope begins, and the slope.
    base: Option<State>,
    slope: [f64; MAX_CHANNELS],
    /// Set if the next slope begins at the present sample.
    due: bool,
    span: Time,
    severity: Option<Severity>,
}

saved!(Offset { effect, next, base, slope, due, span, severity });

/// Finding about the sensor.
pub(super) fn finding(found: &Found, time: Time, sensor: &str, layout: &Layout) -> Finding {
    let (score, tau) = (&found.score, found.score.size());
    Finding {
        time,
        about: sensor.to_owned(),
        severity: found.severity,
        basis: Basis::Explanation,
        text: format!(
            "since {} its samples fit a time offset of {tau:+.3} s ({:.1} sigma), which is not \
             modelled: it has moved {}",
            score.since,
            score.sigmas().abs(),
            found.moved(layout),
        ),
        remedy: format!(
            "check the clock of {sensor} and the time stamps; if the offset is constant, \
             estimate it: time_offset = {{ sigma = \"{:.1} s\" }}",
            (2.0 * tau.abs()).max(0.1)
        ),
    }
}

/// Returns `true` if the size of an offset is within the range of the test.
fn linear(score: &Score) -> bool {
    score.size().abs() < LINEAR
}

impl Offset {
    pub(super) fn new(n: usize) -> Self {
        Self {
            effect: Effect::new(n),
            next: 1,
            base: None,
            slope: [0.0; MAX_CHANNELS],
            due: false,
            span: Time::MIN,
            severity: None,
        }
    }

    pub(super) fn effect(&mut self) -> &mut Effect {
        &mut self.effect
    }

    /// Score in sigma of the most significant offset within the range of the test.
    pub(super) fn score(&self) -> f64 {
        let scores = self.effect.scores.iter().filter(|score| linear(score));
        scores.fold(0.0, |most, score| most.max(score.sigmas().abs()))
    }

    /// Takes a sample; `present` has the channels of one of the sensor itself.
    pub(super) fn take(&mut self, sample: &Whitened<'_>, time: Time, present: Option<u16>) {
        if self.span == Time::MIN {
            self.span = time;
            self.effect.begin(time);
        }
        let mut g = self.effect.seen(sample.update);
        if let Some(present) = present {
            let channels = (0..MAX_CHANNELS).filter(|channel| present >> channel & 1 == 1);
            for (g, channel) in g.iter_mut().zip(channels).take(sample.update.m) {
                g.iter_mut().for_each(|g| *g -= self.slope[channel]);
            }
        }
        self.effect.take(sample, &g);
    }

    /// Takes the slope of the prediction up to the state, for the next sample.
    pub(super) fn follow(&mut self, model: &dyn AnyMeasurement, at: &At<'_>) {
        let Some(base) = &self.base else {
            self.due = true;
            return;
        };
        let dt = at.state.time.since(base.time);
        if dt < SLOPE.0 {
            return;
        }
        self.slope.fill(0.0);
        if dt <= SLOPE.1 {
            let (from, n) = (At { state: base, ..*at }, model.channels());
            model.change(&from, at, &mut self.slope[..n]);
            self.slope.iter_mut().for_each(|s| *s = if s.is_finite() { *s / dt } else { 0.0 });
        }
        self.due = true;
    }

    /// Keeps the corrected state where the next slope begins there, and widens the covariance where
    /// it does not contain an offset that was found. Ends a span where one is due, and returns a
    /// significant offset that is more severe than those before. `rival` is the score that it has to
    /// exceed.
    pub(super) fn corrected(
        &mut self,
        state: &State,
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
        rival: impl Fn() -> f64,
    ) -> Option<Found> {
        if std::mem::take(&mut self.due) {
            match &mut self.base {
                Some(base) => {
                    base.time = state.time;
                    base.values.copy_from_slice(&state.values);
                    base.signals.clone_from(&state.signals);
                }
                base => *base = Some(state.clone()),
            }
        }
        let due = state.time.since(self.span) >= SPAN;
        let worst = due.then(|| self.worst(state.time, covariance, considered)).flatten();
        let worst = worst.filter(|worst| worst.score.sigmas().abs() > rival());
        let before = self.severity;
        self.severity = before.max(worst.map(|worst| worst.severity));
        if self.severity.is_some() {
            let significant = |sum: &usize| {
                let score = &self.effect.scores[*sum];
                linear(score) && score.sigmas().abs() >= SIGNIFICANT
            };
            for sum in (0..SUMS).filter(significant) {
                containment.contain((&self.effect, sum), covariance);
            }
        }
        worst.filter(|worst| before < Some(worst.severity))
    }

    /// Ends a span, and returns the most severe offset.
    fn worst(&mut self, time: Time, covariance: &Covariance, considered: &[bool]) -> Option<Found> {
        self.span = time;
        self.effect.end_span();
        let worst = {
            let counts = |sum: usize| linear(&self.effect.scores[sum]);
            self.effect.worst((SIGNIFICANT, counts), covariance, considered)
        };
        if time.since(self.effect.newest()) >= TURN {
            self.effect.renew(self.next, time);
            self.next = 1 + self.next % (SUMS - 1);
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    /// The first sum runs from the start.
    #[test]
    fn three_sums_begin_again_in_turn_every_two_minutes() {
        let mut offset = Offset::new(0);
        offset.effect.begin(Time::default());
        let begun = [120.0, 240.0, 360.0, 480.0, 600.0].map(|at| {
            let time = Time::from_seconds(at).unwrap();
            offset.worst(time, &Covariance::zero(0), &[]);
            offset.effect.scores.iter().position(|score| score.since == time)
        });
        assert_eq!(begun, [1, 2, 3, 1, 2].map(Some));
        assert_eq!(offset.effect.scores[0].since, Time::default());
    }
}
