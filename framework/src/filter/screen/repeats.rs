//! Repetitions of the driving sensor's samples, zeros, and values beyond the range.

use crate::checkpoint::saved;
use crate::filter::screen::usual::{lanes, lanes_mut};
use crate::model::process::screening::{Screening, Spread};
use crate::state::magnitude;
use crate::units::sample::MAX_CHANNELS;
use pulp::Simd;
use std::sync::Arc;

/// Probability of a repetition by chance that counts as frozen.
const CHANCE: f64 = 1e-9;
/// Least number of identical samples in a row that counts as frozen.
const FROZEN: f64 = 5.0;
/// Number of identical values in a row after which a single channel counts as stuck.
pub(in crate::filter) const STUCK: u32 = 25;
/// Share of repetitions above which a channel is too coarse to be judged by them.
const COARSE: f64 = 0.02;
/// Weight of one sample in that share.
const SHARE: f64 = 1e-3;
/// Longest repetition of a channel that counts for its share.
const SHORT: u32 = 3;
/// Number of samples before identical samples are judged.
const WARM: u64 = 100;

/// Fault of a sample of the driving sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::filter) enum Fault {
    /// Every channel is exactly zero.
    #[default]
    Zeros,
    /// Channels are beyond their range.
    Range,
    /// Every channel repeats its value.
    Frozen,
    /// Single channels repeat their value.
    Stuck,
}

saved!(
    enum Fault {
        Zeros,
        Range,
        Frozen,
        Stuck,
    }
);

/// Repetitions so far. The channels come first, as in [`crate::filter::screen::usual::Usual`].
#[derive(Clone)]
#[repr(C, align(64))]
pub(in crate::filter) struct Repeats {
    /// Ranges of the channels.
    range: Spread,
    /// Last values as they came.
    pub(in crate::filter) raw: Spread,
    /// Share of repetitions of each channel.
    coarse: Spread,
    limits: Arc<Screening>,
    /// Number of channels.
    n: usize,
    /// Number of samples.
    pub(in crate::filter) samples: u64,
    /// Number of repeated samples: in a row, in total, and in a row for each channel.
    pub(in crate::filter) in_a_row: u32,
    repeated: u32,
    runs: [u32; MAX_CHANNELS],
}

saved!(Repeats { raw, coarse, samples, in_a_row, repeated, runs } except { range, limits, n });

impl Repeats {
    pub(in crate::filter) fn new(limits: Arc<Screening>) -> Self {
        const ZERO: Spread = [0.0; MAX_CHANNELS];
        let mut range = ZERO;
        range.iter_mut().zip(&limits.channels).for_each(|(range, limits)| *range = limits.range);
        Self {
            n: limits.channels.len().min(MAX_CHANNELS),
            range,
            limits,
            raw: ZERO,
            samples: 0,
            in_a_row: 0,
            repeated: 0,
            runs: [0; MAX_CHANNELS],
            coarse: ZERO,
        }
    }

    /// Fault of a sample, by itself or by repetition, with the channels that have it.
    #[inline(always)]
    pub(in crate::filter) fn judge<S: Simd>(
        &mut self,
        simd: S,
        x: &Spread,
        interval: f64,
    ) -> Option<(Fault, u16)> {
        self.samples += 1;
        let unit = if self.limits.integrals { interval } else { 1.0 };
        // a channel without an interval has no limits yet
        let unit = if unit > 0.0 { unit } else { f64::INFINITY };
        if !self.is_plain(simd, x, unit) {
            return self.judge_each(x, unit, interval);
        }
        let share = simd.splat_f64s(-SHARE);
        for coarse in lanes_mut::<S>(&mut self.coarse, self.n) {
            *coarse = simd.add_f64s(*coarse, simd.mul_f64s(*coarse, share));
        }
        self.runs = [0; MAX_CHANNELS];
        self.raw = *x;
        self.in_a_row = 0;
        None
    }

