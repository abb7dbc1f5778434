//! Running a scenario for its history, as `report` and `figures` do it.

use crate::error::{CommandError, Result};
use crate::output;
use crate::output::progress::{Bar, INTERRUPTED};
use navfuse_core::document::Document;
use navfuse_core::model::stream::Sink;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use navfuse_observability::{ObservabilityReport, Tracker, TrackerSink};
use navfuse_report::{Recorder, RunHistory};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Interval at which the observability is examined, s.
const EVERY: f64 = 1.0;

/// The end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// With its last sample.
    Whole,
    /// By Ctrl-C.
    Interrupted,
    /// By an error, which has been printed.
    Failed,
}

impl End {
    /// The exit code of the command.
    pub fn code(self) -> ExitCode {
        match self {
            Self::Whole => ExitCode::SUCCESS,
            Self::Interrupted => ExitCode::from(INTERRUPTED),
            Self::Failed => ExitCode::FAILURE,
        }
    }
}

/// Runs a scenario for its history; `sinks` are further sinks, which the result gives back.
pub fn run(
    registry: &Registry,
    document: Document,
    settings: &[String],
    sinks: Vec<(String, Box<dyn Sink>)>,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<(RunHistory, End, Finished)> {
    let scenario = Scenario::new(registry, document, settings)?;
    let (history, mut finished) = recorded(&scenario, sinks, stop, bar)?;
    output::run::events(&finished.events);
    let end = match finished.error.take() {
        // the history shows everything that was estimated before the error
        Some(error) if history.blocks.is_empty() => return Err(CommandError::from(error)),
        Some(_) => End::Failed,
        None if finished.interrupted => End::Interrupted,
        None => End::Whole,
    };
    Ok((history, end, finished))
}

/// Runs a scenario for its history, and prints nothing.
pub fn recorded(
    scenario: &Scenario<'_>,
    sinks: Vec<(String, Box<dyn Sink>)>,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<(RunHistory, Finished)> {
    let mut assembly = scenario.assemble(None)?;
    assembly.sinks.push(("report".to_owned(), Box::new(Recorder::default())));
    assembly.sinks.extend(sinks);
    let mut finished = runner::run(assembly, stop, |progress| bar.run(progress));
    bar.done();
    let recorder = finished.take_sink::<Recorder>().unwrap_or_default();
    Ok((recorder.into_history(), finished))
}

/// The sink that follows what a run determines.
pub fn tracker() -> (String, Box<dyn Sink>) {
    ("observability".to_owned(), Box::new(TrackerSink::new(EVERY)))
}

/// The observability of a run with a [`tracker`]; none where the filter did not start.
pub fn observability(name: &str, finished: &mut Finished) -> Option<ObservabilityReport> {
    let tracker = TrackerSink::take(finished).filter(Tracker::started);
    tracker.map(|tracker| ObservabilityReport::new(name, &tracker))
}
