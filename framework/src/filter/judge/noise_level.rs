//! A level of the noise that follows the innovations.
//!
//! The noise of an acoustic or optical sensor depends on what nobody records: the height above the
//! bottom, its kind, the strength of the echo. The filter then takes `R = l R0`, with the `R0` that
//! the model states. With `y ~ N(0, H P H' + l* R0)` and `S = H P H' + R`,
//! ```text
//! E[y' R^-1 y] = tr(R^-1 S) - m + m l*/l,   so that   q = 1 + (y' R^-1 y - tr(R^-1 S)) / m
//! ```
//! has the mean `l*/l` (innovation-based adaptive estimation: Mehra 1972; Mohamed & Schwarz 1999).
//! The variance of `q` grows with the square of `tr(R^-1 S) / m`, whose inverse is therefore its
//! weight: while the state is uncertain, an innovation says little about the noise. A gate lets the
//! mean square of the innovations that pass be smaller than `S`, by the share of the mean NIS.

use crate::checkpoint::saved;
use crate::model::chi_square::gated_moments;
use crate::state::covariance::{Update, backward, cholesky, forward};
use crate::units::sample::MAX_CHANNELS;

/// Samples over which the level is averaged, and those that the stated noise counts for at the
/// start. The standard deviation of the level is then `sqrt(2 / m / (2 * 500))`: 2.6 % for three
/// channels, 4.5 % for one.
const MEMORY: f64 = 500.0;
const STATED: f64 = 50.0;
/// Least and greatest level: half and twice the stated sigma. Whatever lies beyond is no noise of the
/// sensor as it is stated, and the tests of the innovations find it.
const LEVELS: [f64; 2] = [0.25, 4.0];

/// Level of one sensor's noise, as a multiple of the stated variance.
#[derive(Clone, Copy, Debug)]
pub(in crate::filter) struct NoiseLevel {
    variance: f64,
    weight: f64,
    /// Mean NIS of the samples that pass the gate over its mean without one, by number of channels.
    passing: [f64; MAX_CHANNELS + 1],
}

saved!(NoiseLevel { variance, weight } except { passing });

impl NoiseLevel {
    /// The level of a sensor with these thresholds of its gate, by number of channels.
    pub(in crate::filter) fn new(thresholds: &[f64; MAX_CHANNELS + 1]) -> Self {
        let passing = |m: usize| gated_moments(m, thresholds[m]).0 / m as f64;
        let passing = std::array::from_fn(|m| if m == 0 { 1.0 } else { passing(m) });
        Self { variance: 1.0, weight: STATED, passing }
    }

    /// The level, by which the stated variances are multiplied.
    pub(in crate::filter) fn variance(&self) -> f64 {
        self.variance
    }

    /// Returns `true` if the level is at one of its limits.
    pub(in crate::filter) fn is_at_limit(&self) -> bool {
        // an innovation below the mean moves the level off its limit for a while
        self.variance < 1.05 * LEVELS[0] || self.variance > 0.95 * LEVELS[1]
    }

    /// The noise in words, at the end of a run.
    pub(in crate::filter) fn words(&self) -> String {
        let sigma = self.variance.sqrt();
        let limit =
            if self.is_at_limit() { ", which is at its limit: state another noise" } else { "" };
        format!("its noise followed the innovations to {sigma:.2} times the stated one{limit}")
    }

