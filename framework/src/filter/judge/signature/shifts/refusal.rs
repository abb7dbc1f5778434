//! What explains the samples that the gate refuses.

use super::super::effect::Found;
use super::super::score::leading;
use super::super::shift::{Place, Shift};
use super::{Containment, Covariance, GONE, PROMISING, SUMS, Shifts, Step, Time, at, significance};

/// Time from the start in which an error that was there from the start shows, s: later the filter has errors of its own
/// where it refuses nearly all samples.
const EARLY: f64 = 60.0;
/// Score in sigma that is significant where the gate refuses samples.
pub(super) const REFUSED: f64 = 6.0;
/// Mean square of what an error leaves of the refused innovations above which it does not fit them.
const POOR: f64 = 2.0;
/// The sum of a large step of a bias of the driving sensor.
pub(super) const LARGE: usize = SUMS;
/// Multiple of the limit of the gate from which on innovations are far beyond it: a gate that refuses good samples
/// refuses those just beyond its limit.
const FAR: f64 = 3.0;

impl Shifts {
    /// Begins the sums of the large steps again.
    pub(super) fn renew_large(&mut self, time: Time) {
        for (column, axis) in self.axes[..self.biases].iter().enumerate() {
            self.large.renew(column, time);
            if let Place::State(row) = axis.place {
                self.large.s[row][column] = 1.0;
            }
        }
    }

    /// Names an error of the driving sensor that explains what the gate has refused, where it is about to
    /// refuse one more. If it refuses one sensor alone, the error has to grow, as one of the driving sensor does: the
    /// samples before show it as well, and it is none if it fits poorly and a jump of one of the channels clearly
    /// better. In the first minute of a run, of whose samples nearly all were refused, it may fit those well, and
    /// clearly better than any jump. So it may at any time if they are far beyond the limit of the gate.
    pub(in super::super) fn refused(
        &mut self,
        (time, alone): (Time, Option<usize>),
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
        rival: impl Fn(usize) -> f64,
    ) -> Option<Step> {
        let [squares, count] = self.refused;
        let early = time.since(self.run) <= EARLY;
        // what was wrong from the start, such as a clock, looks like a step that begins just now
        let began = |axis, sum| {
            !(early && sum == LARGE) && self.evidence_of(axis, sum, false) >= PROMISING * PROMISING
        };
        let counts = |axis: usize, sum: usize| {
            let left = squares - self.evidence(axis, sum) - count;
            let Shift { sensor, patient, .. } = self.axes[axis];
            let grows = |alone| {
                began(axis, sum)
                    || early && sum != LARGE && self.grows(axis, sum, alone)
                    || sum == LARGE && self.outgrows(axis, alone)
            };
            let driving = Some(sensor) == self.driver && !patient && sum != 0;
            driving && left <= GONE * squares && alone.is_none_or(grows)
        };
        let worst = self.worst(counts, (covariance, considered), true);
        let worst = worst.map(|(axis, found)| (found.sum - at(axis, 0).1, (axis, found)));
        let large = self.large(counts, (covariance, considered)).map(|large| (LARGE, large));
        let (sum, worst) = [worst, large]
            .into_iter()
            .flatten()
            .max_by(|a, b| significance(&a.1).total_cmp(&significance(&b.1)))?;
        let raw = worst.1.score.raw();
        let poor = squares - raw * raw > POOR * count;
        let jumps = |sensor| !began(worst.0, sum) || self.jump(sensor) > leading(raw);
        if poor && alone.is_some_and(jumps) || !self.leads(&worst, &rival) {
            return None;
        }
        self.contain(worst, time, (covariance, considered), containment)
    }

    /// The most significant large step of a bias of the driving sensor that counts, with its index.
    fn large(
        &self,
        counts: impl Fn(usize, usize) -> bool,
        states: (&Covariance, &[bool]),
    ) -> Option<(usize, Found)> {
        let of = |axis: usize| {
            let score = self.large.all(axis);
            let counts = counts(axis, LARGE) && self.linear(axis, LARGE);
            let possible = counts && score.size().abs() < self.axes[axis].most;
            possible.then(|| self.large.found((axis, score), REFUSED, states, true)).flatten()
        };
        let found = (0..self.biases).filter_map(|axis| Some((axis, of(axis)?)));
        found.max_by(|a, b| significance(a).total_cmp(&significance(b)))
    }

    /// Returns `true` if the gate refused samples of a sensor of positions that are far beyond its limit, and a large step fits
    /// these clearly better than a jump or a drift of one of the channels does. An error of the driving sensor is a
    /// drift of a velocity, so that a velocity log alone does not decide.
    pub(super) fn outgrows(&self, axis: usize, sensor: usize) -> bool {
        let [samples, weights] = self.weights;
        let drifts = |axis: &Shift| {
            axis.sensor == sensor && !axis.followed && matches!(axis.place, Place::Drift(_))
        };
        if FAR * weights >= samples || !self.axes.iter().any(drifts) {
            return false;
        }
        let own = self.largest(sensor, |place| !matches!(place, Place::State(_)));
        self.of_refused(axis, LARGE) > leading(own)
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
        self.all(axis, sum).without(&self.used(axis, sum)).raw()
    }

    /// Returns `true` if the gate refused nearly all samples of a sensor, and an error since the start fits these clearly
    /// better than a jump of one of its channels does.
    pub(super) fn grows(&self, axis: usize, sum: usize, sensor: usize) -> bool {
        self.since(axis, sum) == self.run
            && self.gated[sensor].nearly_all()
            && self.of_refused(axis, sum) > leading(self.jump(sensor))
    }
}
