//! Covariance that contains an error which has been found.
//!
//! The samples fit an error of the size `a` with the variance `v`, so that the error of the state
//! is `e0 + a s`, where `e0` is that of a filter without it. The error does not end at the finding:
//! `s` goes on growing, and each sample that is wrong in the same way narrows the covariance around
//! a wrong state. So after each sample
//! ```text
//! A s' P^-1 s <= 1,   which is   P >= A s s',        A = a^2 + v
//! ```
//! is restored, where it fails, by `P := P + A s s'`; the left side is then between one half and
//! one. `s` is the whole effect since the start, and not its growth since the last widening:
//! increments of one error add up, where those of white noise would partly cancel.
//!
//! The covariance of `e0` is at most `P`: the same gains correct both, and what is added to `P` is
//! positive. So the mean of the NEES is `tr(P^-1 cov e0) + A s' P^-1 s <= n + 1`, and no state is
//! off by more than its sigma in the mean.

use super::effect::Effect;
use crate::model::finding::Finding;
use crate::state::covariance::{Covariance, cholesky, forward};

/// Widening of the covariance, with the workspace of the test.
#[derive(Clone, Default)]
pub(super) struct Containment {
    p: Vec<f64>,
    lower: Vec<f64>,
    white: Vec<f64>,
    /// Set by each widening.
    pub(super) widened: bool,
    /// Set where an alignment looks for the initial values: until it has found them the state may be
    /// far off, and the effect of an error is not linear.
    searched: bool,
}

impl Containment {
    /// Containment of the errors of a filter whose initial values an alignment looks for, or not.
    pub(super) fn new(searched: bool) -> Self {
        Self { searched, ..Self::default() }
    }

    /// A finding, which states where the covariance contains the error.
    pub(super) fn noted(&self, mut finding: Finding) -> Finding {
        if !self.searched {
            finding.text.push_str("; the covariance contains it from now on");
        }
        finding
    }

    /// Widens the covariance if it does not contain the error of a hypothesis.
    pub(super) fn contain(&mut self, (effect, sum): (&Effect, usize), covariance: &mut Covariance) {
        if self.searched {
            return;
        }
        let Self { p, lower, white, .. } = self;
        let (score, n) = (&effect.scores[sum], covariance.dimension());
        let variance = score.size().powi(2) + score.variance();
        p.clear();
        p.extend(covariance.rows().flatten());
        white.clear();
        white.extend(effect.s.iter().map(|s| s[sum]));
        if !cholesky(p, n, lower) {
            return;
        }
        forward(lower, n, white);
        if variance * white.iter().map(|w| w * w).sum::<f64>() > 1.0 {
            self.widen(covariance, variance, |i| effect.s[i][sum]);
        }
    }

    /// `P = P + a s s'`.
    pub(super) fn widen(&mut self, covariance: &mut Covariance, a: f64, s: impl Fn(usize) -> f64) {
        covariance.widen(a, s);
        self.widened = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::time::Time;

    /// Effect whose first sum has an error of the size 3 with the variance 1/4.
    fn effect(s: [f64; 2]) -> Effect {
        let mut effect = Effect::new(2);
        effect.begin(Time::MIN);
        effect.scores[0].add(12.0, 4.0);
        effect.s.iter_mut().zip(s).for_each(|(row, s)| row[0] = s);
        effect
    }

    fn covariance(p: [f64; 3]) -> Covariance {
        let mut covariance = Covariance::zero(2);
        covariance.set_lower(&p);
        covariance
    }

    fn contained(effect: &Effect, p: [f64; 3]) -> Vec<f64> {
        let (mut covariance, before) = (covariance(p), covariance(p));
        let mut containment = Containment::default();
        containment.contain((effect, 0), &mut covariance);
        assert_eq!(containment.widened, covariance != before);
        covariance.lower().collect()
    }

    /// 9 + 1/4 is the square of the size and its variance.
    #[test]
    fn the_covariance_grows_by_the_error_and_by_what_is_not_known_of_it() {
        assert_eq!(contained(&effect([1.0, -2.0]), [1.0, 0.0, 4.0]), [10.25, -18.5, 41.0]);
    }

    #[test]
    fn a_covariance_that_contains_the_error_stays() {
        let p = [10.25, -18.5, 41.0];
        assert_eq!(contained(&effect([1.0, -2.0]), p), p);
    }

    /// Each state alone is off by 0.3 of its sigma, the difference of both by 0.6 of 0.2.
    #[test]
    fn an_error_across_correlated_states_is_not_contained_by_their_sigmas() {
        let p = contained(&effect([0.1, -0.1]), [1.0, 0.98, 1.0]);
        let expected = [1.0925, 0.8875, 1.0925];
        assert!(p.iter().zip(expected).all(|(p, e)| (p - e).abs() < 1e-12), "{p:?}");
    }

    #[test]
    fn the_covariance_stays_where_an_alignment_looks_for_the_initial_values() {
        let mut p = covariance([1.0, 0.0, 4.0]);
        Containment::new(true).contain((&effect([1.0, -2.0]), 0), &mut p);
        assert_eq!(p, covariance([1.0, 0.0, 4.0]));
    }

    #[test]
    fn a_covariance_that_is_not_positive_definite_stays() {
        let p = [1.0, 1.0, 1.0];
        assert_eq!(contained(&effect([1.0, -2.0]), p), p);
    }
}
