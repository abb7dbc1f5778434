//! `navfuse report`.

use crate::error::{CommandError, Result};
use crate::execution::history::{End, observability, run, tracker};
use crate::execution::input::{
    document, document_of, has_extension, log_of, missing_log, runs_folder,
};
use crate::execution::sensitivity::sensitivity;
use crate::output;
use crate::output::progress::{Bar, stop_on_signal};
use clap::Args;
use navfuse_core::input::open;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_observability::ObservabilityReport;
use navfuse_report::RunHistory;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Arguments of `report`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse report runs/dive              writes runs/dive/report.html
  navfuse report dive.toml --set seed=7     runs it first, then writes the same
  navfuse report dive.mcap --out dive.html

The page has the track, every state with its bounds of 3 sigma and the truth where it is known, \
the innovations with their gates, the accepted and rejected samples of each sensor, the \
calibration before and after, the events and the scenario. It is one file and needs no network.")]
pub struct Report {
    /// A log, which is an MCAP file that navfuse wrote, the folder of a run with one, or a scenario, a TOML
    /// file
    #[arg(value_name = "SCENARIO|LOG")]
    pub of: PathBuf,
    /// The page [default: report.html beside the log, or in runs/NAME of the scenario]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Add what the result would move by if each thing that the scenario does not model had its usual
    /// size; some 20 further runs
    #[arg(long)]
    pub sensitivity: bool,
}

/// The content of a page, and the folder that it is written to by default.
struct Content {
    history: RunHistory,
    observed: Option<ObservabilityReport>,
    folder: PathBuf,
    end: End,
}

/// Writes a page about a run.
pub fn report(registry: &Registry, arguments: &Report) -> Result<ExitCode> {
    if let Some(out) = &arguments.out {
        output::check(out)?;
    }
    let (stop, bar) = (stop_on_signal(), Bar::new(true));
    let of_scenario_file = has_extension(&arguments.of, "toml") || arguments.of.as_os_str() == "-";
    let Content { history, observed, folder, end } = if of_scenario_file {
        of_scenario(registry, arguments, &stop, &bar)?
    } else {
        of_log(registry, arguments, &stop, &bar)?
    };
    bar.done();
    let page = navfuse_report::page::report(&history, observed.as_ref())?;
    let out = arguments.out.clone().unwrap_or_else(|| folder.join("report.html"));
    output::write(&out, &page)?;
    for warning in &history.warnings {
        output::warn(format_args!("warning: {warning}"));
    }
    output::line(out.display());
    if let Some(verdict) = &history.verdict {
        output::run::verdict(verdict);
    }
    Ok(end.code())
}

/// Runs a scenario for its page.
fn of_scenario(
    registry: &Registry,
    arguments: &Report,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<Content> {
    let document = document(&arguments.of)?;
    let sinks = vec![tracker()];
    let copy = document.clone();
    let (mut history, end, mut finished) =
        run(registry, document, &arguments.set, sinks, stop, bar)?;
    if arguments.sensitivity && end == End::Whole {
        history.sensitivity = Some(sensitivity(registry, copy, &arguments.set, None, stop, bar)?);
    }
    let whole = end != End::Interrupted;
    let observed = whole.then(|| observability(&history.name, &mut finished)).flatten();
    let folder = runs_folder(&history.name);
    Ok(Content { history, observed, folder, end })
}

/// Reads a log for its page.
fn of_log(
    registry: &Registry,
    arguments: &Report,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<Content> {
    if !arguments.set.is_empty() {
        let message = "the page shows a log as it was recorded; `navfuse replay` runs the filter \
                       again";
        return Err(CommandError::argument("--set", message));
    }
    let log = &log_of(&arguments.of)?;
    let _held = open(log).map_err(missing_log(log))?;
    let mut history = navfuse_report::read_log(log, |read| bar.log(read))?;
    let observed = filter_again(registry, arguments, &mut history, stop, bar)?;
    let folder = log.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    Ok(Content { history, observed, folder, end: End::Whole })
}

/// The observability of the run in a log, for which the filter runs again on the samples. None
/// where it cannot run, as for a log of another program with more types. The same run gives the
/// verdict to the history of a log that holds none.
fn filter_again(
    registry: &Registry,
    arguments: &Report,
    history: &mut RunHistory,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<Option<ObservabilityReport>> {
    let (document, settings) = match document_of(&arguments.of) {
        Ok(found) => found,
        Err(error) => return Ok(without_observability(&error)),
    };
    let scenario = Scenario::new(registry, document.clone(), &settings)?;
    let mut assembly = match scenario.assemble(None) {
        Ok(assembly) => assembly,
        Err(error) => return Ok(without_observability(&error)),
    };
    assembly.sinks.push(tracker());
    let mut finished = runner::run(assembly, stop, |progress| bar.run(progress));
    bar.done();
    if !finished.interrupted {
        history.verdict.get_or_insert_with(|| finished.summary.verdict.clone());
    }
    if arguments.sensitivity && !finished.interrupted {
        history.sensitivity = Some(sensitivity(registry, document, &settings, None, stop, bar)?);
    }
    Ok(observability(&scenario.name(), &mut finished))
}

/// Warns that the page has no verdicts of observability.
fn without_observability(reason: &dyn std::fmt::Display) -> Option<ObservabilityReport> {
    output::warn(format_args!("warning: the page is without verdicts of observability: {reason}"));
    None
}
