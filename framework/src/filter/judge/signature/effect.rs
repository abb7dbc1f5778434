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
}

/// Sensitivity of the error states, and the scores.
#[derive(Clone, Default)]
pub(super) struct Effect {
    pub(super) s: Rows,
    /// Changes of a step.
    moved: Rows,
    pub(super) scores: [Score; SUMS],
}

saved!(Effect { s, moved, scores });

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
        vectorised(
            (self, sample, g),
            #[inline(always)]
            |(effect, sample, g): (&mut Self, &Whitened<'_>, &Seen)| {
                effect.score_with(sample, g);
                effect.correct(sample.update, g);
            },
        );
    }

    /// `b := b + g' S^-1 y`, `i := i + g' S^-1 g`.
    #[inline(always)]
    fn score_with(&mut self, sample: &Whitened<'_>, g: &Seen) {
        let (m, lower) = (sample.update.m, sample.lower);
        // L^-1 g, whose square is g' S^-1 g
        let mut white = [[0.0; SUMS]; MAX_CHANNELS];
        let (mut b, mut i) = ([0.0; SUMS], [0.0; SUMS]);
        for (row, l) in lower.chunks_exact(m.max(1)).enumerate().take(MAX_CHANNELS) {
            let mut own = g[row];
            for (done, l) in white.iter().zip(l).take(row) {
                add(&mut own, -l, done);
            }
            own.iter_mut().for_each(|own| *own /= l[row]);
            for (i, own) in i.iter_mut().zip(own) {
                *i += own * own;
            }
            add(&mut b, sample.y[row], &g[row]);
            white[row] = own;
        }
        for (score, (b, i)) in self.scores.iter_mut().zip(b.into_iter().zip(i)) {
            score.add(b, i);
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
    }

    /// Ends a span of all scores.
    pub(super) fn end_span(&mut self) {
        self.scores.iter_mut().for_each(Score::end_span);
    }

    /// Begins one hypothesis again.
    pub(super) fn renew(&mut self, sum: usize, time: Time) {
        self.scores[sum] = Score::new(time);
        self.s.iter_mut().for_each(|s| s[sum] = 0.0);
    }

    /// Time at which the newest hypothesis began.
    pub(super) fn newest(&self) -> Time {
        self.scores.iter().map(|score| score.since).max().unwrap_or(Time::MIN)
    }

    /// The most severe error of at least so many sigmas among the hypotheses that count, among equals the
    /// most significant.
    pub(super) fn worst(
        &self,
        (significant, counts): (f64, impl Fn(usize) -> bool),
        covariance: &Covariance,
        considered: &[bool],
    ) -> Option<Found> {
        let weight = |f: &Found| (f.severity, f.score.sigmas().abs());
        let mut worst: Option<Found> = None;
        for (sum, score) in self.scores.iter().enumerate() {
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
                e if e >= DOUBTFUL => Severity::Doubtful,
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
