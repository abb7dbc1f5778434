//! Finds the change of a scenario that explains its samples.
//!
//! The scenario is run again with every plausible error put right, such as a lag, a lever arm, a
//! unit or the axes of an instrument, and the likelihoods of the same samples are compared. With the
//! usual size of everything that it does not model, the same runs give the sensitivity of the result.
//! [`budget`] needs no samples: it is the error of dead reckoning by a velocity log and a heading.

mod apply;
mod budget;
mod causes;
mod detect;
mod likeliest;
mod likelihood;
mod parallel;
mod patch;
mod recording;
mod scene;
mod search;
mod sensitivity;
mod trial;

pub use apply::apply;
pub use budget::{Cause, Course, Legs, Share, budget};
pub use detect::{
    Counts, Detection, Finding, Kind, Kinds, Plainness, Row as KindRow, counts, detect,
};
pub use likeliest::likeliest;
pub use sensitivity::{Row, Sensitivity, sensitivity};

use navfuse_core::document::{Document, DocumentError};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::{BuildError, Registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::RunError;
use search::CLEAR;
use serde::Serialize;
use std::sync::atomic::AtomicBool;

/// Extent of a diagnosis.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Number of threads.
    pub threads: usize,
    /// Time for the runs of all changes, s; where they take longer, a part of the samples serves.
    pub seconds: f64,
}

/// The run with one change.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// The change in words.
    pub change: String,
    /// Assignments `key.path=value`, as `--set` takes them.
    pub settings: Vec<String>,
    /// Twice the log-likelihood that the change gains.
    pub gain: f64,
    /// The gain less a penalty for the parameters and choices of the change.
    pub score: f64,
    /// Mean normalised innovation squared of the accepted samples by channel; expected is 1.
    pub mean_nis: f64,
    /// Number of values in that mean.
    pub values: u64,
    /// Level of the verdict.
    pub level: VerdictLevel,
    /// Severity of the heaviest reason of the verdict, which words it.
    #[serde(skip)]
    pub severity: Severity,
    /// Verdict in one line.
    pub verdict: String,
    /// Distance of the position at the end from that of the unchanged scenario, m.
    #[serde(rename = "moved_m")]
    pub moved: Option<f64>,
    /// State that the change makes uncertain, with its 1-sigma.
    pub estimate: Option<String>,
    /// Reason for which no key of the scenario mends the cause in full.
    pub unmended: Option<&'static str>,
}

/// The trials of a scenario.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// The scenario as it is.
    pub unchanged: Trial,
    /// Changes that were tried on all samples, the best first.
    pub trials: Vec<Trial>,
    /// Number of changes that were tried.
    pub tried: usize,
    /// Number of changes that the scenario does not allow.
    pub unfit: usize,
    /// Set if the search was interrupted.
    pub interrupted: bool,
}

impl Trial {
    /// The change in words, with the estimate of the state that it makes uncertain.
    pub fn words(&self) -> String {
        match &self.estimate {
            Some(estimate) => format!("{}: {estimate}", self.change),
            None => self.change.clone(),
        }
    }

    /// The distance between the last positions with and without the change, with the digits that count.
    pub fn moves(&self) -> String {
        match self.moved {
            None => String::new(),
            Some(m) if m < 100.0 => format!("{m:.2} m"),
            Some(m) if m < 10_000.0 => format!("{m:.0} m"),
            Some(m) => format!("{:.0} km", m / 1000.0),
        }
    }
}

impl Diagnosis {
    /// Score by which a change has to lead another one: odds of 150 : 1.
    pub const CLEAR: f64 = CLEAR;

    /// The sentence on the best change.
    pub fn conclusion(&self) -> String {
        let Some(best) = self.best() else {
            return "no change explains the samples better than the scenario as it is".to_owned();
        };
        let what = match best.level {
            VerdictLevel::Consistent => "remedy, with which the run is consistent",
            _ => "the best explanation, not consistent",
        };
        format!("{what}: {}", best.change)
    }

    /// The changes without a clear margin to the best one.
    pub fn rivals(&self) -> Vec<&str> {
        let best = self.best().map(|best| best.change.as_str());
        self.near().map(|trial| trial.change.as_str()).filter(|c| Some(*c) != best).collect()
    }

    /// The best change, if the samples favour one. Among changes without a clear margin, one that
    /// makes the run consistent comes first.
    pub fn best(&self) -> Option<&Trial> {
        let consistent = self.near().find(|t| t.level == VerdictLevel::Consistent);
        consistent.or(self.near().next())
    }

    /// The changes that the samples favour, and between which they do not decide.
    pub fn near(&self) -> impl Iterator<Item = &Trial> {
        let most = self.trials.first().map_or(0.0, |first| first.score);
        let least = search::favoured(self.unchanged.level);
        self.trials.iter().take_while(move |t| t.score >= least && most - t.score < CLEAR)
    }
}

/// The reason for which there is no diagnosis.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// The scenario does not compose.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The scenario cannot be changed.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A source failed.
    #[error("source {name}: {error}")]
    Source {
        /// Its name in the scenario.
        name: String,
        /// The reason.
        #[source]
        error: StreamError,
    },
    /// The run of the scenario as it is ended early.
    #[error("the run ends early: {0}")]
    Run(#[from] RunError),
    /// The text of the scenario is not TOML.
    #[error(transparent)]
    Text(toml_edit::TomlError),
    /// The scenario has a value where the change needs a table, or lacks the array of an element.
    #[error(
        "{0:?} cannot be written into the scenario: its path leads through a value, or to an element that \
         the file does not have; give the whole array, or change the file"
    )]
    Setting(String),
}

/// Runs a scenario with every plausible change, and calls `progress` with the number of runs that
/// are done, and of all.
///
/// # Errors
/// When the scenario does not compose, or its samples cannot be read.
pub fn diagnose(
    registry: &Registry,
    document: &Document,
    options: &Options,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let recording = recording::Recording::read(scenario.assemble(None)?)?;
    let composition = scenario.compose()?;
    let scene = scene::Scene::new(registry, document, &composition, &recording);
    search::Search::new(&scene, options, stop, progress).search()
}
