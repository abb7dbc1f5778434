//! Usual behaviour of the channels of the driving sensor, learnt from the samples that pass.
//!
//! The loops over the channels take some at once: see [`super::screen`].

use crate::checkpoint::saved;
use crate::filter::propagate::cadence::Cadence;
use crate::model::process::screening::{Screening, Spread};
use crate::state::{magnitude, select};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;
use pulp::Simd;
use std::sync::Arc;

/// Jump that counts as faulty, as a multiple of the roughness. White noise has a roughness of 1.95
/// sigma, so this is 49 sigma. The largest spike that is no fault in the recordings that we checked
/// has a ratio of 15 (a car on a road).
const JUMP: f64 = 25.0;
/// The same jump, in sigma of the noise that the process assumes: the least that is held.
const JUMP_SIGMA: f64 = 50.0;
/// Ratio of the mean of `|b|` to that of `b^2 / |b|` for a second difference `b` of white noise: with
/// sigma 1 the mean of `|b|` is `sqrt(2/pi)`, and that of `b^2` is 1.
const GAUSSIAN: f64 = 2.0 / std::f64::consts::PI;
/// Number of samples over which the second differences are averaged.
const MEMORY: f64 = 200.0;
/// Number of samples before jumps and repetitions are judged.
const WARM: u32 = 100;
/// Number of samples of the recent mean.
const RECENT: f64 = 16.0;
/// Number of such spans after which the largest change is forgotten.
const FORGOTTEN: f64 = 600.0;

/// Usual behaviour of the channels. The channels come first, so that no vector of them crosses a cache
/// line.
#[derive(Clone)]
#[repr(C, align(64))]
pub(in crate::filter) struct Usual {
    /// The last two values that passed, the last one being from `good`.
    pub(in crate::filter) last: Spread,
    pub(in crate::filter) before: Spread,
    /// Roughness: the mean magnitude of the second differences of white noise, and never less than
    /// the quantisation.
    pub(in crate::filter) rough: Spread,
    /// Means of `|b|` and `b^2` over the second differences `b` that are not zero.
    bends: [Spread; 2],
    /// Jump that is always possible, in the unit of the channels.
    pub(in crate::filter) least: Spread,
    /// Largest rate of change, infinite where none is given.
    change: Spread,
    /// Recent mean, its value before [`CHANGE`], and the largest change.
    pub(in crate::filter) mean: Spread,
    mean_before: Spread,
    pub(in crate::filter) motion: Spread,
    changed: Time,
    pub(in crate::filter) good: Time,
    limits: Arc<Screening>,
    /// Number of channels.
    n: usize,
    count: u32,
    time: Time,
    pub(in crate::filter) cadence: Cadence,
    /// Interval for which `least` was computed, s.
    least_of: f64,
}

saved!(Usual {
    last, before, rough, bends, least, mean, mean_before, motion, changed, good, count, time,
    cadence, least_of,
} except {
    change, limits, n,
});

/// The first `n` channels in whole lanes.
#[inline(always)]
pub(in crate::filter) fn lanes<S: Simd>(spread: &Spread, n: usize) -> &[S::f64s] {
    S::as_simd_f64s(&spread[..n.next_multiple_of(4)]).0
}

/// Writable [`lanes`].
#[inline(always)]
pub(in crate::filter) fn lanes_mut<S: Simd>(spread: &mut Spread, n: usize) -> &mut [S::f64s] {
    S::as_mut_simd_f64s(&mut spread[..n.next_multiple_of(4)]).0
}

impl Usual {
    /// Time over which the change of the mean is learnt, s.
    pub(in crate::filter) const CHANGE: f64 = 1.0;

