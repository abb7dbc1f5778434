//! Score of a hypothesis about an error that nothing models.

use crate::checkpoint::saved;
use crate::units::time::Time;

/// Length of the spans of which the scatter is taken, s.
pub(super) const SPAN: f64 = 10.0;

/// Lead in twice the log-likelihood ratio, the square of a score, with which an explanation is clear:
/// odds of `exp(10 / 2)`, 150 : 1.
const CLEAR: f64 = 10.0;

/// Penalty in twice the log-likelihood ratio for each parameter of an explanation, `ln n` of some 400 samples
/// (Schwarz 1978).
pub(super) const PARAMETER: f64 = 6.0;

/// Least score that leads another one clearly.
pub(super) fn leading(rival: f64) -> f64 {
    (rival * rival + CLEAR).sqrt()
}

/// Sums `b = sum f' S^-1 y`, `i = sum f' S^-1 f` and `c = sum f' S^-1 g` since one time, where `f` is `g`
/// as far as it is known before the sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Score {
    pub(super) since: Time,
    b: f64,
    i: f64,
    c: f64,
    /// Sums `b` and `c` of the span so far, and of `b^2`, `b c` and `c^2` over the spans before.
    span: [f64; 2],
    squares: [f64; 3],
}

saved!(Score { since, b, i, c, span, squares });

impl Score {
    pub(super) fn new(since: Time) -> Self {
        Self { since, ..Self::default() }
    }

    /// The score of an error of a size that is significant with so many sigmas.
    pub(super) fn of(size: f64, sigmas: f64, since: Time) -> Self {
        let information = (sigmas / size).powi(2);
        Self { b: information * size, i: information, c: information, ..Self::new(since) }
    }

    pub(super) fn add(&mut self, b: f64, i: f64, c: f64) {
        self.b += b;
        self.i += i;
        self.c += c;
        self.span[0] += b;
        self.span[1] += c;
    }

    pub(super) fn end_span(&mut self) {
        let [b, c] = std::mem::take(&mut self.span);
        self.squares[0] += b * b;
        self.squares[1] += b * c;
        self.squares[2] += c * c;
    }

    /// The sums of innovations from which an error of the size `a` was taken off.
    pub(super) fn less(&self, a: f64) -> Self {
        let ([b, c], [bb, bc, cc]) = (self.span, self.squares);
        let squares = [bb - 2.0 * a * bc + a * a * cc, bc - a * cc, cc];
        Self { b: self.b - a * self.c, span: [b - a * c, c], squares, ..*self }
    }

    /// The sums of the samples that another score has not.
    pub(super) fn without(&self, other: &Self) -> Self {
        Self {
            b: self.b - other.b,
            i: self.i - other.i,
            c: self.c - other.c,
            ..Self::new(self.since)
        }
    }

    /// Score in sigma at the noise that is stated, zero without information.
    pub(super) fn raw(&self) -> f64 {
        if self.i > 0.0 { self.b.abs() / self.i.sqrt() } else { 0.0 }
    }

    /// Size of the error.
    pub(super) fn size(&self) -> f64 {
        self.b / self.c
    }

    /// Information about the error, or the scatter of the spans where that is larger.
    fn scatter(&self) -> f64 {
        let (size, [bb, bc, cc]) = (self.size(), self.squares);
        self.i.max(bb - 2.0 * size * bc + size * size * cc)
    }

    /// Variance of [`Self::size`].
    pub(super) fn variance(&self) -> f64 {
        self.scatter() / (self.c * self.c)
    }

    /// Number of spans that determine the scatter: spans of equal information count as one each.
    fn spans(&self) -> f64 {
        let ended = self.c - self.span[1];
        ended * ended / self.squares[2]
    }

    /// Score in sigma with which the error is significant. Where the scatter is larger than the information, the
    /// noise is larger than stated by a factor that only the spans determine. A larger noise then competes with the
    /// error: twice the log-likelihood ratio of both is `k ln(1 + z^2 / (k - 1))` for `k` spans (Student 1908).
    pub(super) fn significance(&self) -> f64 {
        let (z, k) = (self.sigmas().abs(), self.spans());
        if self.scatter() <= self.i {
            return z;
        }
        if k <= 1.0 {
            return 0.0;
        }
        (k * (z * z / (k - 1.0)).ln_1p()).sqrt().min(z)
    }

