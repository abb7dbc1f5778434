//! Sums over the NIS of samples, their distribution in a consistent filter, and their correlation.

use crate::checkpoint::saved;
use crate::model::chi_square::{above, gated_moments};

/// Sums over the NIS of some samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NisSums {
    pub(super) count: u64,
    pub(super) nis: f64,
    pub(super) expected: f64,
    pub(super) variance: f64,
}

saved!(NisSums { count, nis, expected, variance });

/// Distribution of a consistent sample's NIS: its moments if it passes the gate, and the
/// probability that the gate refuses it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chance {
    pub(super) mean: f64,
    pub(super) variance: f64,
    pub(super) gated: f64,
}

impl Chance {
    pub(super) fn of(channels: usize, threshold: f64) -> Self {
        let (mean, variance) = gated_moments(channels, threshold);
        Self { mean, variance, gated: above(channels, threshold) }
    }
}

impl NisSums {
    pub(super) fn add(&mut self, nis: f64, chance: &Chance) {
        self.count += 1;
        self.nis += nis;
        self.expected += chance.mean;
        self.variance += chance.variance;
    }

    /// Ratio of the innovations to their reported sigma.
    pub(super) fn ratio(&self) -> f64 {
        (self.nis / self.expected).sqrt()
    }
}

/// Autocovariance of the normalised NIS at lag 0 and 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    last: Option<f64>,
    sum: f64,
    squares: f64,
    products: f64,
    count: f64,
}

saved!(Memory { last, sum, squares, products, count });

impl Memory {
    pub(super) fn add(&mut self, deviation: f64) {
        if let Some(last) = self.last.replace(deviation) {
            self.products += last * deviation;
        }
        self.sum += deviation;
        self.squares += deviation * deviation;
        self.count += 1.0;
    }

    /// Factor by which correlation enlarges the variance of a mean: `(1 + r) / (1 - r)` with the
    /// correlation `r` of successive values, as for a first-order autoregression. A correlation
    /// within 2 sigma of zero, `2 / sqrt(N)`, is noise. Values that scatter less than expected are
    /// divided by their expected variance, so that they do not widen a band that they narrow.
    pub(super) fn inflation(&self) -> f64 {
        let mean = self.sum / self.count;
        let variance = (self.squares / self.count - mean * mean).max(1.0);
        let r = (self.products / (self.count - 1.0) - mean * mean) / variance;
        // NaN for less than two samples
        if r.is_nan() || r <= 2.0 / self.count.sqrt() {
            return 1.0;
        }
        let r = r.min(0.99);
        (1.0 + r) / (1.0 - r)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inflation for `n` values with this mean, mean square, and mean product of successive ones.
    fn inflation(n: f64, mean: f64, square: f64, product: f64) -> f64 {
        let (sum, squares) = (n * mean, n * square);
        Memory { last: None, sum, squares, products: (n - 1.0) * product, count: n }.inflation()
    }

    /// Ten values have nine pairs. A variance of 2 and a product of 1.4 are the correlation 0.7,
    /// above 2 / sqrt(10) = 0.63, and (1 + 0.7) / (1 - 0.7) = 5.67; 1.26 would be just below.
    #[test]
    fn correlated_values_widen_the_band_of_their_mean_beyond_2_sigma_of_the_correlation() {
        let is = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found}");
        is(inflation(10.0, 0.0, 2.0, 1.4), 1.7 / 0.3);
        is(inflation(10.0, 0.0, 2.0, 1.26), 1.0);
        is(inflation(400.0, 0.0, 1.0, 0.099), 1.0);
        is(inflation(400.0, 0.0, 1.0, 0.101), 1.101 / 0.899);
        is(inflation(400.0, 0.0, 1.0, -0.9), 1.0);
        // the mean is no correlation: (2 - 1) / (3 - 1) = 0.5
        is(inflation(400.0, 1.0, 3.0, 2.0), 3.0);
        // values that scatter less than expected count as if they scattered by one
        is(inflation(400.0, 0.0, 0.5, 0.4), 1.4 / 0.6);
        is(inflation(400.0, 0.0, 1.0, 1.0), 1.99 / 0.01);
        is(Memory::default().inflation(), 1.0);
        is(inflation(1.0, 3.0, 9.0, 0.0), 1.0);
    }

    #[test]
    fn the_memory_sums_values_squares_and_products_of_successive_ones() {
        let mut memory = Memory::default();
        [2.0, -1.0, 3.0].into_iter().for_each(|x| memory.add(x));
        let Memory { sum, squares, products, count, .. } = memory;
        assert_eq!((sum, squares, products, count), (4.0, 14.0, -5.0, 3.0));
    }
}