    pub(in crate::filter) fn new(limits: Arc<Screening>) -> Self {
        const ZERO: Spread = [0.0; MAX_CHANNELS];
        let mut change = [f64::INFINITY; MAX_CHANNELS];
        for (change, limits) in change.iter_mut().zip(&limits.channels) {
            *change = limits.change.unwrap_or(f64::INFINITY);
        }
        Self {
            n: limits.channels.len().min(MAX_CHANNELS),
            limits,
            count: 0,
            time: Time::MIN,
            cadence: Cadence::default(),
            least_of: 0.0,
            last: ZERO,
            before: ZERO,
            good: Time::MIN,
            rough: ZERO,
            bends: [ZERO; 2],
            least: [f64::INFINITY; MAX_CHANNELS],
            change,
            mean: ZERO,
            mean_before: ZERO,
            changed: Time::MIN,
            motion: ZERO,
        }
    }

    /// Follows the usual interval, and the limits that depend on it.
    #[inline(always)]
    pub(in crate::filter) fn tick(&mut self, time: Time) {
        let dt = if self.time == Time::MIN { 0.0 } else { time.since(self.time) };
        self.time = time;
        self.cadence.usual(dt);
        if (self.interval() - self.least_of).abs() > 0.01 * self.least_of {
            self.follow_interval();
        }
    }

    /// Computes the limits that depend on the usual interval.
    #[cold]
    fn follow_interval(&mut self) {
        self.least_of = self.interval();
        let (root, unit) = (self.interval().sqrt(), self.unit());
        for (least, limits) in self.least.iter_mut().zip(&self.limits.channels) {
            *least = (JUMP_SIGMA * limits.noise / root + JUMP * limits.step) * unit;
        }
    }

    /// Usual interval, s.
    pub(in crate::filter) fn interval(&self) -> f64 {
        self.cadence.interval
    }

    /// Factor from the limits, which are rates, to the unit of the channels.
    pub(in crate::filter) fn unit(&self) -> f64 {
        if self.limits.integrals { self.interval() } else { 1.0 }
    }

    /// Channels that jump away from the line through the last two samples.
    #[inline(always)]
    pub(in crate::filter) fn jumping<S: Simd>(&self, simd: S, x: &Spread) -> u16 {
        if self.count < WARM || !self.may_jump(simd, x) { 0 } else { self.jumps(x) }
    }

    /// Returns `false` if no channel jumps.
    #[inline(always)]
    fn may_jump<S: Simd>(&self, simd: S, x: &Spread) -> bool {
        let n = self.n;
        let (x, last) = (lanes::<S>(x, n), lanes::<S>(&self.last, n));
        let (before, least) = (lanes::<S>(&self.before, n), lanes::<S>(&self.least, n));
        let (rough, change) = (lanes::<S>(&self.rough, n), lanes::<S>(&self.change, n));
        let [two, many, unit] = [2.0, JUMP, self.unit()].map(|v| simd.splat_f64s(v));
        let mut any = false;
        for k in 0..x.len() {
            let ahead = simd.sub_f64s(x[k], simd.mul_f64s(two, last[k]));
            let bend = magnitude(simd, simd.add_f64s(ahead, before[k]));
            let usual = simd.mul_f64s(many, rough[k]);
            let bends = simd
                .and_m64s(simd.less_than_f64s(least[k], bend), simd.less_than_f64s(usual, bend));
            let step = magnitude(simd, simd.sub_f64s(x[k], last[k]));
            let steps = simd.less_than_f64s(simd.mul_f64s(change[k], unit), step);
            any |= simd.first_true_m64s(simd.or_m64s(bends, steps)) < S::F64_LANES;
        }
        any
    }

    #[cold]
    fn jumps(&self, x: &Spread) -> u16 {
        let mut jumping = 0;
        for (c, &x) in x.iter().enumerate().take(self.n) {
            let bend = (x - 2.0 * self.last[c] + self.before[c]).abs();
            // a channel that never changed has shown no step of its quantisation yet
            let usual = self.rough[c];
            let learnt = bend > self.least[c] && usual > 0.0 && bend > JUMP * usual;
            let limit = self.limits.channels[c].change;
            if limit.map_or(learnt, |l| (x - self.last[c]).abs() > l * self.unit()) {
                jumping |= 1 << c;
            }
        }
        jumping
    }

