//! Noise of the innovations of a sensor, which widens all scores alike where it is larger than stated.

use crate::checkpoint::saved;
use crate::units::sample::MAX_CHANNELS;

/// Changes from sample to sample that determine the noise at first, and the memory in samples.
const FIRST: f64 = 5.0;
const MEMORY: f64 = 200.0;
/// Largest square of a sample in units of the mean so far: an outlier is no noise.
const WILD: f64 = 9.0;
/// Least mean square that is followed.
const LEAST: f64 = 0.1;

/// Mean square of half the change of the whitened innovations from one sample to the next (von Neumann 1941).
/// An error that lasts is not in it, since it is in both samples. Such an error is in the mean square, which
/// widens scores by three at most: the model of the sensor is wrong, and no score of it is exact.
#[derive(Clone)]
pub(super) struct Spread {
    present: u16,
    before: [f64; MAX_CHANNELS],
    count: f64,
    square: f64,
    /// Mean square of the innovations themselves, of which none counts more than [`WILD`].
    mean: f64,
}

saved!(Spread { present, before, count, square, mean });

impl Default for Spread {
    fn default() -> Self {
        Self { present: 0, before: [0.0; MAX_CHANNELS], count: 0.0, square: LEAST, mean: 1.0 }
    }
}

impl Spread {
    /// Takes the whitened innovation of a sample that has these channels, and returns the weight of the
    /// sample: one over the factor of its variance, if that is above one. The first samples
    /// determine the noise, and have the weight zero.
    pub(super) fn take(&mut self, present: u16, white: &[f64]) -> f64 {
        if self.present == present {
            let changes = white.iter().zip(&self.before).map(|(now, before)| now - before);
            let square = changes.map(|d| d * d).sum::<f64>() / (2.0 * white.len() as f64);
            let known = self.count >= FIRST;
            self.count = (self.count + 1.0).min(MEMORY);
            let wild = if known { WILD * self.square } else { f64::INFINITY };
            self.square += (square.min(wild) - self.square) / self.count;
            self.square = self.square.max(LEAST);
        }
        let square = white.iter().map(|y| y * y).sum::<f64>() / white.len() as f64;
        self.mean += (square.min(WILD) - self.mean) / MEMORY;
        self.present = present;
        self.before[..white.len()].copy_from_slice(white);
        if self.count < FIRST { 0.0 } else { 1.0 / self.square.max(self.mean).max(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights(sizes: impl IntoIterator<Item = f64>) -> Vec<f64> {
        let mut spread = Spread::default();
        sizes.into_iter().map(|size| spread.take(1, &[size])).collect()
    }

    /// Alternating innovations of the size 4 differ by 8 from sample to sample: the mean square is 64 / 2.
    #[test]
    fn a_noise_above_the_stated_one_is_known_after_six_samples() {
        let weights = weights([4.0, -4.0].repeat(10));
        assert_eq!(weights[..5], [0.0; 5]);
        assert!(weights[5..].iter().all(|weight| *weight == 1.0 / 32.0), "{weights:?}");
    }

    #[test]
    fn an_error_that_lasts_widens_scores_by_three_at_most() {
        let weights = weights([50.0; 2000]);
        assert!(weights[5..].iter().all(|weight| (1.0 / 9.0..=1.0).contains(weight)));
    }

    /// The mean square of changes of one is a half. An outlier counts nine times the mean, whatever its size, in both
    /// of its changes: 0.5 (1 + 8 / 101) (1 + 8 / 102) is below one.
    #[test]
    fn an_outlier_is_no_noise() {
        let sizes = (0..100).map(|k| f64::from(k % 2)).chain([1000.0, 0.0]);
        // and the mean square grows by 9 / 200 in place of 1e6 / 200
        assert_eq!(weights(sizes)[101], 1.0);
    }
}
