//! What a scenario detects of faults that are put into its simulation or into its recording.
//!
//! Each kind of fault is run twice with the same random numbers: with the fault, and without. The run
//! without has the innovations of a filter that knows the fault exactly, so that
//! ```text
//! 2 ln LR = 2 (ln L without - ln L with)
//! ```
//! bounds what any test on these innovations can find. The verdict of the run with the fault is held
//! against it.

use crate::likelihood::Channels;
use crate::patch::Patch;
use crate::recording::Recording;
use crate::scene::Scene;
use crate::trial::{Outcome, run};
use crate::{DiagnoseError, Options, parallel};
use navfuse_core::document::{Document, quoted};
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Twice the log-likelihood ratio from which a fault can be found: the square of 4.75 sigma, at which
/// a step of a bias is significant.
const DETECTABLE: f64 = 22.6;
/// Twice the log-likelihood ratio from which the fault is plain: 6 sigma.
const PLAIN: f64 = 36.0;
/// Error of a state at the end of a run, in sigma, that its sigma still fits.
const FITS: f64 = 3.5;

/// The table of kinds that a file defines.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kinds {
    /// Scenario of the kinds that name none, relative to the file.
    pub scenario: PathBuf,
    /// The kinds.
    pub kind: Vec<Kind>,
}

impl Kinds {
    /// The table of a file.
    ///
    /// # Errors
    /// When a key is unknown or missing, with its place.
    pub fn of(file: &Document) -> Result<Self, DiagnoseError> {
        let mut kinds: Self = file.root().parse()?;
        for kind in &mut kinds.kind {
            let scenario = kind.scenario.as_ref().unwrap_or(&kinds.scenario);
            kind.scenario = Some(file.folder().join(scenario));
        }
        Ok(kinds)
    }

    /// Makes the recordings below a folder the sources of the kinds that have one, and leaves out
    /// the kinds whose recordings are not there. Returns the recordings that are missing.
    pub fn find_recordings(&mut self, data: Option<&Path>) -> BTreeSet<PathBuf> {
        let mut missing = BTreeSet::new();
        self.kind.retain_mut(|kind| {
            let Some(recording) = &kind.recording else { return true };
            let folder = data.and_then(|data| std::fs::canonicalize(data.join(recording)).ok());
            match folder.as_deref().and_then(Path::to_str) {
                Some(folder) => {
                    kind.settings.push(format!("source.csv.directory={}", quoted(folder)));
                    true
                }
                None => {
                    missing.insert(recording.clone());
                    false
                }
            }
        });
        missing
    }
}

/// A kind of fault.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// Its name, with its size.
    pub name: String,
    /// Its scenario, relative to the file.
    pub scenario: Option<PathBuf>,
    /// Settings of the scenario with and without the fault, as `--set` takes them.
    #[serde(default)]
    pub settings: Vec<String>,
    /// Settings that put the fault in; none for a healthy scenario.
    #[serde(default)]
    pub fault: Vec<String>,
    /// Settings that take out a fault which the scenario has itself.
    #[serde(default)]
    pub without: Vec<String>,
    /// Folder of the recording that the scenario reads, below the folder of all data. A recording is
    /// run once.
    pub recording: Option<PathBuf>,
    /// Parts that a verdict may name: a sensor, process or state, or the beginning of its name.
    #[serde(default)]
    pub culprit: Vec<String>,
}

impl Kind {
    /// The scenario with its settings, without those of the fault.
    fn document(&self) -> Result<Document, DiagnoseError> {
        let mut document = Document::from_file(self.scenario.clone().unwrap_or_default())?;
        self.settings.iter().try_for_each(|setting| document.set(setting))?;
        Ok(document)
    }

    /// Settings of the run with the fault, or without it.
    fn of(&self, fault: bool) -> &[String] {
        if fault { &self.fault } else { &self.without }
    }

    fn is_healthy(&self) -> bool {
        self.fault.is_empty() && self.without.is_empty()
    }

    /// Number of runs of the kind, of so many.
    fn runs(&self, runs: u64) -> u64 {
        if self.recording.is_some() { 1 } else { runs }
    }

