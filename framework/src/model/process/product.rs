//! The product of two errors that the linear model of a process neglects.

use std::ops::Range;

/// Part of the integrated noise from which the integrated product matters: the estimates of the
/// filter are then off by this part of their sigma, and their NEES is larger by its square, 6 %.
const MATTERS: f64 = 0.25;

/// A rate that the linear model of a process neglects: the product of two errors, such as of a tilt
/// and the bias of a gyro.
///
/// With the 1-sigma `a` and `b` of the two errors, the neglected rate integrates to `a b t`, and the
/// white noise of density `n`, which hides it, to `n sqrt(t)`. The ratio `a b sqrt(t) / n` grows as
/// long as the errors stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Product {
    /// Columns of either error in the error state, SI.
    pub errors: [Range<usize>; 2],
    /// Columns that act as the first error once the vehicle moves, such as those of the heading.
    pub moving: Range<usize>,
    /// Root spectral density of the white noise of the rate, SI per sqrt(Hz).
    pub noise: f64,
}

impl Product {
    /// Computes `a b / n`, 1/sqrt(s), with the largest 1-sigma of either error. Without noise there
    /// is nothing to compare with, and the weight is zero.
    pub(crate) fn weight(&self, variance: impl Fn(usize) -> f64) -> f64 {
        self.weight_of(self.errors[0].clone(), variance)
    }

    /// Computes the same for a vehicle that moves.
    pub(crate) fn weight_moving(&self, variance: impl Fn(usize) -> f64) -> f64 {
        self.weight_of(self.errors[0].clone().chain(self.moving.clone()), variance)
    }

    fn weight_of(
        &self,
        first: impl Iterator<Item = usize>,
        variance: impl Fn(usize) -> f64,
    ) -> f64 {
        let a = first.map(&variance).fold(0.0, f64::max);
        let b = self.errors[1].clone().map(&variance).fold(0.0, f64::max);
        if self.noise > 0.0 { (a * b).sqrt() / self.noise } else { 0.0 }
    }

    /// Returns `true` if a product of that weight matters after `seconds`.
    pub(crate) fn matters(weight: f64, seconds: f64) -> bool {
        weight * seconds.sqrt() > MATTERS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 deg of tilt and 0.1 deg/s turn an axis by 0.0017 deg/s; 0.3 deg/sqrt(h) hides that for less
    /// than a second.
    #[test]
    fn a_product_matters_once_it_has_turned_the_axes_by_a_quarter_of_the_noise() {
        let product = Product { errors: [1..3, 3..5], moving: 0..1, noise: 0.005 };
        let variances = [9.0, 0.01, 0.04, 0.0025, 0.0001];
        let weight = product.weight(|i| variances[i]);
        assert!((weight - 0.2 * 0.05 / 0.005).abs() < 1e-12, "{weight}");
        let moving = product.weight_moving(|i| variances[i]);
        assert!((moving - 3.0 * 0.05 / 0.005).abs() < 1e-12, "{moving}");
        assert!(!Product::matters(weight, 0.0156) && Product::matters(weight, 0.0157));
        assert_eq!(Product { noise: 0.0, ..product }.weight(|i| variances[i]), 0.0);
    }
}
