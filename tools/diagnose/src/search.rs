//! The search: every change on a part of the samples, the best ones on all of them, then pairs.

use crate::causes::{closer, refined, suggested};
use crate::likelihood::Channels;
use crate::parallel;
use crate::patch::Patch;
use crate::scene::Scene;
use crate::trial::{Outcome, distance, run, run_once, words};
use crate::{Diagnosis, Options, Trial};
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::plugin::BuildError;
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
/// Score from which the samples favour a change of a run that is consistent without it: 6 sigma.
const PLAIN: f64 = 36.0;
/// Gain of a conversion over its own chance, in sigma: of some hundred, 1 in 100 searches finds one by chance.
const CHANCE: f64 = 4.0;
/// Rounds in which the clock of a driving sensor is tried closer and closer: each divides the distance by 3.
const ROUNDS: usize = 5;

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

/// Score from which the samples favour a change, by the level of the run without it.
pub(crate) fn favoured(unchanged: VerdictLevel) -> f64 {
    if unchanged == VerdictLevel::Consistent { PLAIN } else { CLEAR }
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

/// The runs of the unchanged scenario: as it states, and with every sample linearised once.
#[derive(Clone, Copy)]
struct Bases<'b> {
    stated: &'b Outcome,
    once: &'b Outcome,
}

impl<'b> Bases<'b> {
    /// The one that differs from a run by the change alone.
    fn of(self, outcome: &Outcome) -> &'b Outcome {
        if outcome.once { self.once } else { self.stated }
    }
}

