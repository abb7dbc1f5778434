//! What speaks for the errors that are compared.

use super::super::effect::Found;
use super::super::parameter::LINEAR;
use super::super::score::{PARAMETER, Score, leading};
use super::super::shift::{Place, Shift};
use super::refusal::LARGE;
use super::{Covariance, RECENT, SUMS, Shifts, at};
use std::ops::Range;

/// Score in sigma that is significant: 6 for one error, as that of a time offset, and `2 ln 48` more in twice
/// the log-likelihood ratio, since as many errors and more begins are compared.
const SIGNIFICANT: f64 = 6.6;
/// Score in sigma at which a step of a bias of the driving sensor is significant. Of 600 runs without a step, 4
/// exceed 4.25 by chance, and none 4.5.
const STEP: f64 = 4.75;

impl Shifts {
    /// Square of the score of a sum: twice its log-likelihood ratio. Nothing speaks for an error that would be another
    /// one by its size, or have turned the estimate so far that the test is not linear.
    pub(super) fn evidence(&self, axis: usize, sum: usize) -> f64 {
        self.evidence_of(axis, sum, true)
    }

    /// The same by all samples, or by those that the gate did not refuse.
    pub(super) fn evidence_of(&self, axis: usize, sum: usize, all: bool) -> f64 {
        let score = if all { self.score_of(axis, sum) } else { self.used(axis, sum) };
        let sigmas = score.sigmas();
        let possible = score.size().abs() < self.axes[axis].most;
        let counts = sigmas.is_finite() && possible && self.linear(axis, sum);
        if counts { sigmas * sigmas } else { 0.0 }
    }

    /// Score of a sum of an error by all samples.
    pub(super) fn all(&self, axis: usize, sum: usize) -> Score {
        let (effect, column) = at(axis, sum);
        if sum == LARGE { self.large.all(axis) } else { self.effects[effect].all(column) }
    }

    /// The same by those that the gate did not refuse.
    pub(super) fn used(&self, axis: usize, sum: usize) -> Score {
        let (effect, column) = at(axis, sum);
        if sum == LARGE { self.large.used(axis) } else { self.effects[effect].used(column) }
    }

    /// Score of a sum of an error. A slow step is found by the samples that the filter follows.
    pub(super) fn score_of(&self, axis: usize, sum: usize) -> Score {
        if self.axes[axis].patient { self.used(axis, sum) } else { self.all(axis, sum) }
    }

    pub(super) fn linear(&self, axis: usize, sum: usize) -> bool {
        let (size, (effect, column)) = (self.all(axis, sum).size(), at(axis, sum));
        let turned = |row: usize| match sum {
            LARGE => self.large.s[row][axis],
            _ => self.effects[effect].s[row][column],
        };
        self.rotations.iter().all(|row| (size * f64::from(turned(*row))).abs() < LINEAR)
    }

    /// Returns `true` if a larger noise does not explain what an error does. The limit of a slow step holds for its
    /// score as it is.
    pub(super) fn noise_is_no_rival(&self, axis: usize, score: &Score) -> bool {
        self.axes[axis].patient || score.significance() >= self.significant(axis)
    }

    /// Score in sigma at which an error is significant.
    pub(super) fn significant(&self, axis: usize) -> f64 {
        if self.axes[axis].patient { STEP } else { SIGNIFICANT }
    }

    /// Returns `true` if an error of a sensor explains what the gate refused of it.
    pub(super) fn explains(&self, axis: usize, sum: usize) -> bool {
        let (effect, column) = at(axis, sum);
        let effect = &self.effects[effect];
        self.gated[self.axes[axis].sensor].explained(&effect.all(column), &effect.used(column))
    }

    /// The errors of the channels of the same sensor that the samples do not tell from one of them, such as a drift of a position
    /// from an offset of a velocity.
    pub(super) fn alike(
        &self,
        axis: usize,
        found: &Found,
        states: (&Covariance, &[bool]),
    ) -> Vec<(usize, Found)> {
        let score = found.score.sigmas().abs();
        let alike = |other: usize| {
            let Shift { sensor, place, .. } = self.axes[other];
            let channel = !matches!(place, Place::State(_));
            if other == axis || !channel || sensor != self.axes[axis].sensor {
                return None;
            }
            let evidence = |sum: &usize| self.evidence(other, *sum);
            let most = (0..SUMS).max_by(|a, b| evidence(a).total_cmp(&evidence(b)))?;
            let (effect, column) = at(other, most);
            let own = (column, self.score_of(other, most));
            let clear = score > leading(evidence(&most).sqrt());
            self.effects[effect].found(own, 0.0, states, false).filter(|_| !clear)
        };
        (0..self.axes.len()).filter_map(|other| Some((other, alike(other)?))).collect()
    }

    /// The largest evidence for some errors that begins with a sum.
    pub(super) fn most(&self, axes: Range<usize>, sum: usize) -> f64 {
        axes.map(|axis| self.evidence(axis, sum)).fold(0.0, f64::max)
    }

    /// The sum in which less is found, of those that begin at any time, and its evidence.
    pub(super) fn weakest(&self, axes: Range<usize>) -> (usize, f64) {
        let sums = (1..RECENT).map(|sum| (sum, self.most(axes.clone(), sum)));
        sums.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
    }

    /// Score in sigma of the errors of a sensor that begin with a sum: of the most significant one, or of
    /// the offsets of all channels together.
    pub(super) fn of_sensor(&self, sensor: usize, sum: usize, all: bool) -> f64 {
        let own = self.axes.iter().enumerate().filter(|(_, axis)| axis.sensor == sensor);
        let (mut most, mut offsets) = (0.0_f64, 0.0);
        for (index, axis) in own {
            let evidence = self.evidence_of(index, sum, all);
            most = most.max(evidence);
            match axis.place {
                Place::Channel(_) => offsets += (evidence - PARAMETER).max(0.0),
                Place::State(_) | Place::Drift(_) => {}
            }
        }
        most.max(if offsets > 0.0 { offsets + PARAMETER } else { 0.0 }).sqrt()
    }

    /// Score in sigma of the most significant drift of a sensor.
    pub(in super::super) fn drift(&self, sensor: usize) -> f64 {
        let drifts = |axis: &Shift| axis.sensor == sensor && matches!(axis.place, Place::Drift(_));
        let drifts = self.axes.iter().enumerate().filter(|(_, axis)| drifts(axis));
        let sums = |axis: usize| (0..SUMS).map(move |sum| (axis, sum));
        let all = drifts.flat_map(|(axis, _)| sums(axis));
        all.map(|(axis, sum)| self.evidence(axis, sum)).fold(0.0, f64::max).sqrt()
    }

    /// Score in sigma of the most significant errors of the sensors that count, in the first sums, by all samples
    /// or by those that the gate did not refuse.
    pub(in super::super) fn score(
        &self,
        (first, all): (usize, bool),
        counts: impl Fn(usize) -> bool,
    ) -> f64 {
        let sensors = (0..self.sensors).filter(|sensor| counts(*sensor));
        let sums = |sensor| (0..first).map(move |sum| (sensor, sum));
        let scores = sensors.flat_map(sums).map(|(sensor, sum)| self.of_sensor(sensor, sum, all));
        scores.fold(0.0, f64::max)
    }
}
