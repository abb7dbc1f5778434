//! The search: every change on a part of the samples, the best ones on all of them, then pairs.

use crate::causes::{refined, suggested};
use crate::likelihood::Channels;
use crate::parallel;
use crate::patch::Patch;
use crate::scene::Scene;
use crate::trial::{Outcome, distance, run, words};
use crate::{Diagnosis, Options, Trial};
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::units::sample::MAX_CHANNELS;
use navfuse_core::units::time::{Span, Time};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Changes that are tried on all samples.
const BEST: usize = 10;
/// Shortest part of the samples, and the part from the first finding on, s.
const SHORTEST: f64 = 60.0;
/// Score from which the samples favour a change: odds of 150 : 1.
pub(crate) const CLEAR: f64 = 10.0;

/// The runs of a part of the samples.
pub(crate) struct Search<'a> {
    pub scene: &'a Scene<'a>,
    pub options: &'a Options,
    pub stop: &'a AtomicBool,
    pub progress: &'a (dyn Fn(usize, usize) + Sync),
    scales: Channels<f64>,
    done: AtomicUsize,
    planned: AtomicUsize,
}

/// Number of parameters of a change: those that it names, or the components of the state that its run
/// estimates.
fn parameters(patch: &Patch, outcome: &Outcome) -> usize {
    patch.parameters.max(outcome.estimate.as_ref().map_or(0, |row| row.estimate.len()))
}

/// The number of values of each channel that some runs explain: of a constraint those of the first run,
/// of a sensor the most.
pub(crate) fn most<'a>(
    scene: &Scene<'_>,
    mut runs: impl Iterator<Item = &'a Outcome>,
) -> Channels<u64> {
    let mut wanted = runs.next().map(|base| base.densities.count.clone()).unwrap_or_default();
    for (name, count) in runs.flat_map(|outcome| &outcome.densities.count) {
        if scene.sensors.iter().any(|s| s.info.name == *name && !s.constraint) {
            let most = wanted.entry(name.clone()).or_insert([0; MAX_CHANNELS]);
            (0..MAX_CHANNELS).for_each(|k| most[k] = most[k].max(count[k]));
        }
    }
    wanted
}

/// A change and its run.
type Run = (Patch, Outcome);

impl<'a> Search<'a> {
    pub fn new(
        scene: &'a Scene<'a>,
        options: &'a Options,
        stop: &'a AtomicBool,
        progress: &'a (dyn Fn(usize, usize) + Sync),
    ) -> Self {
        let (done, planned) = (AtomicUsize::new(0), AtomicUsize::new(0));
        Self { scene, options, stop, progress, scales: Channels::new(), done, planned }
    }

    /// Finds the changes, the best first.
    pub fn search(mut self) -> Result<Diagnosis, crate::DiagnoseError> {
        let (first, last) = self.scene.recording.span();
        let unchanged = Patch::default();
        let clock = Instant::now();
        self.scales = run(self.scene, &unchanged, last, &self.scales, self.stop)?.scales;
        let one = clock.elapsed();
        let base = run(self.scene, &unchanged, last, &self.scales, self.stop)?;
        let causes = self.scene.causes();
        let count = causes.len();
        let part = self.part(one, count, base.found, (first, last));
        let mut runs = self.all(causes, part);
        let (tried, stopped) = (runs.len(), self.stop.load(Ordering::Relaxed));
        let unfit = if stopped { 0 } else { count - tried };
        if part < last {
            let start = run(self.scene, &unchanged, part, &self.scales, self.stop)?;
            let best = self.ranked(&start, &runs, BEST);
            runs = self.all(best, last);
        }
        let best = self.ranked(&base, &runs, BEST);
        let noise = best.iter().find_map(|patch| {
            let outcome = &runs.iter().find(|(other, _)| other.text == patch.text)?.1;
            refined(self.scene, patch, outcome)
        });
        runs.extend(self.all(noise.into_iter().collect(), last));
        if !self.solved(&base, &runs) {
            let centred = self.best(&base, &runs).and_then(|(patch, outcome)| {
                let row = outcome.estimate.as_ref()?;
                patch.centred(&row.estimate, row.unit)
            });
            runs.extend(self.all(centred.into_iter().collect(), last));
        }
        if !self.solved(&base, &runs) {
            let pairs = self.pairs(&base, &runs);
            runs.extend(self.all(pairs, last));
        }
        let interrupted = self.stop.load(Ordering::Relaxed);
        let trials = self.trials(&base, runs);
        Ok(Diagnosis {
            unchanged: self.trial(&base, Patch::default(), &base, 0.0, 0.0),
            trials,
            tried,
            unfit,
            interrupted,
        })
    }

    /// The end of the part of the samples on which every change is tried within the time. A fault that begins
    /// later than that takes longer: the part then ends after the first finding.
    fn part(
        &self,
        one: Duration,
        count: usize,
        found: Option<Time>,
        (first, last): (Time, Time),
    ) -> Time {
        let whole = one.as_secs_f64() * count as f64 / self.options.threads.max(1) as f64;
        let share = self.options.seconds / whole.max(1e-9);
        let span = last.since(first);
        if share >= 1.0 {
            return last;
        }
        let contradicted = found.map_or(0.0, |found| found.since(first) + SHORTEST);
        let part = (share * span).max(SHORTEST).max(contradicted).min(span);
        Span::from_seconds(part).map_or(last, |part| first + part)
    }