    /// Learns the roughness of the channels from second differences that are not zero.
    ///
    /// Each second difference `b` has the weight `|b|`: the roughness is the mean of `b^2` over the
    /// mean of `|b|`, times `GAUSSIAN`. A quiet sensor with a coarse quantisation repeats its value
    /// most of the time. Repetitions would make a plain mean less than one step, so that a change by
    /// a step would count as a spike.
    #[inline(always)]
    fn roughen<S: Simd>(&mut self, simd: S, x: &Spread, share: f64) {
        let most = if self.count > WARM { 8.0 } else { f64::INFINITY };
        let Self { n, last, before, rough, bends: [means, squares], .. } = self;
        let (x, last, before) = (lanes::<S>(x, *n), lanes::<S>(last, *n), lanes::<S>(before, *n));
        let rough = lanes_mut::<S>(rough, *n);
        let (means, squares) = (lanes_mut::<S>(means, *n), lanes_mut::<S>(squares, *n));
        let share = simd.splat_f64s(share);
        let [zero, two] = [0.0, 2.0].map(|v| simd.splat_f64s(v));
        let [most, none] = [most, f64::INFINITY].map(|v| simd.splat_f64s(v));
        let gaussian = simd.splat_f64s(GAUSSIAN);
        for k in 0..x.len() {
            let ahead = simd.sub_f64s(x[k], simd.mul_f64s(two, last[k]));
            let bend = magnitude(simd, simd.add_f64s(ahead, before[k]));
            let known = simd.less_than_f64s(zero, rough[k]);
            let limit = select(simd, known, simd.mul_f64s(most, rough[k]), none);
            let bend = select(simd, simd.less_than_f64s(bend, limit), bend, limit);
            let bent = simd.less_than_f64s(zero, bend);
            let follow =
                |mean, value| simd.add_f64s(mean, simd.mul_f64s(simd.sub_f64s(value, mean), share));
            let mean = follow(means[k], bend);
            let square = follow(squares[k], simd.mul_f64s(bend, bend));
            let ratio = simd.div_f64s(simd.mul_f64s(gaussian, square), mean);
            rough[k] = select(simd, bent, ratio, rough[k]);
            means[k] = select(simd, bent, mean, means[k]);
            squares[k] = select(simd, bent, square, squares[k]);
        }
    }

    /// Learns from a sample that passes. The mean takes only `fresh` samples, no repetitions.
    #[inline(always)]
    pub(in crate::filter) fn learn<S: Simd>(
        &mut self,
        simd: S,
        x: &Spread,
        time: Time,
        fresh: bool,
    ) {
        self.count = self.count.saturating_add(1);
        let count = f64::from(self.count);
        let (share, recent) = (1.0 / count.min(MEMORY), 1.0 / count.min(RECENT));
        if self.count > 2 {
            self.roughen(simd, x, share);
        }
        if fresh {
            let recent = simd.splat_f64s(recent);
            for (mean, x) in
                lanes_mut::<S>(&mut self.mean, self.n).iter_mut().zip(lanes::<S>(x, self.n))
            {
                *mean = simd.add_f64s(*mean, simd.mul_f64s(simd.sub_f64s(*x, *mean), recent));
            }
        }
        self.before = self.last;
        self.last = *x;
        self.good = time;
        if self.changed == Time::MIN {
            self.changed = time;
        } else if time.since(self.changed) >= Self::CHANGE {
            for c in 0..self.n {
                let change = (self.mean[c] - self.mean_before[c]).abs();
                self.motion[c] = change.max(self.motion[c] * (1.0 - 1.0 / FORGOTTEN));
            }
            if self.count < WARM {
                self.motion = [0.0; MAX_CHANNELS];
            }
            self.changed = time;
            self.mean_before = self.mean;
        }
    }
}

#[cfg(test)]
mod tests;
