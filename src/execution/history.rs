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
use navfuse_report::{Recorder, RunHistory};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

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
    let mut assembly = scenario.assemble(None)?;
    assembly.sinks.push(("report".to_owned(), Box::new(Recorder::default())));
    assembly.sinks.extend(sinks);
    let mut finished = runner::run(assembly, stop, |progress| bar.run(progress));
    bar.done();
    output::run::events(&finished.events);
    let recorder = finished.take_sink::<Recorder>().unwrap_or_default();
    let history = recorder.into_history();
    let end = match finished.error.take() {
        // the history shows everything that was estimated before the error
        Some(error) if history.blocks.is_empty() => return Err(CommandError::from(error)),
        Some(_) => End::Failed,
        None if finished.interrupted => End::Interrupted,
        None => End::Whole,
    };
    Ok((history, end, finished))
}
