//! Effect of an error of unit size on the error states and on the innovations.

use super::lanes::{Carry, Changes, Jacobian, See, Seen, Sums, Take, Work};
use super::score::Score;
use crate::checkpoint::saved;
use crate::model::record::finding::Severity;
use crate::state::Layout;
use crate::state::covariance::{Covariance, Update};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;
use pulp::Arch;

/// Hypotheses in parallel, which begin at different times.
pub(super) const SUMS: usize = 4;
/// Hypothesis that begins again while all sensors agree, so that it runs since just before the gate began to
/// refuse samples, and the time after which, s.
pub(super) const RECENT: usize = SUMS - 1;
pub(super) const CALM: f64 = 2.0;
/// Hypotheses that are followed together: their sensitivities fill whole vector registers.
pub(super) const WIDE: usize = 8 * SUMS;
/// Hypotheses of an offset, which fill one register: [`SUMS`] of them are in use.
pub(super) const OFFSETS: usize = 8;
/// Error of a state in units of its sigma at which a run is doubtful, and at which it is useless.
pub(super) const DOUBTFUL: f64 = 0.5;
const USELESS: f64 = 2.0;

/// Innovation of a sample in the forms that all hypotheses share.
#[derive(Clone, Copy)]
pub(super) struct Whitened<'a> {
    pub(super) update: &'a Update,
    /// Cholesky factor of `S`, and the gain.
    pub(super) lower: &'a [f64],
    pub(super) gain: &'a [f32],
    /// `H`.
    pub(super) jacobian: &'a Jacobian,
    /// `S^-1 y`.
    pub(super) y: [f64; MAX_CHANNELS],
    /// Weight of the sample, below one for one that the gate refuses, which does not correct the state.
    pub(super) weight: f64,
    pub(super) used: bool,
}

/// Sensitivity of the error states, and the scores, of `W` hypotheses. The sensitivities have single
/// precision: their error of 1e-7 is far below the scatter of any score, and twice as many fill a register.
#[derive(Clone)]
pub(super) struct Effect<const W: usize> {
    pub(super) s: Vec<[f32; W]>,
    work: Work<W>,
    /// Scores of the samples that count for the error, and of those that the gate refused as well,
    /// up to the last flush.
    scores: [Score; W],
    all: [Score; W],
    /// Sums since then of all samples, and of those that the gate refused.
    sums: Sums<W>,
    gated: Sums<W>,
}

saved!(Effect<1> { s, scores, all, sums, gated } except { work });
saved!(Effect<OFFSETS> { s, scores, all, sums, gated } except { work });
saved!(Effect<WIDE> { s, scores, all, sums, gated } except { work });

impl<const W: usize> Default for Effect<W> {
    fn default() -> Self {
        Self::new(0)
    }
}

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
    /// An error that has moved the states by so much, if one of them is doubtful.
    pub(super) fn new(
        (sum, score): (usize, Score),
        moved: impl Fn(usize) -> f64,
        (covariance, considered): (&Covariance, &[bool]),
        refused: bool,
    ) -> Option<Self> {
        let error = |row: usize| {
            let sigma = covariance.get(row, row).sqrt();
            if sigma > 0.0 && !considered[row] { (moved(row) / sigma).abs() } else { 0.0 }
        };
        let (size, row) = (0..considered.len())
            .map(|row| (error(row), row))
            .fold((0.0, 0), |worst, next| if next.0 > worst.0 { next } else { worst });
        let severity = match size {
            e if e >= USELESS => Severity::DoNotUse,
            e if e >= DOUBTFUL || refused => Severity::Doubtful,
            _ => return None,
        };
        Some(Self { severity, score, sum, size, row })
    }

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

impl<const W: usize> Effect<W> {
    pub(super) fn new(n: usize) -> Self {
        Self {
            s: vec![[0.0; W]; n],
            work: Work::new(n),
            scores: [Score::default(); W],
            all: [Score::default(); W],
            sums: Sums::default(),
            gated: Sums::default(),
        }
    }

    /// One of the hypotheses alone.
    pub(super) fn alone(&self, sum: usize) -> Effect<1> {
        Effect {
            s: self.s.iter().map(|s| [s[sum]]).collect(),
            scores: [self.used(sum)],
            all: [self.all(sum)],
            ..Effect::new(self.s.len())
        }
    }

    /// Score of a hypothesis by all samples.
    pub(super) fn all(&self, sum: usize) -> Score {
        self.sums.added(sum, self.all[sum])
    }

    /// Score of a hypothesis by the samples that the gate did not refuse.
    pub(super) fn used(&self, sum: usize) -> Score {
        self.sums.less(&self.gated, sum, self.scores[sum])
    }

    /// Time since which a hypothesis runs.
    pub(super) fn since(&self, sum: usize) -> Time {
        self.all[sum].since
    }

    /// Adds the sums to the scores.
    fn flush(&mut self) {
        for sum in 0..W {
            (self.scores[sum], self.all[sum]) = (self.used(sum), self.all(sum));
        }
        (self.sums, self.gated) = (Sums::default(), Sums::default());
    }

