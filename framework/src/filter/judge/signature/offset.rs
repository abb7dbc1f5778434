//! Test for a time offset that is not modelled.
//!
//! A sensor that lags by `tau` measures the state of another time: `d = -dh/dt`, the slope of the
//! prediction, is in the innovations of its own samples. The sums run along the slope between the two
//! samples before, so that the noise of the driving sensor in the innovation is not in it: `b` is then a
//! martingale for a consistent filter. While the vehicle changes its acceleration, that slope is late, and
//! `tau = b / c` with the slope up to the sample in `c` is not (an instrumental variable, Wright 1928).
//!
//! No sensor sends a sample before it has measured it. Where those of one seem to be early from the start, the samples of
//! the driving sensor are late, and it is named.
//!
//! An offset may begin at any time: one sum runs from the start, two begin again in turn, and one begins
//! again while all sensors agree.
//! Samples that the gate refuses count as those that it passes, since they show the offset. Where it is
//! about to refuse one more, an offset that explains those before is named at once: the part of them that
//! `tau g` leaves is below a quarter.
//!
//! From a finding on, the filter goes on as if it had known the offset, as a filter does whose bias is
//! separated from its states (Friedland 1969):
//! ```text
//! x := x + tau s            once
//! y := y - tau d,           R := R + var tau d d' + (tau / 2)^2 e e'      at each further sample
//! ```
//! where `e` is the change of the slope since the sample before. The sums go on with what is left of the
//! innovations, and the covariance contains `s` with the variance of `tau`.

use super::contain::Containment;
use super::effect::{CALM, Effect, Found, OFFSETS, RECENT, SUMS, Whitened};
use super::lag::Lag;
use super::lanes::Seen;
use super::refused::Refused;
use super::score::{SPAN, Score, leading};
use crate::checkpoint::saved;
use crate::model::record::finding::Severity;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::State;
use crate::state::covariance::{Covariance, Update, forward};
use crate::units::sample::{MAX_CHANNELS, channels};
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
/// Largest offset in the time for which a sum has seen the slope: the slope has to be seen for longer than the offset, or
/// each jump of an innovation is one.
const SHARE: f64 = 0.25;
/// Score in sigma of what an offset that was taken off leaves, from which on that is taken off as well.
const LEFT: f64 = 4.0;

/// Test of one sensor.
#[derive(Clone, Default)]
pub(super) struct Offset {
    effect: Effect<OFFSETS>,
    /// The next sum to begin again.
    next: usize,
    /// State after the sample at which the slope begins, and the slopes up to the sample before and up
    /// to the present one.
    base: Option<State>,
    before: [f64; MAX_CHANNELS],
    slope: [f64; MAX_CHANNELS],
    /// Set if the next slope begins at the present sample.
    due: bool,
    span: Time,
    /// Time of the last sample of the sensor.
    time: Time,
    severity: Option<Severity>,
    refused: Refused,
    /// Offset that is taken off the samples, and its variance.
    known: f64,
    variance: f64,
    /// Hypothesis whose offset is to be taken off.
    adopts: Option<usize>,
    /// Set once the samples contradicted the offset that was taken off.
    withdrawn: bool,
}

saved!(Offset {
    effect,
    next,
    base,
    before,
    slope,
    due,
    span,
    time,
    severity,
    refused,
    known,
    variance,
    adopts,
    withdrawn,
});

