//! Bands of sums of squared Gaussian variables, and moments after a gate.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, DiscreteCDF, Normal, Poisson};

/// A two-sided band.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// Lower limit.
    pub low: f64,
    /// Upper limit.
    pub high: f64,
}

impl Band {
    /// Returns `true` if a value is inside the band.
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// Returns the band that contains a sum of squared Gaussian variables with probability `1 - alpha`.
///
/// The sum has the distribution `s chi^2(n)` with `s = variance / (2 expectation)` and `n =
/// expectation / s`, which has the given mean and variance. The band is exact for a sum of
/// chi-square variables (`variance = 2 expectation`, `s = 1`); otherwise it is the approximation
/// with the same two moments.
pub fn band(expectation: f64, variance: f64, alpha: f64) -> Band {
    let scale = variance / (2.0 * expectation);
    let Ok(chi) = ChiSquared::new(expectation / scale) else {
        return Band { low: f64::NAN, high: f64::NAN };
    };
    Band {
        low: scale * chi.inverse_cdf(0.5 * alpha),
        high: scale * chi.inverse_cdf(1.0 - 0.5 * alpha),
    }
}

/// Returns the probability that such a sum deviates from its expectation by more, in either
/// direction: the smallest `alpha` whose [`band`] does not hold the sum. Zero for a sum that is not
/// finite.
pub fn probability(sum: f64, expectation: f64, variance: f64) -> f64 {
    let scale = variance / (2.0 * expectation);
    match ChiSquared::new(expectation / scale) {
        Ok(chi) if sum.is_finite() => 2.0 * chi.cdf(sum / scale).min(chi.sf(sum / scale)),
        _ => 0.0,
    }
}

/// Returns `true` if a sum is outside that band. It evaluates the distribution once, which is much
/// cheaper than the two inverse distributions of [`band`].
pub fn outside(sum: f64, expectation: f64, variance: f64, alpha: f64) -> bool {
    probability(sum, expectation, variance) < alpha
}

/// Returns the number of sigmas that a Gaussian variable exceeds, in one direction, with this
/// probability.
pub fn sigmas(probability: f64) -> f64 {
    // from the lower tail, which keeps its digits: 1 - p is 1 for p below 1e-16
    -Normal::standard().inverse_cdf(probability)
}

/// Returns the probability that a Gaussian variable exceeds this number of sigmas in either
/// direction.
pub fn beyond(sigmas: f64) -> f64 {
    2.0 * Normal::standard().cdf(-sigmas.abs())
}

/// Returns expectation and variance of a chi-square variable with `m` degrees of freedom that a
/// gate truncates at `threshold`, which may be infinite. A gate removes the largest NIS, so the
/// mean NIS of a consistent filter is below `m`.
pub fn gated_moments(m: usize, threshold: f64) -> (f64, f64) {
    let m_real = m as f64;
    let cdf = |freedom: f64| match ChiSquared::new(freedom) {
        Ok(chi) if threshold.is_finite() => chi.cdf(threshold),
        _ => 1.0,
    };
    // truncated moments: E[x^j | x < g] = m (m + 2) ... (m + 2 j - 2) F_{m + 2 j}(g) / F_m(g)
    let passed = cdf(m_real);
    let mean = m_real * cdf(m_real + 2.0) / passed;
    let square = m_real * (m_real + 2.0) * cdf(m_real + 4.0) / passed;
    (mean, square - mean * mean)
}

/// Returns the probability that a chi-square variable with `m` degrees of freedom exceeds a
/// threshold: the share of good samples that a gate rejects.
pub fn above(m: usize, threshold: f64) -> f64 {
    match ChiSquared::new(m as f64) {
        Ok(chi) if threshold.is_finite() => chi.sf(threshold),
        _ => 0.0,
    }
}

/// Returns the probability of at least `count` rare events where `expected` are expected.
pub fn poisson_tail(count: u64, expected: f64) -> f64 {
    match (count, Poisson::new(expected)) {
        (0, _) => 1.0,
        (_, Ok(poisson)) => poisson.sf(count - 1),
        (_, Err(_)) => 0.0, // none is expected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    #[test]
    fn the_band_of_a_mean_of_100_runs_of_19_states_agrees_with_tables() {
        let b = band(1900.0, 3800.0, 0.05);
        // chi-square quantiles of 1900 degrees of freedom: 1781.1 and 2022.7
        assert!(
            (b.low / 100.0 - 17.81).abs() < 0.005 && (b.high / 100.0 - 20.23).abs() < 0.005,
            "{b:?}"
        );
    }

    #[test]
    fn the_band_of_one_chi_square_variable_is_exact() {
        // quantiles of 3 degrees of freedom: 0.2158 and 9.3484
        let b = band(3.0, 6.0, 0.05);
        assert!((b.low - 0.2158).abs() < 1e-4 && (b.high - 9.3484).abs() < 1e-4, "{b:?}");
    }

    #[test]
    fn a_value_inside_the_band_is_not_outside() {
        for (expectation, variance, alpha) in
            [(300.0, 600.0, 0.05), (3.0, 6.0, 1e-5), (2.4e4, 3.7e4, 1e-3)]
        {
            let b = band(expectation, variance, alpha);
            for (value, out) in [(b.low, -1.0), (b.high, 1.0)] {
                assert!(outside(value * (1.0 + 1e-3 * out), expectation, variance, alpha), "{b:?}");
                assert!(
                    !outside(value * (1.0 - 1e-3 * out), expectation, variance, alpha),
                    "{b:?}"
                );
            }
        }
        assert!(outside(f64::INFINITY, 3.0, 6.0, 0.05) && outside(f64::NAN, 3.0, 6.0, 0.05));
    }

    #[test]
    fn sigmas_of_small_probabilities_agree_with_tables() {
        // one-sided tails of the standard normal distribution
        for (p, z) in [(0.158_655, 1.0), (1.349_898e-3, 3.0), (9.865_876e-10, 6.0)] {
            assert!((sigmas(p) - z).abs() < 1e-5, "{p}: {}", sigmas(p));
            assert!((beyond(z) / (2.0 * p) - 1.0).abs() < 1e-5, "{z}: {}", beyond(z));
        }
    }

    #[test]
    fn gated_moments_agree_with_sampling() {
        let mut random = Random::new(1, "gate");
        for (m, threshold) in [(3_usize, 2.366), (3, 16.27), (1, 3.84), (4, f64::INFINITY)] {
            let draws = (0..400_000).map(|_| (0..m).map(|_| random.normal().powi(2)).sum::<f64>());
            let passed: Vec<f64> = draws.filter(|x| *x <= threshold).collect();
            let n = passed.len() as f64;
            let mean = passed.iter().sum::<f64>() / n;
            let variance = passed.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
            let (expected, spread) = gated_moments(m, threshold);
            // 4 sigma of the mean; the variance of 200 000 draws or more is accurate to 2 %
            assert!(
                (mean - expected).abs() < 4.0 * (spread / n).sqrt(),
                "{m} {threshold}: {mean} {expected}"
            );
            assert!((variance / spread - 1.0).abs() < 0.02, "{m} {threshold}: {variance} {spread}");
        }
    }

    /// The smallest level whose band does not hold a sum: the band of that level ends at the sum.
    #[test]
    fn the_probability_of_a_sum_is_the_level_of_the_band_that_ends_there() {
        for (expectation, variance, alpha) in [(3.0, 6.0, 0.05), (2.4, 7.1, 1e-3)] {
            let b = band(expectation, variance, alpha);
            for sum in [b.low, b.high] {
                let p = probability(sum, expectation, variance);
                assert!((p / alpha - 1.0).abs() < 1e-6, "{sum}: {p}");
                assert!(b.holds(sum));
            }
            assert!(!b.holds(0.99 * b.low) && !b.holds(1.01 * b.high));
        }
        assert_eq!(probability(f64::INFINITY, 3.0, 6.0), 0.0);
    }

    /// With two degrees of freedom the tail is `exp(-x / 2)`; of rare events the tail is 1 less the
    /// sum of `exp(-l) l^k / k!`.
    #[test]
    fn tails_agree_with_their_closed_forms() {
        assert!((above(2, 5.0) - (-2.5_f64).exp()).abs() < 1e-12);
        assert_eq!(above(2, f64::INFINITY), 0.0);
        let l = 1.7_f64;
        let below = (-l).exp() * (1.0 + l + 0.5 * l * l);
        assert!((poisson_tail(3, l) - (1.0 - below)).abs() < 1e-12);
        assert_eq!(poisson_tail(0, l), 1.0);
        assert_eq!((poisson_tail(0, 0.0), poisson_tail(1, 0.0)), (1.0, 0.0), "none is expected");
    }
}