    /// Tests whether two kinds are the same without their faults.
    fn has_base_of(&self, other: &Self) -> bool {
        let base =
            |kind: &Self| (kind.scenario.clone(), kind.settings.clone(), kind.without.clone());
        base(self) == base(other)
    }
}

/// What a run shows of its fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// Its verdict is consistent.
    Silent,
    /// Its verdict names a culprit first.
    Named,
    /// Its verdict names another part first.
    WrongName,
}

/// A run with a fault.
#[derive(Clone, Debug, Serialize)]
pub struct Detection {
    /// Seed of its random numbers.
    pub seed: u64,
    /// Twice the log-likelihood ratio of the filter that knows the fault; null for a healthy scenario.
    pub ratio: Option<f64>,
    /// What the verdict shows.
    pub finding: Finding,
    /// Level of the verdict.
    pub level: VerdictLevel,
    /// The part that the verdict names first.
    pub named: Option<String>,
    /// Largest error of a state at the end, in its sigma.
    pub error: Option<f64>,
}

/// The runs of a kind.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the kind.
    pub name: String,
    /// Its runs, by seed.
    pub runs: Vec<Detection>,
}

/// Runs of all kinds by what they show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Number of runs.
    pub runs: usize,
    /// Runs with a consistent verdict.
    pub silent: usize,
    /// Runs that name a culprit first.
    pub named: usize,
    /// Runs that name another part first.
    pub wrong_name: usize,
    /// Runs with an error beyond 3.5 sigma that do not report that their result must not be used.
    pub missed: usize,
}

/// Runs by how plain their fault is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Plainness {
    /// No fault.
    Healthy,
    /// 2 ln LR below 22.6: no test can find the fault.
    Hidden,
    /// 2 ln LR from 22.6 to 36.
    Detectable,
    /// 2 ln LR above 36.
    Plain,
}

impl Plainness {
    /// All, from healthy to plain.
    pub const ALL: [Self; 4] = [Self::Healthy, Self::Hidden, Self::Detectable, Self::Plain];

    fn of(run: &Detection) -> Self {
        match run.ratio {
            None => Self::Healthy,
            Some(ratio) if ratio < DETECTABLE => Self::Hidden,
            Some(ratio) if ratio <= PLAIN => Self::Detectable,
            Some(_) => Self::Plain,
        }
    }
}

impl Detection {
    /// Returns `true` if an error does not fit its sigma, and the verdict does not refuse the result.
    pub fn missed(&self) -> bool {
        self.level != VerdictLevel::DoNotUse && self.error.is_some_and(|error| error > FITS)
    }
}

/// The runs whose faults are so plain, counted.
pub fn counts(rows: &[Row], plain: Plainness) -> Counts {
    let runs = rows.iter().flat_map(|row| &row.runs).filter(|run| Plainness::of(run) == plain);
    runs.fold(Counts::default(), |mut counts, run| {
        counts.runs += 1;
        counts.missed += usize::from(run.missed());
        match run.finding {
            Finding::Silent => counts.silent += 1,
            Finding::Named => counts.named += 1,
            Finding::WrongName => counts.wrong_name += 1,
        }
        counts
    })
}