    /// Takes an innovation that passed the gate, with the noise of this level.
    pub(in crate::filter) fn take(&mut self, update: &Update, lower: &mut Vec<f64>) {
        let m = update.m;
        if m == 0 || !cholesky(&update.r, m, lower) {
            return;
        }
        let mut y = [0.0; MAX_CHANNELS];
        let y = &mut y[..m];
        y.copy_from_slice(&update.innovation[..m]);
        forward(lower, m, y);
        let square: f64 = y.iter().map(|y| y * y).sum();
        let mut trace = 0.0;
        for k in 0..m {
            y.copy_from_slice(&update.s[k * m..][..m]);
            forward(lower, m, y);
            backward(lower, m, y);
            trace += y[k];
        }
        let channels = m as f64;
        let weight = (channels / trace).powi(2);
        if !(weight > 0.0 && square.is_finite()) {
            return;
        }
        self.weight = (self.weight + weight).min(MEMORY);
        let change = weight * (square - self.passing[m] * trace) / channels / self.weight;
        self.variance = (self.variance * (1.0 + change)).clamp(LEVELS[0], LEVELS[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    fn update(innovation: Vec<f64>, r: Vec<f64>, s: Vec<f64>) -> Update {
        let mut update = Update::default();
        update.m = innovation.len();
        (update.innovation, update.r, update.s) = (innovation, r, s);
        update
    }

    /// A level behind no gate.
    fn open() -> NoiseLevel {
        NoiseLevel::new(&[f64::INFINITY; MAX_CHANNELS + 1])
    }

    /// Takes an update of two channels with the stated variances 1 and 4. Both predictions have the
    /// variance `predicted`, and the squares of the innovations are those of the level `truth`.
    fn taken(level: &mut NoiseLevel, predicted: f64, truth: f64) {
        let l = level.variance();
        let r = [l, 0.0, 0.0, 4.0 * l];
        let s = [predicted + l, 0.0, 0.0, predicted + 4.0 * l];
        // innovations with the expected square
        let innovation = vec![(predicted + truth).sqrt(), -(predicted + 4.0 * truth).sqrt()];
        level.take(&update(innovation, r.to_vec(), s.to_vec()), &mut Vec::new());
    }

    #[test]
    fn the_level_becomes_that_of_the_innovations_whatever_the_prediction_is_worth() {
        for (predicted, truth) in [(0.0, 0.5), (0.0, 2.0), (3.0, 0.5), (3.0, 1.0), (3.0, 2.0)] {
            let mut level = open();
            (0..60_000).for_each(|_| taken(&mut level, predicted, truth));
            // where the prediction is worth little, 60 000 innovations count as a thousand
            assert!((level.variance() / truth - 1.0).abs() < 1e-2, "{predicted} {truth} {level:?}");
        }
    }

    /// With the weight 1 / (1 + 1e4)^2, ten thousand innovations count as 1e-4.
    #[test]
    fn an_innovation_of_an_uncertain_state_says_little_about_the_noise() {
        let mut level = open();
        (0..10_000).for_each(|_| taken(&mut level, 1e4, 2.0));
        assert!((level.variance() - 1.0).abs() < 1e-4, "{level:?}");
    }

    #[test]
    fn the_level_stays_between_half_and_twice_the_stated_sigma_and_says_where_it_ends() {
        for (truth, limit, sigma) in [(100.0, 4.0, "2.00"), (0.01, 0.25, "0.50")] {
            let mut level = open();
            (0..5_000).for_each(|_| taken(&mut level, 0.0, truth));
            assert_eq!(level.variance(), limit);
            let text = level.words();
            assert!(level.is_at_limit() && text.contains(&format!("{sigma} times")), "{text}");
        }
        assert!(!open().is_at_limit());
    }

    /// Innovations of one channel, drawn from the noise as it is stated, of which one in ten is gated.
    /// Without the share that passes, the level would sink to its limit; its mean over 100 000 is good
    /// to 1 %, so that 2 % are two sigma.
    #[test]
    fn a_gate_does_not_lower_the_level() {
        let gate = 2.706; // chi-square of one channel, 90 %
        let (mut level, mut random) =
            (NoiseLevel::new(&[gate; MAX_CHANNELS + 1]), Random::new(1, "noise"));
        let (mut sum, count) = (0.0, 100_000);
        for _ in 0..count {
            let (y, l) = (random.normal(), level.variance());
            if y * y <= gate * l {
                level.take(&update(vec![y], vec![l], vec![l]), &mut Vec::new());
            }
            sum += level.variance();
        }
        assert!((sum / f64::from(count) - 1.0).abs() < 0.02, "{}", sum / f64::from(count));
    }

    #[test]
    fn a_sample_without_noise_or_with_nan_changes_nothing() {
        let mut level = open();
        for (y, r, s) in [(1.0, 0.0, 1.0), (f64::NAN, 1.0, 1.0), (1.0, 1.0, f64::NAN)] {
            level.take(&update(vec![y], vec![r], vec![s]), &mut Vec::new());
            assert_eq!(level.variance(), 1.0);
        }
    }
}
