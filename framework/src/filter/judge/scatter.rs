//! Noise that is stated far too small, from all samples, used or refused.
//!
//! A filter that trusts a sensor too much refuses most of its samples, and those that pass show nothing.
//! Between two samples a channel changes by `m`, where the filter predicts `p`, whether it uses them or
//! not. The noise `v` is in the difference `d` of both, beside the error `q` of the prediction:
//! ```text
//! d_k = m_k - p_k = v_k - v_(k-1) + q_k
//! s^2 = median d^2 / (2 R 0.455),      rho = sum d_k d_(k-1) / sum d_k^2
//! ```
//! `0.455` is the median of chi-square with one degree of freedom, so that `s` is the factor of the
//! stated sigma where `q` is small. Noise alone has `rho = -1/2`, since each `v` is in two differences
//! with opposite signs. A process noise that is too small leaves them independent, and a wrong unit, a
//! lag or an error of the filter goes on, so that `rho` is positive. The median resists outliers;
//! in `rho` they are limited to three sigma.

use crate::checkpoint::saved;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::state::covariance::Update;
use crate::units::sample::{MAX_CHANNELS, channels};
use crate::units::time::Time;

/// Median of chi-square with one degree of freedom.
const MEDIAN: f64 = 0.455;
/// Number of differences that are kept.
const KEPT: usize = 127;
/// Largest `rho` of noise. With 127 differences its sigma is 0.06 for noise, at -1/2, and 0.09 for a process
/// noise, at 0 (Bartlett): 2.4 and 3.9 sigma.
const NOISE: f64 = -0.35;
/// Number of differences that a group needs once the noise of another group is found.
const BESIDE: usize = KEPT / 3;
/// Number of differences from which on a larger noise is suspected: `rho` is then good to 0.13 for noise, and 0.18
/// for a process noise.
const SUSPECTED: usize = 30;
/// Limit of a difference in `rho`, in its sigma.
const LIMIT: f64 = 3.0;
/// Least factor of the stated variance that is found: twice the stated sigma, from which on a result
/// must not be used.
const LEAST: f64 = 4.0;
/// Share of refused samples from which on the noise is of interest: a gate of 99.9 % refuses as many samples
/// of one channel with twice the stated noise.
const REFUSED: f64 = 0.1;
/// Weight of the last sample in that share.
const WEIGHT: f64 = 0.05;

/// Differences of one group of channels, in units of the stated sigma, each with the one before.
#[derive(Clone, Debug)]
struct Differences {
    pairs: Vec<[f64; 2]>,
    next: usize,
}

saved!(Differences { pairs, next });

impl Differences {
    fn new() -> Self {
        Self { pairs: Vec::with_capacity(KEPT), next: 0 }
    }

    fn add(&mut self, pair: [f64; 2]) {
        if self.pairs.len() < KEPT {
            self.pairs.push(pair);
        } else {
            self.pairs[self.next] = pair;
            self.next = (self.next + 1) % KEPT;
        }
    }

    /// `s^2`, where there are so many differences and `rho` is that of noise.
    fn factor(&self, least: usize) -> Option<f64> {
        let n = self.pairs.len();
        if n < least {
            return None;
        }
        let mut squares = [0.0; KEPT];
        self.pairs.iter().zip(&mut squares).for_each(|([now, _], square)| *square = now * now);
        squares[..n].sort_by(f64::total_cmp);
        let variance = squares[n / 2] / MEDIAN;
        let limit = LIMIT * variance.sqrt();
        let limited = self.pairs.iter().map(|pair| pair.map(|d| d.clamp(-limit, limit)));
        let (product, square) = limited.fold((0.0, 0.0), |(product, square), [d, before]| {
            (product + d * before, square + d * d)
        });
        (product < NOISE * square).then_some(variance / 2.0)
    }
}

/// Scatter of the channels of one sensor.
#[derive(Clone, Debug)]
pub(in crate::filter) struct Scatter {
    groups: Vec<u16>,
    /// Difference of the last sample, by channel; NaN where there is none.
    last: [f64; MAX_CHANNELS],
    /// Channels of the last sample, one bit each.
    before: u16,
    differences: Vec<Differences>,
    refused: f64,
    /// Factors of the stated variances.
    variance: [f64; MAX_CHANNELS],
    /// Set once a factor is not one.
    widened: bool,
}

saved!(Scatter {
    last, before, refused, variance, widened,
} each { differences } except { groups });

/// A noise that is stated too small: the channels, and the factor of their sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::filter) struct Excess {
    channels: u16,
    factor: f64,
}

impl Excess {
    /// The factor of the variance.
    pub(in crate::filter) fn variance(&self) -> f64 {
        self.factor * self.factor
    }