/// The slopes of the channels that are present, by row of an update.
fn rows(slope: &[f64; MAX_CHANNELS], present: u16) -> impl Iterator<Item = (usize, f64)> {
    channels(present).map(|channel| slope[channel]).enumerate()
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
            before: [0.0; MAX_CHANNELS],
            slope: [0.0; MAX_CHANNELS],
            due: false,
            span: Time::MIN,
            time: Time::MIN,
            severity: None,
            refused: Refused::default(),
            known: 0.0,
            variance: 0.0,
            adopts: None,
            withdrawn: false,
        }
    }

    /// Returns `true` if the offset of a sum is within the range of the test, and explains what the gate
    /// refused.
    fn counts(&self, sum: usize) -> bool {
        if sum >= SUMS {
            return false;
        }
        let score = self.effect.all(sum);
        let seen = score.size().abs() <= SHARE * self.refused.seen(sum);
        seen && !self.withdrawn && linear(&score) && self.refused.explained(sum, score.size())
    }

    pub(super) fn effect(&mut self) -> &mut Effect<OFFSETS> {
        &mut self.effect
    }

    /// Score in sigma of the most significant offset within the range of the test, of samples that are early or of
    /// those that are late.
    pub(super) fn score(&self, early: bool) -> f64 {
        let of = |sum: usize| Some(self.effect.all(sum)).filter(|_| self.counts(sum));
        self.largest(early, (0..SUMS).filter_map(of))
    }

    fn largest(&self, early: bool, scores: impl Iterator<Item = Score>) -> f64 {
        let of_sign = scores.filter(|score| self.is_early(score) == early);
        of_sign.fold(0.0, |most, score| most.max(score.sigmas().abs()))
    }

    /// Score in sigma of the most significant offset, whether it explains what the gate refused or not: no other
    /// error may be named in its place for that.
    pub(super) fn rival(&self, early: bool) -> f64 {
        let all = (0..SUMS).map(|sum| self.effect.all(sum));
        self.largest(early, all.filter(|score| linear(score) && !self.withdrawn))
    }

    /// Begins one sum again.
    fn renew(&mut self, sum: usize, time: Time) {
        self.effect.renew(sum, time);
        self.refused.renew(sum);
    }

    /// Begins the sum again that runs since all sensors agreed last.
    pub(super) fn calm(&mut self, time: Time) {
        if time.since(self.effect.since(RECENT)) >= CALM {
            self.renew(RECENT, time);
        }
    }

    /// Takes a sample; `present` has the channels of one of the sensor itself.
    pub(super) fn take(&mut self, sample: &Whitened<'_>, time: Time, present: Option<u16>) {
        if self.span == Time::MIN {
            self.span = time;
            self.effect.begin(time);
        }
        let mut seen = [[0.0; OFFSETS]; MAX_CHANNELS];
        self.effect.seen(sample, &mut seen);
        let Some(present) = present else { return self.effect.take(sample, &seen) };
        let along = |slope| {
            let mut g: Seen<OFFSETS> = seen;
            for (row, slope) in rows(slope, present).take(sample.update.m) {
                g[row].iter_mut().for_each(|g| *g -= slope as f32);
            }
            g
        };
        let (before, now) = (along(&self.before), along(&self.slope));
        let last = std::mem::replace(&mut self.time, time);
        let duration = if last == Time::MIN { 0.0 } else { time.since(last).min(SLOPE.1) };
        self.refused.take(sample, &now, (self.information(sample, present), duration));
        self.effect.take_along(sample, [&before, &now]);
    }

    /// Information of a sample about an offset, if the state had been known exactly: `d' S^-1 d`.
    fn information(&self, sample: &Whitened<'_>, present: u16) -> f64 {
        let (m, mut d) = (sample.update.m, [0.0; MAX_CHANNELS]);
        rows(&self.slope, present).take(m).for_each(|(row, slope)| d[row] = slope);
        forward(sample.lower, m, &mut d[..m]);
        d[..m].iter().map(|d| d * d).sum()
    }

    /// Takes the slope of the prediction up to the state, before the sample there.
    pub(super) fn follow(&mut self, model: &dyn AnyMeasurement, at: &At<'_>) {
        // groups of channels of one sample
        if self.base.as_ref().is_some_and(|base| base.time == at.state.time) {
            self.due = true;
            return;
        }
        let slope = self.slope_at(model, at);
        self.before = self.slope;
        self.due = self.base.is_none() || slope.is_some();
        self.slope = slope.unwrap_or(self.slope);
    }

    /// The slope of the prediction up to the state; `None` where the last one stays.
    fn slope_at(&self, model: &dyn AnyMeasurement, at: &At<'_>) -> Option<[f64; MAX_CHANNELS]> {
        let base = self.base.as_ref()?;
        let dt = at.state.time.since(base.time);
        if dt < SLOPE.0 {
            return None;
        }
        let mut slope = [0.0; MAX_CHANNELS];
        if dt <= SLOPE.1 {
            let (from, n) = (At { state: base, ..*at }, model.channels());
            model.change(&from, at, &mut slope[..n]);
            slope.iter_mut().for_each(|s| *s = if s.is_finite() { *s / dt } else { 0.0 });
        }
        Some(slope)
    }

    /// Returns `true` if an offset is taken off the samples.
    pub(super) fn compensates(&self) -> bool {
        self.known != 0.0
    }

    /// Takes an offset that was found off a sample.
    pub(super) fn compensate(
        &self,
        model: &dyn AnyMeasurement,
        at: &At<'_>,
        update: &mut Update,
        present: u16,
    ) {
        let (slope, m) = (self.slope_at(model, at).unwrap_or(self.slope), update.m);
        let changed: [f64; MAX_CHANNELS] =
            std::array::from_fn(|k| 0.5 * self.known * (slope[k] - self.slope[k]));
        for (a, from) in rows(&slope, present).take(m) {
            update.innovation[a] += self.known * from;
            for (b, to) in rows(&slope, present).take(m) {
                update.r[a * m + b] += self.variance * from * to;
            }
        }
        for (a, from) in rows(&changed, present).take(m) {
            for (b, to) in rows(&changed, present).take(m) {
                update.r[a * m + b] += from * to;
            }
        }
    }

    /// Returns `true` if an offset is to be taken off.
    pub(super) fn adopts(&self) -> bool {
        self.adopts.is_some()
    }

    /// Takes the offset off that is to be, and returns what it has moved the state by.
    pub(super) fn adopt(&mut self, time: Time) -> Option<Vec<f64>> {
        let sum = self.adopts.take()?;
        if self.withdrawn {
            let size = -std::mem::take(&mut self.known);
            let delta = self.effect.s.iter().map(|s| size * f64::from(s[sum])).collect();
            self.restart(time);
            return Some(delta);
        }
        let score = self.effect.all(sum);
        let (size, variance) = (score.size(), score.variance());
        (self.known, self.variance) = (self.known + size, variance);
        let delta = self.effect.s.iter().map(|s| size * f64::from(s[sum])).collect();
        self.effect.adopt(sum, time);
        self.refused = Refused::default();
        Some(delta)
    }

    /// Withdraws the offset that is taken off, if the gate refuses more than a third of the samples since:
    /// it was another error that it fitted.
    pub(super) fn withdraw(&mut self) -> bool {
        let withdraws = self.compensates() && !self.withdrawn && self.refused.contradicts();
        if withdraws {
            (self.withdrawn, self.adopts) = (true, Some(0));
        }
        withdraws
    }

    /// Begins the test again: what the samples before showed is of another error.
    pub(super) fn restart(&mut self, time: Time) {
        self.effect.restart(time);
        self.refused = Refused::default();
        self.adopts = None;
    }

    /// Keeps the state after a sample where the next slope begins there. Ends a span where one is due, and
    /// judges the offset.
    pub(super) fn corrected(
        &mut self,
        state: &State,
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
        rival: impl Fn(bool) -> f64,
    ) -> Option<Lag> {
        self.keep(state);
        let due = state.time.since(self.span) >= SPAN;
        let worst = due.then(|| self.worst(state.time, covariance, considered)).flatten();
        let left = self.effect.all(0);
        if due
            && self.compensates()
            && !self.withdrawn
            && left.sigmas().abs() >= LEFT
            && linear(&left)
        {
            self.adopts = Some(0);
        }
        if self.compensates() {
            containment.contain((&self.effect, &self.effect.all(0), 0), covariance);
        }
        self.judge(worst, containment, rival)
    }

    /// Judges the offset where the gate is about to refuse another sample.
    pub(super) fn refused(
        &mut self,
        (covariance, considered): (&Covariance, &[bool]),
        containment: &Containment,
        rival: impl Fn(bool) -> f64,
    ) -> Option<Lag> {
        let counts = |sum: usize| self.counts(sum);
        let worst = self.effect.worst(
            (SIGNIFICANT, counts),
            |sum| self.effect.all(sum),
            (covariance, considered),
            true,
        );
        self.judge(worst, containment, rival)
    }

    /// Keeps the state where the next slope begins there.
    pub(super) fn keep(&mut self, state: &State) {
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
    }

    /// Returns an offset that is more severe than those before, and takes the first one off. `rival` is the
    /// score that it has to exceed, of samples that are early or late.
    fn judge(
        &mut self,
        worst: Option<Found>,
        containment: &Containment,
        rival: impl Fn(bool) -> f64,
    ) -> Option<Lag> {
        let early = worst.is_some_and(|found| self.is_early(&found.score));
        let worst = worst.filter(|found| found.score.sigmas().abs() > rival(early));
        let before = self.severity;
        self.severity = before.max(worst.map(|worst| worst.severity));
        if !containment.is_off() {
            self.adopts = self.adopts.or(worst.map(|worst| worst.sum));
        }
        let found = worst.filter(|worst| before < Some(worst.severity))?;
        Some(Lag { found, known: self.known, early })
    }

    /// Returns `true` for early samples, unless an offset that began later explains them clearly better: the clock of the
    /// sensor was set then.
    fn is_early(&self, score: &Score) -> bool {
        if self.compensates() {
            return self.known < 0.0;
        }
        let start = self.effect.all(0);
        score.size() < 0.0
            && start.size() < 0.0
            && score.sigmas().abs() < leading(start.sigmas().abs())
    }

    /// Ends a span, and returns the most severe offset.
    fn worst(&mut self, time: Time, covariance: &Covariance, considered: &[bool]) -> Option<Found> {
        self.span = time;
        self.effect.end_span();
        let worst = {
            let counts = |sum: usize| sum != RECENT && self.counts(sum);
            self.effect.worst(
                (SIGNIFICANT, counts),
                |sum| self.effect.all(sum),
                (covariance, considered),
                false,
            )
        };
        if time.since(self.effect.newest(RECENT)) >= TURN {
            self.renew(self.next, time);
            self.next = 1 + self.next % (RECENT - 1);
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    /// The first sum runs from the start, and the last one since all sensors agreed.
    #[test]
    fn two_sums_begin_again_in_turn_every_two_minutes() {
        let mut offset = Offset::new(0);
        offset.effect.begin(Time::default());
        let begun = [120.0, 240.0, 360.0, 480.0, 600.0].map(|at| {
            let time = Time::from_seconds(at).unwrap();
            offset.worst(time, &Covariance::zero(0), &[]);
            (0..SUMS).position(|sum| offset.effect.since(sum) == time)
        });
        assert_eq!(begun, [1, 2, 1, 2, 1].map(Some));
        assert_eq!(offset.effect.since(0), Time::default());
    }
}
