//! Effect of an error of unit size on the error states and on the innovations.

use super::score::Score;
use crate::checkpoint::saved;
use crate::model::record::finding::Severity;
use crate::state::covariance::{Covariance, Update};
use crate::state::{Layout, vectorised};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// Hypotheses in parallel, which begin at different times.
pub(super) const SUMS: usize = 4;
/// Error of a state in units of its sigma at which a run is doubtful, and at which it is useless.
pub(super) const DOUBTFUL: f64 = 0.5;
const USELESS: f64 = 2.0;

/// Sensitivity `g` of the channels of a sample.
pub(super) type Seen = [[f64; SUMS]; MAX_CHANNELS];

/// A row of [`SUMS`] per state.
type Rows = Vec<[f64; SUMS]>;

/// Innovation of a sample in the forms that all hypotheses share.
pub(super) struct Whitened<'a> {
    pub(super) update: &'a Update,
    /// Cholesky factor of `S`.
    pub(super) lower: &'a [f64],
    /// `S^-1 y`.
    pub(super) y: [f64; MAX_CHANNELS],
    /// Weight of the sample, below one for one that the gate refuses, which does not correct the state.
    pub(super) weight: f64,
    pub(super) used: bool,
}

/// Sensitivity of the error states, and the scores.
#[derive(Clone, Default)]
pub(super) struct Effect {
    pub(super) s: Rows,
    /// Changes of a step.
    moved: Rows,
    /// Scores of the samples that count for the error, and of those that the gate refused as well.
    pub(super) scores: [Score; SUMS],
    pub(super) all: [Score; SUMS],
}

saved!(Effect { s, moved, scores, all });

/// A significant error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) severity: Severity,
    pub(super) score: Score,
    /// The hypothesis.
    pub(super) sum: usize,
    /// Error of a state in units of its sigma, and the row of the state.
    size: f64,
    row: usize,
}

impl Found {
    /// The state that the error has moved farthest, and how far.
    pub(super) fn moved(&self, layout: &Layout) -> String {
        format!("{} by {:.1} times its sigma", name(layout, self.row), self.size)
    }
}

/// Name of a component of the error state.
pub(super) fn name(layout: &Layout, row: usize) -> String {
    let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&row));
    block.map_or_else(String::new, |block| {
        let component = block.spec.display.components.get(row - block.tangent_range().start);
        let name = format!("{} {}", block.name, component.copied().unwrap_or_default());
        name.trim_end().to_owned()
    })
}

/// `sum := sum + a x`.
#[inline(always)]
fn add(sum: &mut [f64; SUMS], a: f64, x: &[f64; SUMS]) {
    sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += a * x);
}

impl Effect {
    pub(super) fn new(n: usize) -> Self {
        Self {
            s: vec![[0.0; SUMS]; n],
            moved: vec![[0.0; SUMS]; n],
            scores: [Score::default(); SUMS],
            all: [Score::default(); SUMS],
        }
    }

    /// `s := s + (Phi - I) s`, with the elements of `Phi - I`.
    pub(super) fn carry(&mut self, changes: &[(usize, usize, f64)]) {
        vectorised(
            (&mut self.s, &mut self.moved, changes),
            #[inline(always)]
            |(s, moved, changes): (&mut Rows, &mut Rows, &[(usize, usize, f64)])| {
                moved.iter_mut().for_each(|m| *m = [0.0; SUMS]);
                for &(i, j, a) in changes {
                    add(&mut moved[i], a, &s[j]);
                }
                for (s, moved) in s.iter_mut().zip(moved) {
                    add(s, 1.0, moved);
                }
            },
        );
    }

    /// `g = H s`.
    pub(super) fn seen(&self, update: &Update) -> Seen {
        vectorised(
            (self, update),
            #[inline(always)]
            |(effect, update): (&Self, &Update)| effect.project(update),
        )
    }

    #[inline(always)]
    fn project(&self, update: &Update) -> Seen {
        let w = update.columns.len();
        let mut g = [[0.0; SUMS]; MAX_CHANNELS];
        for (g, h) in g.iter_mut().zip(update.h.chunks_exact(w.max(1))).take(update.m) {
            let mut sum = [0.0; SUMS];
            for (&column, h) in update.columns.iter().zip(h) {
                add(&mut sum, *h, &self.s[column]);
            }
            *g = sum;
        }
        g
    }

    /// Adds the innovation to the sums, and corrects the sensitivity: `s := s - K g`.
    pub(super) fn take(&mut self, sample: &Whitened<'_>, g: &Seen) {
        self.take_along(sample, [g, g]);
    }

    /// Adds the innovation to the sums along a sensitivity that is known before the sample, where the
    /// second one is that of the sample, which corrects `s`.
    pub(super) fn take_along(&mut self, sample: &Whitened<'_>, g: [&Seen; 2]) {
        vectorised(
            (self, sample, g),
            #[inline(always)]
            |(effect, sample, g): (&mut Self, &Whitened<'_>, [&Seen; 2])| {
                effect.score_with(sample, g);
                if sample.used {
                    effect.correct(sample.update, g[1]);
                }
            },
        );
    }