    /// Score in sigma; NaN without information.
    pub(super) fn sigmas(&self) -> f64 {
        self.b / self.scatter().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spans of `(b, i)`.
    fn score(spans: &[[f64; 2]]) -> Score {
        let mut score = Score::new(Time::MIN);
        for [b, i] in spans {
            score.add(0.25 * b, 0.5 * i, 0.5 * i);
            score.add(0.75 * b, 0.5 * i, 0.5 * i);
            score.end_span();
        }
        score
    }

    /// b = 12 and i = 6 give the size 2. No span is off by it, so that the variance is 1 / i.
    #[test]
    fn spans_that_agree_have_the_variance_of_their_information() {
        let score = score(&[[4.0, 2.0], [8.0, 4.0]]);
        assert_eq!(score.size(), 2.0);
        assert_eq!(score.variance(), 1.0 / 6.0);
        assert!((score.sigmas() - 12.0 / 6_f64.sqrt()).abs() < 1e-12);
    }

    /// b = 12 and i = 6 again. The spans are off by 14 - 2 * 2 = 10 and -2 - 2 * 4 = -10, so that the
    /// scatter is 200 in place of 6.
    #[test]
    fn spans_that_contradict_one_another_widen_the_score_by_their_scatter() {
        let score = score(&[[14.0, 2.0], [-2.0, 4.0]]);
        assert_eq!(score.size(), 2.0);
        assert!((score.variance() - 200.0 / 36.0).abs() < 1e-12);
        assert!((score.sigmas() - 12.0 / 200_f64.sqrt()).abs() < 1e-12);
    }

    /// The sensitivity before the samples is half of that of the samples: b = 12, i = 3 and c = 6 give the
    /// size 2 with the variance 3 / 36.
    #[test]
    fn a_sensitivity_that_is_known_too_small_before_does_not_change_the_size() {
        let mut score = Score::new(Time::MIN);
        score.add(12.0, 3.0, 6.0);
        assert_eq!((score.size(), score.variance()), (2.0, 3.0 / 36.0));
        assert_eq!(score.sigmas(), 12.0 / 3_f64.sqrt());
    }

    /// The spans were off by 10 and -10, and are so from the fitted error as well.
    #[test]
    fn what_was_taken_off_is_not_found_again_and_its_uncertainty_stays() {
        let score = score(&[[14.0, 2.0], [-2.0, 4.0]]);
        let rest = score.less(score.size());
        assert_eq!((rest.size(), rest.variance()), (0.0, score.variance()));
    }

    /// 7.5^2 - 6.8^2 is just above 10.
    #[test]
    fn odds_of_150_to_1_are_a_clear_lead() {
        assert!(leading(6.8) < 7.5 && leading(6.8) > 7.49);
        assert!((0.5 * (leading(6.8).powi(2) - 6.8 * 6.8)).exp() > 148.0);
    }

    /// Seven spans around 40 whose squares off it sum up to 232: z is 280 / sqrt(232) = 18.4, and
    /// `7 ln(1 + 18.4^2 / 6)` is 5.32^2.
    #[test]
    fn few_spans_that_scatter_are_less_significant_than_their_score() {
        let score = score(&[48.0, 32.0, 46.0, 34.0, 44.0, 36.0, 40.0].map(|b| [b, 1.0]));
        assert!((score.sigmas() - 18.38).abs() < 0.01, "{}", score.sigmas());
        assert!((score.significance() - 5.32).abs() < 0.01, "{}", score.significance());
    }

    #[test]
    fn spans_that_agree_are_as_significant_as_their_score() {
        let score = score(&[[4.0, 2.0], [8.0, 4.0]]);
        assert_eq!(score.significance(), score.sigmas());
    }

    /// The second span alone has b = 8 and i = 4.
    #[test]
    fn samples_that_another_sum_has_do_not_count() {
        let (all, first) = (score(&[[4.0, 2.0], [8.0, 4.0]]), score(&[[4.0, 2.0]]));
        assert_eq!(all.without(&first).raw(), 4.0);
        assert_eq!(all.without(&all).raw(), 0.0);
    }

    #[test]
    fn a_score_without_information_is_not_significant() {
        assert!(Score::new(Time::MIN).sigmas().is_nan());
    }
}