    /// Finding about the sensor whose noise is stated too small.
    pub(in crate::filter) fn finding(&self, time: Time, sensor: &SensorInfo) -> Finding {
        let names: Vec<String> = channels(self.channels).map(|c| sensor.words(c)).collect();
        let (names, factor) = (names.join(", "), self.factor);
        Finding {
            time,
            about: sensor.name.clone(),
            severity: Severity::Contained,
            basis: Basis::Explanation,
            text: format!(
                "the stated accuracy is too small by {factor:.1}: the samples of {names}, used or \
                 refused, scatter by that many times their noise; the filter takes the wider noise from \
                 now on, and follows the innovations"
            ),
            remedy: format!(
                "state a noise {factor:.1} times as large; where the receiver reports its accuracy, use \
                 accuracy_factor, or accuracy_floor if only the best accuracies are too small"
            ),
        }
    }
}

/// Rows of an update, each with its channel.
fn rows(update: &Update, present: u16) -> impl Iterator<Item = (usize, usize)> + Clone + use<> {
    channels(present).enumerate().take(update.m)
}

impl Scatter {
    pub(in crate::filter) fn new(groups: &[u16]) -> Self {
        Self {
            groups: groups.to_vec(),
            last: [f64::NAN; MAX_CHANNELS],
            before: 0,
            differences: groups.iter().map(|_| Differences::new()).collect(),
            refused: 0.0,
            variance: [1.0; MAX_CHANNELS],
            widened: false,
        }
    }

    /// Widens the stated noise by what has been found.
    pub(in crate::filter) fn widen(&self, update: &mut Update, present: u16) {
        if self.widened {
            scale(update, present, &self.variance);
        }
    }

    /// Takes a sample, with the innovations that the correction by the one before has left, and
    /// whether the gate refuses it. Call after [`Update::innovate`].
    pub(in crate::filter) fn take(
        &mut self,
        update: &Update,
        present: u16,
        left: &[f64; MAX_CHANNELS],
        refused: bool,
    ) {
        self.refused += WEIGHT * (f64::from(u8::from(refused)) - self.refused);
        for (a, c) in rows(update, present) {
            let known = self.before >> c & 1 == 1;
            let difference = (update.innovation[a] - left[c]) / update.r[a * update.m + a].sqrt();
            let now = if known { difference } else { f64::NAN };
            let pair = [now, std::mem::replace(&mut self.last[c], now)];
            let group = self.groups.iter().position(|group| group >> c & 1 == 1);
            if let Some(group) = group.filter(|_| pair.iter().all(|d| d.is_finite())) {
                self.differences[group].add(pair);
            }
        }
        self.before = present;
    }

    /// Returns `true` while the samples scatter as a larger noise does, before their number suffices to say so.
    pub(in crate::filter) fn suspects(&self) -> bool {
        let large = |seen: &Differences| seen.factor(SUSPECTED).is_some_and(|f| f >= LEAST);
        self.refused >= REFUSED && self.differences.iter().any(large)
    }

    /// The largest excess, where the gate refuses enough samples and the noise of one
    /// group is above the stated one by more than a factor of the variance. The noise of each group
    /// becomes that of its samples, and the one of this update with it.
    pub(in crate::filter) fn excess(
        &mut self,
        update: &mut Update,
        present: u16,
        above: f64,
    ) -> Option<Excess> {
        if self.refused < REFUSED {
            return None;
        }
        let groups = self.groups.iter().zip(&self.differences);
        let factors = |least: usize| {
            groups.clone().filter_map(move |(group, seen)| Some((*group, seen.factor(least)?)))
        };
        let (worst, most) = factors(KEPT).max_by(|a, b| a.1.total_cmp(&b.1))?;
        if most < LEAST.max(above) {
            return None;
        }
        let mut grown = [1.0; MAX_CHANNELS];
        for (group, factor) in factors(BESIDE) {
            channels(group).for_each(|channel| grown[channel] = factor.max(1.0));
        }
        scale(update, present, &grown);
        self.variance.iter_mut().zip(grown).for_each(|(variance, grown)| *variance *= grown);
        self.widened = true;
        self.differences.iter_mut().for_each(|seen| *seen = Differences::new());
        self.refused = 0.0;
        Some(Excess { channels: worst, factor: most.sqrt() })
    }
}