    /// `b := b + w f' S^-1 y`, `i := i + w f' S^-1 f`, `c := c + w f' S^-1 g` for `[f, g]`.
    #[inline(always)]
    fn score_with(&mut self, sample: &Whitened<'_>, [f, g]: [&Seen; 2]) {
        let (m, lower, weight) = (sample.update.m, sample.lower, sample.weight);
        // L^-1 f and L^-1 g, whose products are f' S^-1 f and f' S^-1 g
        let mut white = [[[0.0; SUMS]; MAX_CHANNELS]; 2];
        let (mut b, mut i, mut c) = ([0.0; SUMS], [0.0; SUMS], [0.0; SUMS]);
        for (row, l) in lower.chunks_exact(m.max(1)).enumerate().take(MAX_CHANNELS) {
            for (white, g) in white.iter_mut().zip([f, g]) {
                let mut own = g[row];
                for (done, l) in white.iter().zip(l).take(row) {
                    add(&mut own, -l, done);
                }
                own.iter_mut().for_each(|own| *own /= l[row]);
                white[row] = own;
            }
            for k in 0..SUMS {
                i[k] += white[0][row][k] * white[0][row][k];
                c[k] += white[0][row][k] * white[1][row][k];
            }
            add(&mut b, sample.y[row], &f[row]);
        }
        for k in 0..SUMS {
            let [b, i, c] = [b[k], i[k], c[k]].map(|sum| weight * sum);
            self.all[k].add(b, i, c);
            if sample.used {
                self.scores[k].add(b, i, c);
            }
        }
    }

    #[inline(always)]
    fn correct(&mut self, update: &Update, g: &Seen) {
        for (s, gain) in self.s.iter_mut().zip(update.gain().chunks_exact(update.m.max(1))) {
            let mut sum = *s;
            for (gain, g) in gain.iter().zip(g) {
                add(&mut sum, -gain, g);
            }
            *s = sum;
        }
    }

    /// Begins all hypotheses.
    pub(super) fn begin(&mut self, time: Time) {
        self.scores = [Score::new(time); SUMS];
        self.all = self.scores;
    }

    /// Ends a span of all scores.
    pub(super) fn end_span(&mut self) {
        self.scores.iter_mut().chain(&mut self.all).for_each(Score::end_span);
    }

    /// Begins one hypothesis again.
    pub(super) fn renew(&mut self, sum: usize, time: Time) {
        self.scores[sum] = Score::new(time);
        self.all[sum] = self.scores[sum];
        self.s.iter_mut().for_each(|s| s[sum] = 0.0);
    }

    /// Goes on with one hypothesis as the first, whose error was taken off; the others begin again.
    pub(super) fn adopt(&mut self, sum: usize, time: Time) {
        self.all[0] = self.all[sum].less(self.all[sum].size());
        self.s.iter_mut().for_each(|s| s[0] = s[sum]);
        (1..SUMS).for_each(|other| self.renew(other, time));
    }

    /// Begins all hypotheses again.
    pub(super) fn restart(&mut self, time: Time) {
        (0..SUMS).for_each(|sum| self.renew(sum, time));
    }

    /// Time at which the newest hypothesis began.
    pub(super) fn newest(&self) -> Time {
        self.scores.iter().map(|score| score.since).max().unwrap_or(Time::MIN)
    }

    /// The most severe error of at least so many sigmas among the hypotheses that count, among equals the
    /// most significant. An error for which the gate refuses samples is doubtful whatever it moves.
    pub(super) fn worst(
        &self,
        scores: &[Score; SUMS],
        (significant, counts): (f64, impl Fn(usize) -> bool),
        (covariance, considered): (&Covariance, &[bool]),
        refused: bool,
    ) -> Option<Found> {
        let weight = |f: &Found| (f.severity, f.score.sigmas().abs());
        let mut worst: Option<Found> = None;
        for (sum, score) in scores.iter().enumerate() {
            let exceeds = score.sigmas().abs() >= significant;
            if !exceeds || !counts(sum) {
                continue;
            }
            let error = |i: usize| {
                let sigma = covariance.get(i, i).sqrt();
                if sigma > 0.0 && !considered[i] {
                    (score.size() * self.s[i][sum] / sigma).abs()
                } else {
                    0.0
                }
            };
            let (size, row) = (0..considered.len())
                .map(|i| (error(i), i))
                .fold((0.0, 0), |worst, next| if next.0 > worst.0 { next } else { worst });
            let severity = match size {
                e if e >= USELESS => Severity::DoNotUse,
                e if e >= DOUBTFUL || refused => Severity::Doubtful,
                _ => continue,
            };
            let found = Found { severity, score: *score, sum, size, row };
            if worst.as_ref().is_none_or(|worst| weight(worst) < weight(&found)) {
                worst = Some(found);
            }
        }
        worst
    }
}
