//! Correlation of the innovations that a case explains: how much they count as evidence.
//!
//! The logarithms of likelihoods add up if the innovations are independent. Under a right case they are. Where
//! the model of a vehicle or a sensor is a little off, they stay within their sigma, but keep their sign for
//! seconds, and any case with more freedom is likelier at every sample. With the correlation `r` of successive
//! innovations, `n` of them count as `n (1 - r) / (1 + r)` independent ones (Bartlett 1946).

use crate::checkpoint::saved;
use nalgebra::DVector;

/// Innovations of one sensor under one case, as multiples of their sigma that are independent of each other
/// within a sample.
#[derive(Clone, Default)]
pub(super) struct Whiteness {
    before: Vec<f64>,
    /// Sums of the squares, and of the products with the innovation before.
    squares: f64,
    products: f64,
}

saved!(Whiteness { before, squares, products });

impl Whiteness {
    /// Takes the innovation of a sample, and returns the share of it that is independent of those before. One
    /// sample of its own sigma, without correlation, is known beforehand.
    pub(super) fn take(&mut self, e: &DVector<f64>) -> f64 {
        if self.before.len() == e.len() {
            let pairs = || e.iter().zip(&self.before);
            self.products += pairs().map(|(now, before)| now * before).sum::<f64>();
            self.squares += pairs().map(|(a, b)| 0.5 * (a * a + b * b)).sum::<f64>();
        }
        self.before.clear();
        self.before.extend(e.iter());
        let r = (self.products / (self.squares + e.len() as f64)).max(0.0);
        (1.0 - r) / (1.0 + r)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    /// A first-order Gauss-Markov sequence `e := r e + sqrt(1 - r^2) w` has the correlation `r`. The estimate of
    /// 20 000 products scatters by less than 0.01.
    #[test]
    fn correlated_innovations_count_as_often_as_their_mean_is_known() {
        let mut random = Random::new(7, "whiteness");
        for r in [0.0, 0.5, 0.9] {
            let (mut whiteness, mut e) = (Whiteness::default(), DVector::zeros(2));
            let mut share = f64::NAN;
            for _ in 0..10_000 {
                e.iter_mut().for_each(|e: &mut f64| {
                    *e = r * *e + (1.0 - r * r).sqrt() * random.normal();
                });
                share = whiteness.take(&e);
            }
            let expected = (1.0 - r) / (1.0 + r);
            assert!((share - expected).abs() < 0.03, "{r}: {share} {expected}");
        }
    }

    /// Alternating innovations determine their mean better than independent ones; they count once.
    #[test]
    fn no_innovation_counts_more_than_once_and_a_repeated_one_hardly() {
        let last = |signs: [f64; 2]| {
            let mut whiteness = Whiteness::default();
            let shares = (0..100).map(|k| whiteness.take(&DVector::from_element(1, signs[k % 2])));
            shares.last()
        };
        assert_eq!(last([1.0, -1.0]), Some(1.0));
        // 99 equal pairs beside one sample: r = 99 / 100
        assert!(last([1.0, 1.0]).is_some_and(|share| (share - 0.01 / 1.99).abs() < 1e-12));
    }
}