/// Multiplies the variances of the noise by factors, by channel.
fn scale(update: &mut Update, present: u16, factors: &[f64; MAX_CHANNELS]) {
    let m = update.m;
    for (a, row) in rows(update, present) {
        for (b, column) in rows(update, present) {
            update.r[a * m + b] *= (factors[row] * factors[column]).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    /// The factor that is found within 300 refused samples of three channels, for a noise of `sigma` times
    /// the stated one. Each channel of the filter is off by `error`, in stated sigmas.
    fn found(seed: u64, sigma: f64, mut error: impl FnMut(usize) -> f64) -> Option<f64> {
        let mut scatter = Scatter::new(&[0b111]);
        let mut random = Random::new(seed, "scatter");
        let mut left = [0.0; MAX_CHANNELS];
        (0..300).find_map(|k| {
            let mut update = Update::with_capacity(1, 3);
            update.m = 3;
            update.r.extend([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
            update.innovation.extend((0..3).map(|_| error(k) + sigma * random.normal()));
            scatter.take(&update, 0b111, &left, true);
            left[..3].copy_from_slice(&update.innovation);
            scatter.excess(&mut update, 0b111, 0.0).map(|excess| excess.factor)
        })
    }

    /// The median of 127 squares is good to some 15 %, more where neighbours share samples, and its root to
    /// 10 %; of 400 runs, the largest departure is a factor of 1.5.
    #[test]
    fn a_noise_that_is_far_too_small_is_found_with_its_size() {
        for (seed, sigma) in (0..30).zip([3.3, 5.0, 30.0].into_iter().cycle()) {
            let found = found(seed, sigma, |k| 0.3 * k as f64).unwrap_or_default();
            assert!((found / sigma).ln().abs() < 0.45, "{seed}: {found} of {sigma}");
        }
    }

    /// Of 127 samples that differ by three times their noise, 100 are enough for a suspicion, and 20 are not.
    #[test]
    fn a_noise_is_suspected_before_it_is_certain() {
        let suspected = |count: usize, sigma: f64| {
            let (mut scatter, mut random) = (Scatter::new(&[0b1]), Random::new(5, "scatter"));
            let (mut update, mut left) = (Update::with_capacity(1, 1), [0.0; MAX_CHANNELS]);
            for _ in 0..count {
                (update.m, update.r) = (1, vec![1.0]);
                update.innovation = vec![sigma * random.normal()];
                scatter.take(&update, 1, &left, update.innovation[0].abs() > 3.3);
                left[0] = update.innovation[0];
            }
            scatter.suspects()
        };
        assert!(suspected(100, 3.0));
        assert!(!suspected(20, 3.0) && !suspected(100, 1.0));
    }

    /// A jump, a drift, and a motion in another unit, as of a depth in feet.
    #[test]
    fn errors_that_last_are_no_noise() {
        for seed in 0..30 {
            assert_eq!(found(seed, 1.0, |_| 1000.0), None);
            assert_eq!(found(seed, 1.0, |k| 5.0 * k as f64), None);
            assert_eq!(found(seed, 1.0, |k| 1000.0 * (k as f64 / 20.0).sin()), None);
            assert_eq!(found(seed, 1.0, |k| if k < 100 { 0.0 } else { 1e6 }), None);
        }
    }

    /// Noise of twice the stated sigma beside a jump by 40 of them: the noise does not explain the jump.
    #[test]
    fn a_noise_does_not_explain_a_jump() {
        let found = |jump| {
            let mut scatter = Scatter::new(&[0b1]);
            let (mut random, mut left) = (Random::new(3, "scatter"), [0.0; MAX_CHANNELS]);
            let mut update = Update::with_capacity(1, 1);
            (0..300).find_map(|k| {
                (update.m, update.r) = (1, vec![1.0]);
                let error = if k < 10 { 0.0 } else { 40.0 };
                update.innovation = vec![error + 2.0 * random.normal()];
                scatter.take(&update, 1, &left, true);
                left[0] = update.innovation[0];
                scatter.excess(&mut update, 1, jump)
            })
        };
        // the gate of one channel is 10.8
        assert_eq!(found(1600.0 / (4.0 * 10.8)), None);
        assert!(found(0.0).is_some());
    }

    /// Walks of the filter's error, of five times the noise in each step.
    #[test]
    fn a_process_noise_that_is_too_small_is_none_of_the_sensor() {
        for seed in 0..8 {
            let (mut random, mut walks, mut calls) = (Random::new(seed, "walk"), [0.0; 3], 0);
            let walk = |_| {
                calls += 1;
                walks[calls % 3] += 5.0 * random.normal();
                walks[calls % 3]
            };
            assert_eq!(found(seed, 1.0, walk), None, "{seed}");
        }
    }

    /// One sample in ten is refused.
    #[test]
    fn outliers_are_no_noise() {
        let mut scatter = Scatter::new(&[0b1]);
        let mut update = Update::with_capacity(1, 1);
        (update.m, update.r) = (1, vec![1.0]);
        for k in 0..1000 {
            let outlier = if k % 20 == 0 { 100.0 } else { -100.0 };
            update.innovation = vec![if k % 10 == 0 { outlier } else { 0.0 }];
            scatter.take(&update, 1, &[0.0; MAX_CHANNELS], k % 10 == 0);
            assert_eq!(scatter.excess(&mut update, 1, 0.0), None);
        }
    }
}
