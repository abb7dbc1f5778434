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
use super::score::Score;
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::model::record::finding::{Finding, Severity};
use crate::state::covariance::{Covariance, cholesky, forward};
use crate::units::time::{Span, Time};

/// Widening of the covariance, with the workspace of the test.
#[derive(Clone, Default)]
pub(super) struct Containment {
    p: Vec<f64>,
    lower: Vec<f64>,
    white: Vec<f64>,
    /// Set by each widening.
    pub(super) widened: bool,
    /// Set where nothing is contained, for the whole run: an alignment looks for the initial values, so
    /// that the state may be far off and the effect of an error is not linear, or passes linearise
    /// the run again, and know no finding.
    never: bool,
    /// Span after the first sample up to which passes may take the samples again, and that sample's.
    again: Option<Span>,
    first: Option<Time>,
    /// Set where nothing is contained at present.
    off: bool,
}

saved!(Containment { widened, first, off } except { p, lower, white, never, again });

impl Containment {
    pub(super) fn new(composition: &Composition) -> Self {
        let searched = composition.processes.iter().any(|process| process.alignment.is_some());
        let estimator = &composition.estimator;
        let never = searched || estimator.passes() > 1;
        Self { never, again: estimator.relinearise(), ..Self::default() }
    }

    /// Begins with the findings of a sample of that time.
    pub(super) fn begin(&mut self, time: Time) {
        let first = *self.first.get_or_insert(time);
        self.off = self.never || self.again.is_some_and(|again| time <= first + again);
    }

    /// A finding, which states what the filter does about the error.
    pub(super) fn noted(&self, mut finding: Finding, does: &str) -> Finding {
        if !self.off {
            if finding.severity == Severity::Doubtful {
                finding.severity = Severity::Contained;
            }
            finding.text.push_str(does);
        }
        finding
    }

    /// Widens the covariance if it does not contain the error of a hypothesis.
    pub(super) fn contain<const W: usize>(
        &mut self,
        (effect, score, sum): (&Effect<W>, &Score, usize),
        covariance: &mut Covariance,
    ) {
        let variance = score.size().powi(2) + score.variance();
        self.contain_along(|i| f64::from(effect.s[i][sum]), variance, covariance);
    }

    /// Widens the covariance if it does not contain an error of that variance, which has moved the state along `s`.
    pub(super) fn contain_along(
        &mut self,
        s: impl Fn(usize) -> f64,
        variance: f64,
        covariance: &mut Covariance,
    ) {
        if self.off {
            return;
        }
        let Self { p, lower, white, .. } = self;
        let n = covariance.dimension();
        p.clear();
        p.extend(covariance.rows().flatten());
        white.clear();
        white.extend((0..n).map(&s));
        if !cholesky(p, n, lower) {
            return;
        }
        forward(lower, n, white);
        if variance * white.iter().map(|w| w * w).sum::<f64>() > 1.0 {
            self.widen(covariance, variance, s);
        }
    }

    /// Returns `true` while nothing is contained.
    pub(super) fn is_off(&self) -> bool {
        self.off
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

    /// An error of the size 3 with the variance 1/4.
    fn score() -> Score {
        let mut score = Score::new(Time::MIN);
        score.add(12.0, 4.0, 4.0);
        score
    }

    fn effect(s: [f32; 2]) -> Effect<1> {
        let mut effect: Effect<1> = Effect::new(2);
        effect.begin(Time::MIN);
        effect.s.iter_mut().zip(s).for_each(|(row, s)| row[0] = s);
        effect
    }

    fn covariance(p: [f64; 3]) -> Covariance {
        let mut covariance = Covariance::zero(2);
        covariance.set_lower(&p);
        covariance
    }

    fn contained(effect: &Effect<1>, p: [f64; 3]) -> Vec<f64> {
        let (mut covariance, before) = (covariance(p), covariance(p));
        let mut containment = Containment::default();
        containment.contain((effect, &score(), 0), &mut covariance);
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
        assert!(p.iter().zip(expected).all(|(p, e)| (p - e).abs() < 1e-7), "{p:?}");
    }

    /// A second of the run is linearised again.
    #[test]
    fn the_covariance_stays_while_passes_may_take_the_samples_again() {
        let again = Span::from_seconds(1.0);
        let contains = |mut containment: Containment, seconds: f64| {
            let mut p = covariance([1.0, 0.0, 4.0]);
            containment.begin(Time::default());
            containment.begin(Time::from_seconds(seconds).unwrap_or_default());
            let effect = effect([1.0, -2.0]);
            containment.contain((&effect, &score(), 0), &mut p);
            p != covariance([1.0, 0.0, 4.0])
        };
        assert!(!contains(Containment { again, ..Containment::default() }, 1.0));
        assert!(contains(Containment { again, ..Containment::default() }, 1.1));
        assert!(!contains(Containment { never: true, ..Containment::default() }, 1.1));
    }

    #[test]
    fn a_covariance_that_is_not_positive_definite_stays() {
        let p = [1.0, 1.0, 1.0];
        assert_eq!(contained(&effect([1.0, -2.0]), p), p);
    }
}
