//! Usual behaviour of the channels of the driving sensor, learnt from the samples that pass.

use crate::model::screening::{Screening, Spread};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;
use std::sync::Arc;

/// Jump that counts as faulty, as a multiple of the roughness. White noise has a roughness of 1.95
/// sigma, so this is 49 sigma. The largest spike that is no fault in the recordings that we checked
/// has a ratio of 15 (a car on a road).
const JUMP: f64 = 25.0;
/// The same in sigma of the noise that the process assumes: the least jump that is held.
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
/// Number of such times after which the largest change is forgotten.
const FORGOTTEN: f64 = 600.0;

/// Usual behaviour of the channels.
#[derive(Clone)]
pub(super) struct Usual {
    limits: Arc<Screening>,
    /// Number of channels.
    n: usize,
    count: u32,
    time: Time,
    /// Usual interval, s.
    pub(super) interval: f64,
    /// The last two values that passed, the last one being from `good`.
    pub(super) last: Spread,
    pub(super) before: Spread,
    pub(super) good: Time,
    /// Roughness: the mean magnitude of the second differences of white noise, and never less than
    /// the quantisation.
    pub(super) rough: Spread,
    /// Means of `|b|` and `b^2` over the second differences `b` that are not zero.
    bends: [Spread; 2],
    /// Jump that is always possible, in the unit of the channels.
    pub(super) least: Spread,
    /// Recent mean, its value before [`CHANGE`], and the largest change.
    pub(super) mean: Spread,
    mean_before: Spread,
    changed: Time,
    pub(super) motion: Spread,
}

impl Usual {
    /// Time over which the change of the mean is learnt, s.
    pub(super) const CHANGE: f64 = 1.0;

    pub(super) fn new(limits: Arc<Screening>) -> Self {
        const ZERO: Spread = [0.0; MAX_CHANNELS];
        Self {
            n: limits.channels.len().min(MAX_CHANNELS),
            limits,
            count: 0,
            time: Time::MIN,
            interval: 0.0,
            last: ZERO,
            before: ZERO,
            good: Time::MIN,
            rough: ZERO,
            bends: [ZERO; 2],
            least: [f64::INFINITY; MAX_CHANNELS],
            mean: ZERO,
            mean_before: ZERO,
            changed: Time::MIN,
            motion: ZERO,
        }
    }

    /// Follows the usual interval, and the limits that depend on it.
    pub(super) fn tick(&mut self, time: Time) {
        let dt = if self.time == Time::MIN { 0.0 } else { time.since(self.time) };
        self.time = time;
        if dt <= 0.0 || (self.interval > 0.0 && dt > 1.5 * self.interval && self.count > 8) {
            return;
        }
        let before = self.interval;
        self.interval = if before > 0.0 { before + (dt - before) / 64.0 } else { dt };
        if (self.interval - before).abs() > 1e-3 * before {
            for (least, limits) in self.least.iter_mut().zip(&self.limits.channels) {
                let sigma = limits.noise / self.interval.sqrt();
                let unit = if self.limits.integrals { self.interval } else { 1.0 };
                *least = (JUMP_SIGMA * sigma + JUMP * limits.step) * unit;
            }
        }
    }

    /// Factor from the limits, which are rates, to the unit of the channels.
    pub(super) fn unit(&self) -> f64 {
        if self.limits.integrals { self.interval } else { 1.0 }
    }

    /// Channels that jump away from the line through the last two samples.
    pub(super) fn jumping(&self, x: &Spread) -> u16 {
        let mut jumping = 0;
        if self.count < WARM {
            return 0;
        }
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
    /// Each second difference `b` has the weight `|b|`: the roughness is the mean of `b^2` over that
    /// of `|b|`, times that ratio for white noise. A quiet sensor with a coarse quantisation repeats
    /// its value most of the time. Repetitions would make a plain mean less than one step, so that a
    /// change by a step would count as a spike.
    ///
    /// The loop has no branch, so that the compiler turns it into vector instructions.
    fn roughen(&mut self, x: &Spread, share: f64) {
        let warm = self.count > WARM;
        let Self { n, last, before, rough, bends: [means, squares], .. } = self;
        for c in 0..(*n).min(MAX_CHANNELS) {
            let bend = (x[c] - 2.0 * last[c] + before[c]).abs();
            let most = if warm && rough[c] > 0.0 { 8.0 * rough[c] } else { bend };
            let bend = if bend < most { bend } else { most };
            let mean = means[c] + (bend - means[c]) * share;
            let square = squares[c] + (bend * bend - squares[c]) * share;
            let bent = bend > 0.0;
            rough[c] = if bent { GAUSSIAN * square / mean } else { rough[c] };
            means[c] = if bent { mean } else { means[c] };
            squares[c] = if bent { square } else { squares[c] };
        }
    }

    /// Learns from a sample that passes. The mean takes `fresh` samples alone, no repetition.
    pub(super) fn learn(&mut self, x: &Spread, time: Time, fresh: bool) {
        self.count = self.count.saturating_add(1);
        let count = f64::from(self.count);
        let (share, recent) = (1.0 / count.min(MEMORY), 1.0 / count.min(RECENT));
        if self.count > 2 {
            self.roughen(x, share);
        }
        if fresh {
            self.mean.iter_mut().zip(x).for_each(|(mean, x)| *mean += (x - *mean) * recent);
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