/// Runs each kind with the seeds from 1 on, and calls `progress` with the number of runs that are
/// done, and of all.
///
/// # Errors
/// When a scenario does not compose with its settings, or its samples cannot be read.
pub fn detect(
    registry: &Registry,
    kinds: &Kinds,
    runs: u64,
    options: &Options,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<Row>, DiagnoseError> {
    let kinds = &kinds.kind;
    let documents: Vec<Document> = kinds.iter().map(Kind::document).collect::<Result<_, _>>()?;
    // kinds of one scenario share their runs without a fault
    let base = |kind: &Kind| kinds.iter().position(|k| k.has_base_of(kind)).unwrap_or_default();
    let jobs = |of: &dyn Fn(usize) -> bool| -> Vec<(usize, u64)> {
        let numbers = (0..kinds.len()).filter(|k| of(*k));
        numbers.flat_map(|k| (1..=kinds[k].runs(runs)).map(move |seed| (k, seed))).collect()
    };
    let healthy = jobs(&|k| base(&kinds[k]) == k);
    let faulty = jobs(&|k| !kinds[k].is_healthy());
    let (done, all) = (AtomicUsize::new(0), healthy.len() + faulty.len());
    let each = |jobs: &[(usize, u64)], faults: bool| {
        parallel::each(jobs.len(), options.threads, stop, |at| {
            let (k, seed) = jobs[at];
            let outcome = outcome(registry, &documents[k], seed, kinds[k].of(faults), stop);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, all);
            let whole = |outcome: &Outcome| !outcome.interrupted;
            Some(outcome.map(|outcome| Some(outcome).filter(whole).map(|o| ((k, seed), o))))
        })
        .into_iter()
        .filter_map(Result::transpose)
        .collect::<Result<BTreeMap<(usize, u64), Outcome>, DiagnoseError>>()
    };
    let (without, with) = (each(&healthy, false)?, each(&faulty, true)?);
    let row = |(k, kind): (usize, &Kind)| {
        let found = (1..=runs).filter_map(|seed| {
            let healthy = without.get(&(base(kind), seed))?;
            match kind.is_healthy() {
                true => Some(detection(kind, seed, healthy, None)),
                false => Some(detection(kind, seed, with.get(&(k, seed))?, Some(healthy))),
            }
        });
        Row { name: kind.name.clone(), runs: found.collect() }
    };
    Ok(kinds.iter().enumerate().map(row).collect())
}

/// What a run shows of its fault; `without` is the run without it, none for a healthy kind.
fn detection(kind: &Kind, seed: u64, with: &Outcome, without: Option<&Outcome>) -> Detection {
    let ratio = without.map(|without| {
        let wanted = &without.densities.count;
        let total = |run: &Outcome| run.densities.total(wanted, &Channels::new(), false);
        2.0 * (total(without) - total(with))
    });
    let right = |name: &String| kind.culprit.iter().any(|part| name.starts_with(part.as_str()));
    let ((level, named), error) = (with.blind.clone(), with.worst);
    let finding = match &named {
        None => Finding::Silent,
        Some(name) if right(name) => Finding::Named,
        Some(_) => Finding::WrongName,
    };
    Detection { seed, ratio, finding, level, named, error }
}

/// The run of a scenario with a seed and the settings of a fault.
fn outcome(
    registry: &Registry,
    document: &Document,
    seed: u64,
    fault: &[String],
    stop: &AtomicBool,
) -> Result<Outcome, DiagnoseError> {
    let mut document = document.clone();
    document.set(&format!("seed={seed}"))?;
    fault.iter().try_for_each(|setting| document.set(setting))?;
    let document = &document;
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let recording = Recording::read(scenario.assemble(None)?)?;
    let composition = scenario.compose()?;
    let scene = Scene::new(registry, document, &composition, &recording);
    Ok(run(&scene, &Patch::default(), recording.span().1, &Channels::new(), stop)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_counted_by_how_plain_their_fault_is() {
        let run = |ratio, finding, level, error| Detection {
            seed: 1,
            ratio,
            finding,
            level,
            named: None,
            error: Some(error),
        };
        let (good, bad) = (VerdictLevel::Consistent, VerdictLevel::DoNotUse);
        let runs = vec![
            run(None, Finding::Silent, good, 1.0),
            run(Some(22.5), Finding::Silent, good, 3.0),
            run(Some(22.7), Finding::Silent, good, 4.0),
            run(Some(36.1), Finding::Named, bad, 40.0),
            run(Some(1e3), Finding::WrongName, bad, 40.0),
        ];
        let rows = [Row { name: String::new(), runs }];
        let of = Plainness::ALL.map(|plain| counts(&rows, plain));
        let numbers = of.map(|c| [c.runs, c.silent, c.named, c.wrong_name, c.missed]);
        let expected = [[1, 1, 0, 0, 0], [1, 1, 0, 0, 0], [1, 1, 0, 0, 1], [2, 0, 1, 1, 0]];
        assert_eq!(numbers, expected);
    }
}
