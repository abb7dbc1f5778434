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
/// widens scores by three at most: the model of the sensor is wrong, and no score of it is exact. A single
/// sample far from the one before it and from the one after it is an outlier, and in neither.
#[derive(Clone)]
pub(super) struct Spread {
    present: u16,
    before: [f64; MAX_CHANNELS],
    /// The newest sample, if it is far from the one before it: the next one decides whether it counts.
    suspect: Option<[f64; MAX_CHANNELS]>,
    count: f64,
    square: f64,
    /// Mean square of the innovations themselves, of which none counts more than [`WILD`].
    mean: f64,
}

saved!(Spread { present, before, suspect, count, square, mean });

impl Default for Spread {
    fn default() -> Self {
        Self {
            present: 0,
            before: [0.0; MAX_CHANNELS],
            suspect: None,
            count: 0.0,
            square: LEAST,
            mean: 1.0,
        }
    }
}

impl Spread {
    /// Takes the whitened innovation of a sample that has these channels, and returns the weight of the
    /// sample: one over the factor of its variance, if that is above one. The first samples
    /// determine the noise, and have the weight zero.
    pub(super) fn take(&mut self, present: u16, white: &[f64]) -> f64 {
        let suspect = self.suspect.take();
        if self.present != present {
            self.present = present;
            self.follow(white);
        } else if self.count >= FIRST
            && self.change(white) > WILD * self.square
            && suspect.is_none()
        {
            let mut held = [0.0; MAX_CHANNELS];
            held[..white.len()].copy_from_slice(white);
            self.suspect = Some(held);
        } else {
            // far from the last sample as the suspect was: the suspect was no single outlier
            if let Some(suspect) = suspect.filter(|_| self.change(white) > WILD * self.square) {
                self.count_change(&suspect[..white.len()]);
            }
            self.count_change(white);
        }
        if self.count < FIRST { 0.0 } else { 1.0 / self.square.max(self.mean).max(1.0) }
    }

    /// Noise in units of the stated variance, where it is larger: an error that grows is not in it.
    pub(super) fn noise(&self) -> f64 {
        self.square.max(1.0)
    }

    /// Mean square of half the change from the last sample that counted.
    fn change(&self, white: &[f64]) -> f64 {
        let changes = white.iter().zip(&self.before).map(|(now, before)| now - before);
        changes.map(|d| d * d).sum::<f64>() / (2.0 * white.len() as f64)
    }

    fn count_change(&mut self, white: &[f64]) {
        let square = self.change(white);
        let wild = if self.count >= FIRST { WILD * self.square } else { f64::INFINITY };
        self.count = (self.count + 1.0).min(MEMORY);
        self.square += (square.min(wild) - self.square) / self.count;
        self.square = self.square.max(LEAST);
        self.follow(white);
    }

    fn follow(&mut self, white: &[f64]) {
        let square = white.iter().map(|y| y * y).sum::<f64>() / white.len() as f64;
        self.mean += (square.min(WILD) - self.mean) / MEMORY;
        self.before[..white.len()].copy_from_slice(white);
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

    /// The mean square of changes of one is a half. The outlier is followed by a sample like those before it.
    #[test]
    fn an_outlier_is_no_noise() {
        let sizes = (0..100).map(|k| f64::from(k % 2)).chain([1000.0, 0.0]);
        assert_eq!(weights(sizes)[101], 1.0);
    }

    /// Innovations of +-0.7 change by 1.4, whose mean square is 1. One outlier in fifty samples of a size
    /// that is clipped at 9 would make it 1.3.
    #[test]
    fn single_outliers_are_no_noise() {
        let half = 0.5f64.sqrt();
        let sizes = (0..1000).map(|k| match k % 50 {
            30 => 1000.0,
            odd if odd % 2 == 1 => half,
            _ => -half,
        });
        assert!(weights(sizes)[5..].iter().all(|weight| *weight > 1.0 - 1e-9));
    }

    /// A noise that becomes ten times as large is no row of outliers: its mean square of 100 is followed.
    #[test]
    fn a_noise_that_grows_is_followed() {
        let sizes =
            (0..300).map(|k| [0.7, -0.7, -0.7, 0.7][k % 4] * if k < 50 { 1.0 } else { 10.0 });
        assert!(weights(sizes)[299] < 1.0 / 20.0);
    }
}