    /// Returns `true` if each channel is within its range and differs from zero and from its last
    /// value.
    #[inline(always)]
    fn is_plain<S: Simd>(&self, simd: S, x: &Spread, unit: f64) -> bool {
        let n = self.n;
        let (x, raw) = (lanes::<S>(x, n), lanes::<S>(&self.raw, n));
        let range = lanes::<S>(&self.range, n);
        let (zero, unit) = (simd.splat_f64s(0.0), simd.splat_f64s(unit));
        let mut any = false;
        for k in 0..x.len() {
            let channels = (n - (k * S::F64_LANES).min(n)).min(S::F64_LANES);
            let channels = simd.mask_between_m64s(0, channels as u64).mask();
            let stays = simd.or_m64s(simd.equal_f64s(x[k], raw[k]), simd.equal_f64s(x[k], zero));
            let beyond = simd.less_than_f64s(simd.mul_f64s(range[k], unit), magnitude(simd, x[k]));
            let suspect = simd.and_m64s(simd.or_m64s(stays, beyond), channels);
            any |= simd.first_true_m64s(suspect) < S::F64_LANES;
        }
        !any && self.samples > 1
    }

    fn judge_each(&mut self, x: &Spread, unit: f64, interval: f64) -> Option<(Fault, u16)> {
        let all = ((1_u32 << self.n) - 1) as u16;
        let (mut zero, mut same, mut beyond, mut long) = (true, self.samples > 1, 0_u16, false);
        for (c, (&x, limits)) in x.iter().zip(&self.limits.channels).enumerate() {
            zero &= x == 0.0;
            beyond |= u16::from(x.abs() > limits.range * unit) << c;
            let again = x == self.raw[c];
            same &= again;
            let run = if again { self.runs[c] + 1 } else { 0 };
            self.runs[c] = run;
            long |= run >= STUCK;
            let coarse = self.coarse[c];
            let target = if again { 1.0 } else { 0.0 };
            self.coarse[c] = if run <= SHORT { coarse + (target - coarse) * SHARE } else { coarse };
        }
        let stuck = if long && self.samples > 1000 { self.stuck() } else { 0 };
        self.raw = *x;
        self.in_a_row = if same { self.in_a_row + 1 } else { 0 };
        if zero {
            return Some((Fault::Zeros, all));
        }
        if beyond != 0 {
            return Some((Fault::Range, beyond));
        }
        if same {
            if self.in_a_row <= FROZEN as u32 {
                self.repeated += 1;
            }
            if self.samples > WARM && f64::from(self.in_a_row) >= self.frozen_after(interval) {
                return Some((Fault::Frozen, all));
            }
        }
        (stuck != 0 && stuck != all).then_some((Fault::Stuck, stuck))
    }

    /// Channels that are stuck.
    #[cold]
    fn stuck(&self) -> u16 {
        let channels = self.runs.iter().zip(&self.coarse).enumerate();
        let stuck = channels.filter(|(_, (run, coarse))| **run >= STUCK && **coarse < COARSE);
        stuck.fold(0, |mask, (c, _)| mask | 1 << c)
    }