    /// Forgets the samples that the gate refused.
    pub(super) fn forget_refused(&mut self) {
        self.flush();
        self.all = self.scores;
    }

    /// `s := s + (Phi - I) s`.
    pub(super) fn carry(&mut self, changes: &Changes) {
        self.work.fit(self.s.len());
        Arch::new().dispatch(Carry { s: &mut self.s, work: &mut self.work, changes });
    }

    /// `g = H s`.
    pub(super) fn seen(&self, sample: &Whitened<'_>, g: &mut Seen<W>) {
        Arch::new().dispatch(See { s: &self.s, jacobian: sample.jacobian, g });
    }

    /// Adds the innovation to the sums, and corrects the sensitivity: `s := s - K g`.
    pub(super) fn take(&mut self, sample: &Whitened<'_>, g: &Seen<W>) {
        self.take_both(sample, None, g);
    }

    /// Adds the innovation to the sums along a sensitivity that is known before the sample, where the
    /// second one is that of the sample, which corrects `s`.
    pub(super) fn take_along(&mut self, sample: &Whitened<'_>, [f, g]: [&Seen<W>; 2]) {
        self.take_both(sample, Some(f), g);
    }

    /// `L^-1 f` and `L^-1 g` of the last sample.
    pub(super) fn white(&self, along: bool) -> [&Seen<W>; 2] {
        let [f, g] = self.work.white();
        [f, if along { g } else { f }]
    }

    fn take_both(&mut self, sample: &Whitened<'_>, before: Option<&Seen<W>>, g: &Seen<W>) {
        let Self { s, work, sums, .. } = self;
        let refused = (!sample.used).then_some(&mut self.gated);
        Arch::new().dispatch(Take { s, work, sums, refused, sample, before, g });
    }

    /// Begins all hypotheses.
    pub(super) fn begin(&mut self, time: Time) {
        self.flush();
        self.scores = [Score::new(time); W];
        self.all = self.scores;
    }

    /// Ends a span of all scores.
    pub(super) fn end_span(&mut self) {
        self.flush();
        self.scores.iter_mut().chain(&mut self.all).for_each(Score::end_span);
    }

    /// Begins one hypothesis again.
    pub(super) fn renew(&mut self, sum: usize, time: Time) {
        self.forget(sum, time);
        self.s.iter_mut().for_each(|s| s[sum] = 0.0);
    }

    /// Forgets the samples of a hypothesis, but not what its error has done to the state.
    pub(super) fn forget(&mut self, sum: usize, time: Time) {
        self.sums.clear(sum);
        self.gated.clear(sum);
        self.scores[sum] = Score::new(time);
        self.all[sum] = self.scores[sum];
    }

    /// Goes on with one hypothesis in place of another one.
    pub(super) fn copy(&mut self, from: usize, to: usize) {
        self.flush();
        (self.scores[to], self.all[to]) = (self.scores[from], self.all[from]);
        self.s.iter_mut().for_each(|s| s[to] = s[from]);
    }

    /// Goes on with one hypothesis as the first, whose error was taken off; the others begin again.
    pub(super) fn adopt(&mut self, sum: usize, time: Time) {
        self.flush();
        self.all[0] = self.all[sum].less(self.all[sum].size());
        self.s.iter_mut().for_each(|s| s[0] = s[sum]);
        (1..W).for_each(|other| self.renew(other, time));
    }

    /// Begins all hypotheses again.
    pub(super) fn restart(&mut self, time: Time) {
        (0..W).for_each(|sum| self.renew(sum, time));
    }

    /// Time at which the newest of the first hypotheses began.
    pub(super) fn newest(&self, first: usize) -> Time {
        self.all[..first].iter().map(|score| score.since).max().unwrap_or(Time::MIN)
    }

    /// The most severe error of at least so many sigmas among the hypotheses that count, among equals the
    /// most significant. An error for which the gate refuses samples is doubtful whatever it moves.
    pub(super) fn worst(
        &self,
        (significant, counts): (f64, impl Fn(usize) -> bool),
        score: impl Fn(usize) -> Score,
        (covariance, considered): (&Covariance, &[bool]),
        refused: bool,
    ) -> Option<Found> {
        let weight = |f: &Found| (f.severity, f.score.sigmas().abs());
        let mut worst: Option<Found> = None;
        for sum in (0..W).filter(|sum| counts(*sum)) {
            let states = (covariance, considered);
            let found = self.found((sum, score(sum)), significant, states, refused);
            worst = match (worst, found) {
                (Some(worst), Some(found)) if weight(&worst) >= weight(&found) => Some(worst),
                (worst, found) => found.or(worst),
            };
        }
        worst
    }

    /// The error of a hypothesis with its score, if it has at least so many sigmas.
    pub(super) fn found(
        &self,
        (sum, score): (usize, Score),
        significant: f64,
        (covariance, considered): (&Covariance, &[bool]),
        refused: bool,
    ) -> Option<Found> {
        if score.sigmas().abs() < significant || score.sigmas().is_nan() {
            return None;
        }
        let moved = |row: usize| score.size() * f64::from(self.s[row][sum]);
        Found::new((sum, score), moved, (covariance, considered), refused)
    }
}
