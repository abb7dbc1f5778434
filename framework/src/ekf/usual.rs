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
            let learnt = usual > 0.0 && bend > JUMP * usual && bend > self.least[c];
            let limit = self.limits.channels[c].change;
            if limit.map_or(learnt, |l| (x - self.last[c]).abs() > l * self.unit()) {
                jumping |= 1 << c;
            }
        }
        jumping
    }

    /// Learns the roughness of a channel from a second difference that is not zero.
    ///
    /// Each second difference `b` has the weight `|b|`: the roughness is the mean of `b^2` over that
    /// of `|b|`, times that ratio for white noise. A quiet sensor with a coarse quantisation repeats
    /// its value most of the time. Repetitions would make a plain mean less than one step, so that a
    /// change by a step would count as a spike.
    fn roughen(&mut self, c: usize, bend: f64, share: f64) {
        let most =
            if self.count > WARM && self.rough[c] > 0.0 { 8.0 * self.rough[c] } else { bend };
        let bend = bend.min(most);
        let [mean, square] = &mut self.bends;
        mean[c] += (bend - mean[c]) * share;
        square[c] += (bend * bend - square[c]) * share;
        self.rough[c] = GAUSSIAN * square[c] / mean[c];
    }

    /// Learns from a sample that passes. The mean takes `fresh` samples alone, no repetition.
    pub(super) fn learn(&mut self, x: &Spread, time: Time, fresh: bool) {
        self.count = self.count.saturating_add(1);
        let count = f64::from(self.count);
        let (share, recent) = (1.0 / count.min(MEMORY), 1.0 / count.min(RECENT));
        for (c, &x) in x.iter().enumerate().take(self.n) {
            let bend = (x - 2.0 * self.last[c] + self.before[c]).abs();
            if self.count > 2 && bend > 0.0 {
                self.roughen(c, bend, share);
            }
            if fresh {
                self.mean[c] += (x - self.mean[c]) * recent;
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
mod tests {
    use super::*;
    use crate::model::screening::ChannelLimits;

    /// One channel at 100 Hz whose stated noise hides no step of 1.
    fn usual() -> Usual {
        let limits =
            ChannelLimits { range: 1e9, change: None, noise: 1e-4, step: 0.0, motion: 0.0 };
        let channels = vec![limits];
        let limits = Screening { channels, integrals: false, frozen: None, max_bridge: 1.0 };
        Usual::new(Arc::new(limits))
    }

    /// Feeds the values, and returns how many of them jump.
    fn jumps(usual: &mut Usual, values: impl IntoIterator<Item = f64>) -> usize {
        let jumps = |x: f64| {
            let time = Time::from_nanos(usual.time.nanos().max(0) + 10_000_000);
            let mut values = [0.0; MAX_CHANNELS];
            values[0] = x;
            usual.tick(time);
            let jumping = usual.jumping(&values) != 0;
            usual.learn(&values, time, true);
            jumping
        };
        values.into_iter().map(jumps).filter(|jumps| *jumps).count()
    }

    /// One step of the quantisation in 150 samples: the mean second difference is 4/150 of a step,
    /// and a step bends the line by 2 steps, 75 times as much. In the second half a text with 8
    /// digits rounds each value.
    #[test]
    fn a_step_of_a_quiet_quantised_sensor_is_no_jump() {
        let quantised = |k: usize| f64::from(u8::from(k % 150 == 149)) - 9.8;
        let rounded = move |k: usize| quantised(k) + 1e-8 * (k % 3) as f64;
        let mut usual = usual();
        assert_eq!(jumps(&mut usual, (0..6000).map(quantised)), 0);
        assert_eq!(jumps(&mut usual, (6000..12_000).map(rounded)), 0);
        assert_eq!(jumps(&mut usual, [40.0]), 1, "40 steps are a jump");
    }

    #[test]
    fn a_jump_of_60_sigma_of_white_noise_is_found_and_one_of_20_is_not() {
        // the sum of 12 uniform numbers has the variance 1; the sequence is a linear congruence
        let mut seed = 1_u64;
        let mut uniform = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut noise = std::iter::repeat_with(|| (0..12).map(|_| uniform()).sum::<f64>() - 6.0);
        let mut usual = usual();
        assert_eq!(jumps(&mut usual, noise.by_ref().take(5000)), 0);
        // sqrt(6) sigma times sqrt(2/pi)
        assert!((usual.rough[0] / 1.95 - 1.0).abs() < 0.15, "{}", usual.rough[0]);
        assert_eq!(jumps(&mut usual.clone(), [20.0]), 0);
        assert_eq!(jumps(&mut usual, [60.0]), 1);
    }

    /// Ticks at that interval, in seconds, and returns the least jump.
    fn least(usual: &mut Usual, interval: f64, ticks: u32) -> f64 {
        for _ in 0..ticks {
            let now = usual.time.nanos().max(0) + (interval * 1e9).round() as i64;
            usual.tick(Time::from_nanos(now));
            usual.count += 1;
        }
        usual.least[0]
    }

    /// The noise of one sample is its density over the root of the interval. The limits change
    /// where the interval changes by 0.1 % in one step of 1/64 of the difference: they stay within
    /// 6.4 % of the interval, or 3.2 % of its root.
    #[test]
    fn the_least_jump_is_50_sigma_of_one_sample_and_25_steps_at_any_rate() {
        let of = |integrals: bool| {
            let limits =
                ChannelLimits { range: 1e9, change: None, noise: 1e-4, step: 1e-5, motion: 0.0 };
            let channels = vec![limits];
            Usual::new(Arc::new(Screening { channels, integrals, frozen: None, max_bridge: 1.0 }))
        };
        for interval in [0.0005_f64, 0.01, 1.0] {
            let expected = 50.0 * 1e-4 / interval.sqrt() + 25.0 * 1e-5;
            let rate = least(&mut of(false), interval, 2);
            assert!((rate / expected - 1.0).abs() < 1e-12, "{interval}: {rate}");
            // an increment is the rate times the interval
            let increment = least(&mut of(true), interval, 2);
            assert!((increment / (expected * interval) - 1.0).abs() < 1e-12, "{interval}");
        }
        let mut usual = of(false);
        least(&mut usual, 0.01, 20);
        let (found, expected) = (least(&mut usual, 0.005, 500), 50.0 * 1e-4 / 0.005_f64.sqrt());
        assert!((found / (expected + 25.0 * 1e-5) - 1.0).abs() < 0.035, "{found}");
    }

    /// The first 16 samples have equal weights. After those the mean keeps 15/16 of itself at each
    /// sample. A repetition leaves it.
    #[test]
    fn the_recent_mean_is_that_of_16_samples_and_fades_after() {
        let mut usual = usual();
        jumps(&mut usual, (1..=16).map(f64::from));
        assert!((usual.mean[0] - 8.5).abs() < 1e-12, "{}", usual.mean[0]);
        jumps(&mut usual, [0.0; 4]);
        let faded = 8.5 * (15.0_f64 / 16.0).powi(4);
        assert!((usual.mean[0] - faded).abs() < 1e-12, "{}", usual.mean[0]);
        usual.learn(&[0.0; MAX_CHANNELS], usual.time, false);
        assert!((usual.mean[0] - faded).abs() < 1e-12, "{}", usual.mean[0]);
    }

    /// Equal second differences of 3 have a roughness of `3 g` with `g = 2/pi`. With half of the
    /// weight, one of `8 * 3 g` makes it `g (9 + (24 g)^2) / (3 + 24 g)`.
    #[test]
    fn one_large_second_difference_counts_as_8_times_the_roughness() {
        let mut usual = usual();
        usual.roughen(0, 3.0, 1.0);
        assert!((usual.rough[0] - 3.0 * GAUSSIAN).abs() < 1e-15, "{}", usual.rough[0]);
        usual.count = WARM + 1;
        usual.roughen(0, 1e9, 0.5);
        let most = 24.0 * GAUSSIAN;
        let expected = GAUSSIAN * (9.0 + most * most) / (3.0 + most);
        assert!((usual.rough[0] - expected).abs() < 1e-13, "{} {expected}", usual.rough[0]);
    }
}
