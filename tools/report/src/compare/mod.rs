//! Comparison of runs: the keys in which their scenarios differ, and their results side by side.
//!
//! [`Comparison`] holds the numbers. [`apart::figure`] plots what differs most, [`plots::figures`]
//! overlays the curves, and [`page::comparison`] writes all of it as one page. [`overview::page`]
//! is the first page for a viewer.

pub mod apart;
mod keys;
pub mod overview;
pub mod page;
pub mod plots;

use crate::history::{BlockHistory, RunHistory, displacement};
pub use apart::LargestDifference;
pub use keys::KeyDifference;
use keys::differences;
use navfuse_core::document::{Document, DocumentError};
use navfuse_core::model::record::Level;
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::{Verdict, VerdictLevel};
use navfuse_figures::Look;
use serde::Serialize;

/// Full turn, deg.
const TURN: f64 = 360.0;

/// Largest time between the ends of two runs whose last estimates are compared, s.
const SAME_END: f64 = 2.0;

/// Run that is compared.
#[derive(Clone, Debug)]
pub struct Run {
    /// Short name, such as `A`, in tables and legends.
    pub letter: String,
    /// Origin: the file, and the values that were changed.
    pub origin: String,
    /// History of the run.
    pub history: RunHistory,
}

/// Numbers of a comparison. The first run is the one from which the others differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Runs in the order as given.
    pub runs: Vec<RunResult>,
    /// Keys in which the scenarios differ.
    pub scenario: Vec<KeyDifference>,
    /// Largest difference of every component of every run from the first run, the largest first.
    pub differences: Vec<LargestDifference>,
    /// Sensors that corrected the state in any of the runs.
    pub sensors: Vec<SensorResult>,
    /// Components of the states that any of the runs estimated.
    pub states: Vec<StateResult>,
}

/// Result of one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunResult {
    /// Short name in the tables.
    pub letter: String,
    /// Origin: the file, and the values that were changed.
    pub origin: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Version of the program that ran the scenario.
    pub version: String,
    /// Seed of a simulated run.
    pub seed: Option<u64>,
    /// From the first estimate to the last, s.
    pub duration_s: f64,
    /// Horizontal path length, m.
    pub distance_m: Option<f64>,
    /// Horizontal error at the last known truth, m.
    pub final_error_m: Option<f64>,
    /// Root mean square of the horizontal error, m.
    pub rms_error_m: Option<f64>,
    /// Number of warnings and errors.
    pub warnings: u64,
    /// Level of the verdict; none for a log without a verdict.
    pub verdict: Option<VerdictLevel>,
    /// Severity of the heaviest reason of the verdict, which words it.
    #[serde(skip)]
    pub severity: Option<Severity>,
    /// Verdict in one line.
    pub verdict_text: Option<String>,
}

/// Results of a sensor in every run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorResult {
    /// Name of the sensor.
    pub sensor: String,
    /// Result of each run; none where the run has no such sensor.
    pub runs: Vec<Option<SensorCounts>>,
}

/// Result of a sensor in one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorCounts {
    /// Samples that corrected the state.
    pub used: u64,
    /// Samples outside the gate.
    pub gated: u64,
    /// Rejected samples.
    pub rejected: u64,
    /// Mean NIS of the used samples.
    pub mean_nis: Option<f64>,
    /// Expected NIS, from the verdict.
    pub expected_nis: Option<f64>,
    /// False if the verdict found the mean NIS outside its band.
    pub inside: bool,
}

/// Results of a component of a state in every run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StateResult {
    /// Block and component, such as `ins.attitude yaw`.
    pub state: String,
    /// Unit of all values, but not of the estimate of a position; empty for a ratio.
    pub unit: String,
    /// Result of each run; none where the run has no such state.
    pub runs: Vec<Option<StateNumbers>>,
}

/// Results of a component of a state in one run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StateNumbers {
    /// Last estimate; of a position latitude or longitude, deg, or height, m.
    pub estimate: f64,
    /// Its 1-sigma.
    pub sigma: f64,
    /// Last error, where the truth is known to the end.
    pub error: Option<f64>,
    /// Root mean square of the error over the run.
    pub rms_error: Option<f64>,
    /// Difference from the first run at the end: of the errors where both are known, otherwise of
    /// the estimates. None for the first run, and for runs that end at different times.
    pub difference: Option<f64>,
    /// 1-sigma of the difference of two estimates with independent errors. Estimates from shared
    /// samples differ by less, so a larger difference contradicts one of the two sigmas.
    pub difference_sigma: Option<f64>,
}

impl Comparison {
    /// Compares runs.
    ///
    /// # Errors
    /// Returns an error if a scenario in a log is not TOML.
    pub fn new(runs: &[Run]) -> Result<Self, DocumentError> {
        let scenario = |run: &Run| Document::parse(&*run.origin, &*run.history.scenario);
        let scenarios: Vec<Document> = runs.iter().map(scenario).collect::<Result<_, _>>()?;
        Ok(Self {
            runs: runs.iter().map(RunResult::new).collect(),
            scenario: differences(&scenarios)?,
            differences: apart::largest(runs),
            sensors: sensors(runs),
            states: states(runs),
        })
    }

    /// Sentence about the runs that end at another time than the first one: their last estimates have no
    /// difference. `None` without such runs.
    pub fn other_ends(&self) -> Option<String> {
        let first = self.runs.first()?;
        let apart = |k: &usize| {
            let pairs = self.states.iter().filter_map(|s| s.runs[0].zip(s.runs[*k]));
            let mut known = pairs.map(|(_, run)| run.difference.is_some()).peekable();
            known.peek().is_some() && !known.any(|known| known)
        };
        let letters = (1..self.runs.len()).filter(apart).map(|k| self.runs[k].letter.as_str());
        let letters: Vec<&str> = letters.collect();
        let end = if letters.len() == 1 { "ends" } else { "end" };
        (!letters.is_empty()).then(|| {
            format!(
                "{} {end} at another time than {}: the last estimates have no difference.",
                letters.join(", "),
                first.letter
            )
        })
    }
}