    /// Number of identical samples in a row that counts as frozen: as many as chance repeats with
    /// the probability [`CHANCE`].
    fn frozen_after(&self, interval: f64) -> f64 {
        match self.limits.frozen {
            Some(seconds) => (seconds / interval).max(1.0),
            None => {
                let share = f64::from(self.repeated + 1) / (self.samples + 2) as f64;
                (CHANCE.ln() / share.min(0.99).ln()).max(FROZEN)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::process::screening::ChannelLimits;
    use pulp::Scalar;

    impl Repeats {
        fn take(&mut self, x: &Spread, interval: f64) -> Option<(Fault, u16)> {
            self.judge(Scalar::new(), x, interval)
        }
    }

    fn repeats(frozen: Option<f64>, integrals: bool) -> Repeats {
        let channel =
            ChannelLimits { range: 10.0, change: None, noise: 0.0, step: 0.0, motion: 0.0 };
        let channels = vec![channel; 2];
        Repeats::new(Arc::new(Screening { channels, integrals, frozen, max_bridge: 1.0 }))
    }

    fn spread(a: f64, b: f64) -> Spread {
        let mut x = [0.0; MAX_CHANNELS];
        (x[0], x[1]) = (a, b);
        x
    }

    /// Passes samples that never repeat.
    fn warm(repeats: &mut Repeats, samples: u32) {
        for k in 0..samples {
            assert_eq!(
                repeats.take(
                    &spread(f64::from(k) + 1.0, 1.0 / f64::from(k + 1)).map(|x| x % 10.0),
                    0.01
                ),
                None
            );
        }
    }

    #[test]
    fn zeros_and_values_beyond_the_range_are_faults_of_one_sample() {
        let mut rates = repeats(None, false);
        assert_eq!(rates.take(&spread(0.0, 0.0), 0.01), Some((Fault::Zeros, 0b11)));
        assert_eq!(rates.take(&spread(0.0, 10.0), 0.01), None, "the range itself is plausible");
        assert_eq!(rates.take(&spread(1.0, -10.1), 0.01), Some((Fault::Range, 0b10)));
        // increments over 10 ms are a hundredth of the range
        let mut increments = repeats(None, true);
        assert_eq!(increments.take(&spread(0.09, 0.0), 0.01), None);
        assert_eq!(increments.take(&spread(0.11, 0.0), 0.01), Some((Fault::Range, 0b01)));
        assert_eq!(increments.take(&spread(0.11, 0.0), 0.0), None, "no interval, no limit yet");
    }

    #[test]
    fn identical_samples_are_frozen_after_the_given_time_and_not_before_the_100th_sample() {
        let mut repeats = repeats(Some(0.05), false);
        for _ in 0..50 {
            assert_eq!(repeats.take(&spread(1.0, 2.0), 0.01), None);
        }
        warm(&mut repeats, 100);
        let same = spread(3.0, 4.0);
        let found: Vec<_> = (0..7).map(|_| repeats.take(&same, 0.01).map(|f| f.0)).collect();
        // the first is new, and the fifth repetition makes 50 ms
        let frozen = Some(Fault::Frozen);
        assert_eq!(found, [None, None, None, None, None, frozen, frozen]);
        assert_eq!(repeats.take(&spread(3.5, 4.0), 0.01), None);
    }

    /// With a share `p` of repetitions, `n` in a row have the probability `p^n`: 1e-9 at the share
    /// of 0.1 is nine in a row, and never fewer than five count.
    #[test]
    fn an_instrument_that_repeats_by_chance_is_frozen_later() {
        let mut rare = repeats(None, false);
        (rare.repeated, rare.samples) = (0, 100_000);
        assert_eq!(rare.frozen_after(0.01), 5.0);
        let mut coarse = repeats(None, false);
        (coarse.repeated, coarse.samples) = (99, 998);
        assert!((coarse.frozen_after(0.01) - 9.0).abs() < 1e-9);
        (coarse.repeated, coarse.samples) = (998, 998);
        assert!((coarse.frozen_after(0.01) - CHANCE.ln() / 0.99_f64.ln()).abs() < 1e-9);
        assert_eq!(repeats(Some(0.2), false).frozen_after(0.01), 20.0);
        assert_eq!(repeats(Some(0.2), false).frozen_after(1.0), 1.0);
    }

    #[test]
    fn one_channel_that_stands_still_is_stuck_after_25_repetitions() {
        let mut repeats = repeats(None, false);
        warm(&mut repeats, 1000);
        let stuck = Some((Fault::Stuck, 0b10));
        for k in 0..30_u32 {
            let found = repeats.take(&spread(f64::from(k) * 0.1 + 0.05, 7.0), 0.01);
            assert_eq!(found, if k < STUCK { None } else { stuck }, "{k}");
        }
    }

    /// Only repetitions of every channel together count for the share of identical samples, each
    /// pause for five of them at most.
    #[test]
    fn a_pause_counts_for_the_share_of_repetitions_but_not_all_of_it() {
        let mut repeats = repeats(None, false);
        warm(&mut repeats, 20);
        for k in 0..4_u32 {
            repeats.take(&spread(f64::from(k) + 0.5, 3.0), 0.01);
        }
        assert_eq!((repeats.repeated, repeats.in_a_row), (0, 0));
        for k in 1..=8 {
            repeats.take(&spread(3.5, 3.0), 0.01);
            assert_eq!((repeats.repeated, repeats.in_a_row), (k.min(5), k), "{k}");
        }
    }

    /// A value that repeats once in `n` samples has a share that tends to `1 / n`; only the first
    /// three repetitions in a row count, and each sample weighs a thousandth.
    #[test]
    fn the_share_of_repetitions_of_a_channel_is_learnt_over_a_thousand_samples() {
        let mut repeats = repeats(None, false);
        for k in 0..20_000_u32 {
            repeats.take(&spread(f64::from(k) % 9.7, f64::from(k / 2) % 9.9), 0.01);
        }
        assert!((repeats.coarse[1] - 0.5).abs() < 2e-3, "{}", repeats.coarse[1]);
        assert!(repeats.coarse[0] < 1e-3, "{}", repeats.coarse[0]);
        for _ in 0..10 {
            repeats.take(&spread(1.1, 5.05), 0.01);
        }
        // one change, three repetitions, six that do not count
        assert!((repeats.coarse[0] - 3e-3).abs() < 1e-4, "{}", repeats.coarse[0]);
    }

    /// A channel of which more than 2 % repeat is too coarse: after 100 pairs its share is
    /// 1 - exp(-0.1), some 10 %, less as much for the others.
    #[test]
    fn a_coarse_channel_is_not_judged_by_its_repetitions() {
        let mut repeats = repeats(None, false);
        for k in 0..2000_u32 {
            let coarse = f64::from(k / 2 % 7);
            repeats.take(&spread(f64::from(k) % 9.7 + 0.1, coarse), 0.01);
        }
        for k in 0..60_u32 {
            assert_eq!(repeats.take(&spread(f64::from(k) % 9.7 + 0.3, 8.0), 0.01), None, "{k}");
        }
    }

    /// A first sample of zeros has nothing before it that it could repeat.
    #[test]
    fn the_first_sample_is_no_repetition() {
        let mut repeats = repeats(None, false);
        repeats.take(&spread(0.0, 0.0), 0.01);
        assert_eq!(repeats.in_a_row, 0);
        repeats.take(&spread(0.0, 0.0), 0.01);
        assert_eq!(repeats.in_a_row, 1);
    }

    #[test]
    fn a_frozen_sensor_is_found_from_the_101st_sample_on_and_a_stuck_channel_from_the_1001st() {
        let mut frozen = repeats(Some(0.01), false);
        warm(&mut frozen, 98);
        let found = [99, 100, 101].map(|_| frozen.take(&spread(3.5, 4.0), 0.01));
        assert_eq!(found, [None, None, Some((Fault::Frozen, 0b11))]);
        let mut stuck = repeats(None, false);
        warm(&mut stuck, 970);
        for k in 971..1010_u32 {
            let found = stuck.take(&spread(f64::from(k % 7) + 0.5, 7.0), 0.01);
            assert_eq!(found, (k > 1000).then_some((Fault::Stuck, 0b10)), "{k}");
        }
    }

    /// A sensor is frozen after 0.5 s here, 50 samples: no channel is stuck after 25 of those.
    #[test]
    fn channels_that_all_stand_still_are_not_stuck_but_frozen() {
        let mut repeats = repeats(Some(0.5), false);
        warm(&mut repeats, 1000);
        for k in 0..60_u32 {
            let found = repeats.take(&spread(3.5, 4.0), 0.01);
            assert_eq!(found, (k >= 50).then_some((Fault::Frozen, 0b11)), "{k}");
        }
    }
}
