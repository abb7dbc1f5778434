//! What speaks for the errors that are compared.

use super::super::effect::Found;
use super::super::parameter::LINEAR;
use super::super::score::{PARAMETER, Score, leading};
use super::super::shift::{Place, Shift};
use super::{Covariance, RECENT, SUMS, Shifts, at};
use std::ops::Range;

/// Multiple of the limit of the gate from which on innovations are far beyond it: a gate that refuses good samples
/// refuses those just beyond its limit.
const FAR: f64 = 3.0;

impl Shifts {
    /// Square of the score of a sum: twice its log-likelihood ratio. Nothing speaks for an error that would have
    /// turned the estimate so far that the test is not linear.
    pub(super) fn evidence(&self, axis: usize, sum: usize) -> f64 {
        self.evidence_of(axis, sum, true)
    }

    /// The same by all samples, or by those that the gate did not refuse.
    pub(super) fn evidence_of(&self, axis: usize, sum: usize, all: bool) -> f64 {
        let score = if all { self.score_of(axis, sum) } else { self.used(axis, sum) };
        let sigmas = score.sigmas();
        let counts = sigmas.is_finite() && self.linear(axis, sum);
        if counts { sigmas * sigmas } else { 0.0 }
    }

    fn used(&self, axis: usize, sum: usize) -> Score {
        let (effect, column) = at(axis, sum);
        self.effects[effect].used(column)
    }

    /// Score of a sum of an error. A slow step is found by the samples that the filter follows.
    pub(super) fn score_of(&self, axis: usize, sum: usize) -> Score {
        let (effect, column) = at(axis, sum);
        let slow = self.axes[axis].patient && sum != RECENT;
        if slow { self.used(axis, sum) } else { self.effects[effect].all(column) }
    }

    pub(super) fn linear(&self, axis: usize, sum: usize) -> bool {
        let (effect, column) = at(axis, sum);
        let effect = &self.effects[effect];
        let size = effect.all(column).size();
        self.rotations.iter().all(|row| (size * f64::from(effect.s[*row][column])).abs() < LINEAR)
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
            if axis.patient && sum == RECENT {
                continue;
            }
            let evidence = self.evidence_of(index, sum, all);
            most = most.max(evidence);
            match axis.place {
                Place::Channel(_) => offsets += (evidence - PARAMETER).max(0.0),
                Place::State(_) | Place::Drift(_) => {}
            }
        }
        most.max(if offsets > 0.0 { offsets + PARAMETER } else { 0.0 }).sqrt()
    }

    /// Returns `true` if the gate refused samples of a sensor of positions that are far beyond its limit, and an error fits
    /// these clearly better than a jump or a drift of one of the channels does. An error of the driving sensor is a
    /// drift of a velocity, so that a velocity log alone does not decide.
    pub(super) fn outgrows(&self, axis: usize, sum: usize, sensor: usize) -> bool {
        let [samples, weights] = self.weights;
        let drifts = |axis: &Shift| axis.sensor == sensor && matches!(axis.place, Place::Drift(_));
        if FAR * weights >= samples || !self.axes.iter().any(drifts) {
            return false;
        }
        let own = self.largest(sensor, |place| !matches!(place, Place::State(_)));
        self.of_refused(axis, sum) > leading(own)
    }

    /// Score in sigma, at the stated noise, of an offset of one channel of a sensor that begins with the first
    /// sample that the gate refused. An error of the driving sensor is in several channels, such as a velocity
    /// and a position.
    pub(super) fn jump(&self, sensor: usize) -> f64 {
        self.largest(sensor, |place| matches!(place, Place::Channel(_)))
    }

    /// Largest score in sigma of some errors of a sensor, at the stated noise, by the samples that the gate refused.
    fn largest(&self, sensor: usize, counts: impl Fn(Place) -> bool) -> f64 {
        let own = self.axes.iter().enumerate();
        let own = own.filter(|(_, axis)| axis.sensor == sensor && counts(axis.place));
        let sums = own.flat_map(|(axis, _)| (0..SUMS).map(move |sum| (axis, sum)));
        sums.map(|(axis, sum)| self.of_refused(axis, sum)).fold(0.0, f64::max)
    }

    /// Score in sigma of an error, at the stated noise, by the samples that the gate refused.
    fn of_refused(&self, axis: usize, sum: usize) -> f64 {
        let (effect, column) = at(axis, sum);
        self.effects[effect].all(column).without(&self.effects[effect].used(column)).raw()
    }

    /// Returns `true` if the gate refused nearly all samples of a sensor, and an error since the start fits these clearly
    /// better than a jump of one of its channels does.
    pub(super) fn grows(&self, axis: usize, sum: usize, sensor: usize) -> bool {
        self.since(axis, sum) == self.run
            && self.gated[sensor].nearly_all()
            && self.of_refused(axis, sum) > leading(self.jump(sensor))
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