impl RunResult {
    /// Words of the verdict.
    pub fn words(&self) -> &'static str {
        self.severity.map_or("not judged", Severity::verdict)
    }

    /// Returns `true` for a verdict that doubts the run.
    pub(crate) fn is_doubted(&self) -> bool {
        self.verdict.is_some_and(|level| level != VerdictLevel::Consistent)
    }

    fn new(run: &Run) -> Self {
        let history = &run.history;
        let horizontal = history.horizontal_error();
        let loud = history.events.iter().filter(|e| e.level > Level::Info).count() as u64;
        Self {
            letter: run.letter.clone(),
            origin: run.origin.clone(),
            scenario: history.name.clone(),
            version: history.version.clone(),
            seed: history.seed,
            duration_s: history.span().map_or(0.0, |[from, to]| to - from),
            distance_m: history.distance(),
            final_error_m: horizontal.map(|(last, ..)| last),
            rms_error_m: horizontal.map(|(_, rms, _)| rms),
            warnings: loud,
            verdict: history.verdict.as_ref().map(|v| v.level),
            severity: history.verdict.as_ref().map(Verdict::severity),
            verdict_text: history.verdict.as_ref().map(ToString::to_string),
        }
    }
}

/// The look of the k-th run: blue, green, vermilion, sky blue and grey. The first two are far from
/// the orange of the truth and from each other.
pub(crate) fn look(k: usize) -> Look {
    Look::Data([0, 2, 1, 3, 4][k % 5])
}

/// The names that any of the runs has, in the order of the first run that has them.
pub(crate) fn union<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut all: Vec<&str> = Vec::new();
    for name in names {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

fn sensors(runs: &[Run]) -> Vec<SensorResult> {
    let all = runs.iter().flat_map(|run| &run.history.sensors);
    let measuring = all.filter(|s| s.measures()).map(|s| s.name.as_str());
    let result = |name: &str| SensorResult {
        sensor: name.to_owned(),
        runs: runs.iter().map(|run| counts(&run.history, name)).collect(),
    };
    union(measuring).into_iter().map(result).collect()
}

fn counts(history: &RunHistory, name: &str) -> Option<SensorCounts> {
    let updates = &history.sensor(name)?.updates;
    let judged = history.verdict.as_ref().and_then(|v| v.sensor(name));
    Some(SensorCounts {
        used: updates.outcomes.accepted,
        gated: updates.outcomes.gated,
        rejected: updates.outcomes.all_rejected(),
        mean_nis: (updates.outcomes.accepted > 0)
            .then(|| updates.nis[0] / updates.outcomes.accepted as f64),
        expected_nis: judged.map(|s| s.expected_nis),
        inside: judged.is_none_or(|s| s.inside),
    })
}

/// The names of the blocks that any of the runs estimated.
pub(crate) fn estimated(runs: &[Run]) -> Vec<&str> {
    let blocks = runs.iter().flat_map(|run| &run.history.blocks);
    union(blocks.filter(|b| b.uncertain()).map(|b| b.name.as_str()))
}

fn states(runs: &[Run]) -> Vec<StateResult> {
    let mut states = Vec::new();
    for name in estimated(runs) {
        let blocks: Vec<Option<&BlockHistory>> =
            runs.iter().map(|run| run.history.block(name)).collect();
        let Some(model) = blocks.iter().flatten().next() else { continue };
        for k in 0..model.components.len() {
            states.push(StateResult {
                state: title(model, k),
                unit: model.unit.clone(),
                runs: blocks.iter().map(|b| Some(numbers((*b)?, k, blocks[0]))).collect(),
            });
        }
    }
    states
}

/// The block and the component in the words of sigma and error.
pub(crate) fn title(block: &BlockHistory, k: usize) -> String {
    if block.components.len() == 1 {
        return block.name.clone();
    }
    format!("{} {}", block.name, block.axis(k))
}

fn numbers(block: &BlockHistory, k: usize, first: Option<&BlockHistory>) -> StateNumbers {
    let last = |b: &BlockHistory| {
        let row = b.compared.as_ref().filter(|_| b.compared_to_the_end());
        row.and_then(|r| r.error.get(k).copied())
    };
    let before = first.filter(|f| !std::ptr::eq(*f, block));
    let before = before.filter(|f| (f.last.time - block.last.time).abs() <= SAME_END);
    let difference = before.and_then(|first| match (last(block), last(first)) {
        (Some(error), Some(before)) => Some(error - before),
        _ => between(block, &block.last.estimate, &first.last.estimate, k),
    });
    let sigma = block.last.sigma[k];
    let together = before.map(|f| sigma.hypot(f.last.sigma.get(k).copied().unwrap_or(f64::NAN)));
    StateNumbers {
        estimate: block.last.estimate[k],
        sigma,
        error: last(block),
        rms_error: block.rms(k),
        difference,
        difference_sigma: together.filter(|_| difference.is_some()),
    }
}

/// The difference of a component of two estimates: north, east, down of a position, m, and an angle
/// by the shorter way round.
pub(crate) fn between(block: &BlockHistory, to: &[f64], from: &[f64], k: usize) -> Option<f64> {
    if block.geodetic {
        return Some(displacement(to, from)[k]);
    }
    let difference = to.get(k)? - from.get(k)?;
    if block.unit != "deg" {
        return Some(difference);
    }
    Some(difference - TURN * (difference / TURN).round())
}