    /// Runs changes on all threads, and keeps their order. A change that does not fit the scenario
    /// has no run.
    fn all(&self, patches: Vec<Patch>, until: Time) -> Vec<Run> {
        self.planned.fetch_add(patches.len(), Ordering::Relaxed);
        parallel::each(patches.len(), self.options.threads, self.stop, |at| {
            let patch = &patches[at];
            let outcome = run(self.scene, patch, until, &self.scales, self.stop);
            let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(done, self.planned.load(Ordering::Relaxed));
            let outcome = outcome.ok().filter(|outcome| !outcome.interrupted);
            outcome.map(|outcome| (patch.clone(), outcome))
        })
    }

    /// The number of values of each channel that every run has to explain: of a constraint those of
    /// the unchanged scenario, of a sensor the most that a run explains.
    fn wanted(&self, base: &Outcome, runs: &[Run]) -> Channels<u64> {
        most(self.scene, [base].into_iter().chain(runs.iter().map(|(_, outcome)| outcome)))
    }

    /// Twice the log-likelihood that each change gains, and its score: less `ln n` a parameter
    /// (Schwarz's criterion), and twice the logarithm of the number of choices.
    fn scores(&self, base: &Outcome, runs: &[Run]) -> Vec<(f64, f64)> {
        let wanted = self.wanted(base, runs);
        let total = |outcome: &Outcome| outcome.densities.total(&wanted, &self.scales);
        let (before, n) = (total(base), wanted.values().flatten().sum::<u64>().max(1) as f64);
        let score = |(patch, outcome): &Run| {
            let gain = 2.0 * (total(outcome) - before);
            (gain, gain - parameters(patch, outcome) as f64 * n.ln() - 2.0 * patch.choices)
        };
        runs.iter().map(score).collect()
    }

    /// The changes with the highest scores, each with the parameters that its run estimated.
    fn ranked(&self, base: &Outcome, runs: &[Run], most: usize) -> Vec<Patch> {
        let scores = self.scores(base, runs);
        let mut order: Vec<usize> = (0..runs.len()).collect();
        order.sort_by(|a, b| scores[*b].1.total_cmp(&scores[*a].1));
        let counted = |(patch, outcome): &Run| Patch {
            parameters: parameters(patch, outcome),
            ..patch.clone()
        };
        order.into_iter().take(most).map(|k| counted(&runs[k])).collect()
    }

    /// The run with the highest score, if the samples favour it.
    fn best<'r>(&self, base: &Outcome, runs: &'r [Run]) -> Option<&'r Run> {
        let scores = self.scores(base, runs);
        let best = (0..runs.len()).max_by(|a, b| scores[*a].1.total_cmp(&scores[*b].1));
        best.filter(|k| scores[*k].1 >= CLEAR).map(|k| &runs[k])
    }

    /// True if the best change makes the run consistent, or no change explains anything.
    fn solved(&self, base: &Outcome, runs: &[Run]) -> bool {
        let best = self.best(base, runs);
        best.is_none_or(|(_, outcome)| {
            VerdictLevel::from(outcome.severity) == VerdictLevel::Consistent
        })
    }

    /// The best change with each of the next ones that leaves its keys alone, and with the noise of
    /// each sensor that its innovations suggest.
    fn pairs(&self, base: &Outcome, runs: &[Run]) -> Vec<Patch> {
        let best = self.ranked(base, runs, BEST);
        let Some((first, others)) = best.split_first() else { return Vec::new() };
        let noise = self.best(base, runs).map(|(_, outcome)| suggested(self.scene, outcome));
        let noise = noise.unwrap_or_default();
        let others = others.iter().chain(&noise).filter(|other| !first.collides(other));
        let mut pairs: Vec<Patch> = others.map(|other| first.with(other)).collect();
        // each was chosen among all of them
        let choices = (pairs.len().max(1) as f64).ln();
        pairs.iter_mut().for_each(|pair| pair.choices += choices);
        pairs
    }

    /// The trials, the best first.
    fn trials(&self, base: &Outcome, runs: Vec<Run>) -> Vec<Trial> {
        let scores = self.scores(base, &runs);
        let trials = runs.into_iter().zip(scores);
        let mut trials: Vec<Trial> = trials
            .map(|((patch, outcome), (gain, score))| self.trial(&outcome, patch, base, gain, score))
            .collect();
        trials.sort_by(|a, b| b.score.total_cmp(&a.score));
        trials
    }

    fn trial(
        &self,
        outcome: &Outcome,
        patch: Patch,
        base: &Outcome,
        gain: f64,
        score: f64,
    ) -> Trial {
        let moved = outcome.position.zip(base.position).map(|(a, b)| distance(a, b));
        let (mean_nis, values) = outcome.densities.mean_nis();
        Trial {
            change: patch.text,
            settings: patch.settings,
            gain,
            score,
            mean_nis,
            values,
            level: outcome.severity.into(),
            severity: outcome.severity,
            verdict: outcome.verdict.clone(),
            moved,
            estimate: outcome.estimate.as_ref().map(words),
            unmended: patch.unmended,
        }
    }
}