/// A change and its run.
type Run = (Patch, Outcome);
/// Runs a change until a time.
type Runner =
    fn(&Scene<'_>, &Patch, Time, &Channels<f64>, &AtomicBool) -> Result<Outcome, BuildError>;

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
        self.scales = run(self.scene, &unchanged, last, &self.scales, self.stop)?.scales;
        let clock = Instant::now();
        let once = run_once(self.scene, &unchanged, last, &self.scales, self.stop)?;
        let one = clock.elapsed();
        let base = run(self.scene, &unchanged, last, &self.scales, self.stop)?;
        let causes = self.scene.causes();
        let count = causes.len();
        let part = self.part(one, count, base.found, (first, last));
        let quick = self.all(causes, part, run_once);
        let (tried, stopped) = (quick.len(), self.stop.load(Ordering::Relaxed));
        let unfit = if stopped { 0 } else { count - tried };
        let start = match part < last {
            true => Some(run_once(self.scene, &unchanged, part, &self.scales, self.stop)?),
            false => None,
        };
        let start = start.as_ref().unwrap_or(&once);
        let start = Bases { stated: start, once: start };
        let mut best = self.ranked(start, &quick, BEST);
        best.extend(self.clock(start, quick, part));
        let bases = Bases { stated: &base, once: &once };
        let mut runs = Vec::new();
        self.extend(bases, &mut runs, best, last);
        let best = self.ranked(bases, &runs, BEST);
        let noise = best.iter().find_map(|patch| {
            let outcome = &runs.iter().find(|(other, _)| other.text == patch.text)?.1;
            refined(self.scene, patch, outcome)
        });
        self.extend(bases, &mut runs, noise.into_iter().collect(), last);
        if !self.solved(bases, &runs) {
            let centred = self.best(bases, &runs).and_then(|(patch, outcome)| {
                let row = outcome.estimate.as_ref()?;
                patch.centred(&row.estimate, row.unit)
            });
            self.extend(bases, &mut runs, centred.into_iter().collect(), last);
        }
        if !self.solved(bases, &runs) {
            let pairs = self.pairs(bases, &runs);
            self.extend(bases, &mut runs, pairs, last);
        }
        let interrupted = self.stop.load(Ordering::Relaxed);
        let trials = self.trials(bases, runs);
        Ok(Diagnosis {
            unchanged: self.trial(&base, Patch::default(), &base, 0.0, 0.0),
            trials,
            tried,
            unfit,
            interrupted,
        })
    }

    /// The best clock of a driving sensor, if the samples favour it, tried closer and closer.
    fn clock(&self, base: Bases<'_>, runs: Vec<Run>, until: Time) -> Option<Patch> {
        let clocks = runs.into_iter().filter(|(patch, _)| patch.clock.is_some());
        let mut runs: Vec<Run> = clocks.collect();
        let (first, _) = self.best(base, &runs)?;
        let first = first.text.clone();
        for _ in 0..ROUNDS {
            let finer = closer(&self.best(base, &runs)?.0);
            runs.extend(self.all(finer, until, run_once));
        }
        let (best, _) = self.best(base, &runs)?;
        (best.text != first).then(|| best.clone())
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
    fn all(&self, patches: Vec<Patch>, until: Time, with: Runner) -> Vec<Run> {
        self.planned.fetch_add(patches.len(), Ordering::Relaxed);
        parallel::each(patches.len(), self.options.threads, self.stop, |at| {
            let patch = &patches[at];
            let outcome = with(self.scene, patch, until, &self.scales, self.stop);
            let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(done, self.planned.load(Ordering::Relaxed));
            let outcome = outcome.ok().filter(|outcome| !outcome.interrupted);
            outcome.map(|outcome| (patch.clone(), outcome))
        })
    }

    /// Adds the runs of changes, and runs those again as the scenario states that come near the best one: a run
    /// that linearises again may take many times as long.
    fn extend(&self, bases: Bases<'_>, runs: &mut Vec<Run>, patches: Vec<Patch>, until: Time) {
        runs.extend(self.all(patches, until, run_once));
        let scores = self.scores(bases, runs);
        let most = scores.iter().map(|(_, score)| *score).fold(CLEAR, f64::max);
        let near = runs.iter().zip(&scores).filter(|((_, outcome), (_, score))| {
            outcome.once && *score >= CLEAR && most - score < CLEAR
        });
        let near = near.map(|((patch, _), _)| patch.clone()).collect();
        for (patch, outcome) in self.all(near, until, run) {
            if let Some(before) = runs.iter_mut().find(|(other, _)| other.text == patch.text) {
                before.1 = outcome;
            }
        }
    }

    /// The number of values of each channel that every run has to explain: of a constraint those of
    /// the unchanged scenario, of a sensor the most that a run explains.
    /// A change of a clock brings in others, which no other run has to explain.
    fn wanted(&self, base: &Outcome, runs: &[Run]) -> Channels<u64> {
        let same = runs.iter().filter(|(patch, _)| !patch.moves_clock());
        most(self.scene, [base].into_iter().chain(same.map(|(_, outcome)| outcome)))
    }

    /// Twice the log-likelihood that each change gains, and its score: less `ln n` a parameter
    /// (Schwarz's criterion), and twice the logarithm of the number of choices. A conversion whose gain is
    /// within its own chance has none.
    fn scores(&self, bases: Bases<'_>, runs: &[Run]) -> Vec<(f64, f64)> {
        let wanted = self.wanted(bases.stated, runs);
        let total =
            |outcome: &Outcome, moved| outcome.densities.total(&wanted, &self.scales, moved);
        let n = wanted.values().flatten().sum::<u64>().max(1) as f64;
        let score = |(patch, outcome): &Run| {
            let base = bases.of(outcome);
            let gain = 2.0 * (total(outcome, patch.moves_clock()) - total(base, false));
            let score = gain - parameters(patch, outcome) as f64 * n.ln() - 2.0 * patch.choices;
            let chance = || outcome.densities.significance(&base.densities) < CHANCE;
            (gain, if patch.converts() && chance() { score.min(0.0) } else { score })
        };
        runs.iter().map(score).collect()
    }

    /// The changes with the highest scores, each with the parameters that its run estimated.
    fn ranked(&self, base: Bases<'_>, runs: &[Run], most: usize) -> Vec<Patch> {
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
    fn best<'r>(&self, base: Bases<'_>, runs: &'r [Run]) -> Option<&'r Run> {
        let scores = self.scores(base, runs);
        let best = (0..runs.len()).max_by(|a, b| scores[*a].1.total_cmp(&scores[*b].1));
        best.filter(|k| scores[*k].1 >= favoured(base.stated.severity.into())).map(|k| &runs[k])
    }

    /// True if the best change makes the run consistent, or no change explains anything.
    fn solved(&self, base: Bases<'_>, runs: &[Run]) -> bool {
        let best = self.best(base, runs);
        best.is_none_or(|(_, outcome)| {
            VerdictLevel::from(outcome.severity) == VerdictLevel::Consistent
        })
    }

    /// The best change with each of the next ones that leaves its keys alone, and with the noise of
    /// each sensor that its innovations suggest.
    fn pairs(&self, base: Bases<'_>, runs: &[Run]) -> Vec<Patch> {
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
    fn trials(&self, base: Bases<'_>, runs: Vec<Run>) -> Vec<Trial> {
        let scores = self.scores(base, &runs);
        let trials = runs.into_iter().zip(scores);
        let mut trials: Vec<Trial> = trials
            .map(|((patch, outcome), (gain, score))| {
                self.trial(&outcome, patch, base.stated, gain, score)
            })
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
