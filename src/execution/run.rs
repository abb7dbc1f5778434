//! One run of a scenario, as `run` and `replay` do it.

use crate::error::{CommandError, Result};
use crate::execution::input::runs_folder;
use crate::execution::sensitivity::sensitivity;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::terminal::Detail;
use crate::output::{self, Format};
use clap::Args;
use navfuse_core::document::{Document, key, quoted};
use navfuse_core::files::FolderLock;
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::model::record::{Event, Level};
use navfuse_core::plugin::{Kind, Registry};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use navfuse_core::session::summary::Recorded;
use navfuse_core::units::time::Time;
use navfuse_diagnose::Sensitivity;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Type of the sink for the rerun viewer.
const VIEWER: &str = "rerun";

/// Exit code of a run whose verdict is "do not use".
pub const INCONSISTENT: u8 = 3;

/// Options of a run.
#[derive(Clone, Debug, Args)]
pub struct RunOptions {
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Folder for the log and the recording [default: runs/NAME of the scenario]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Write nothing: no log, no recording
    #[arg(long, conflicts_with_all = ["out", "rerun", "connect", "serve"])]
    pub no_output: bool,
    /// Exit with 0 instead of 3 where the verdict is "do not use"
    #[arg(long)]
    pub accept_inconsistent: bool,
    /// Print what the result would move by if each thing that the scenario does not model had its
    /// usual size; some 20 further runs
    #[arg(long)]
    pub sensitivity: bool,
    #[command(flatten)]
    pub live: Live,
}

/// The viewer that shows a run while it goes on.
#[derive(Clone, Debug, Args)]
#[group(multiple = false)]
pub struct Live {
    /// Start the rerun viewer and show the run in it while it goes on
    #[arg(long)]
    pub rerun: bool,
    /// Show the run in a rerun viewer that already runs at this address
    #[arg(long, value_name = "ADDR")]
    pub connect: Option<String>,
    /// Serve the run to web browsers until Ctrl-C
    #[arg(long)]
    pub serve: bool,
}

impl Live {
    /// The option, and the assignment that it makes in the table of the sink.
    fn assignment(&self) -> Option<(&'static str, String)> {
        match (self.rerun, &self.connect, self.serve) {
            (true, _, _) => Some(("--rerun", "spawn=true".to_owned())),
            (_, Some(address), _) => Some(("--connect", format!("connect={}", quoted(address)))),
            (_, _, true) => Some(("--serve", "serve=true".to_owned())),
            _ => None,
        }
    }
}

/// Runs the scenario of a document; `first` are settings that come before those of the options.
pub fn execute(
    registry: &Registry,
    document: Document,
    first: &[String],
    options: &RunOptions,
) -> Result<ExitCode> {
    let settings = [first, &options.set].concat();
    let mut scenario = Scenario::new(registry, document.clone(), &settings)?;
    if let Some((option, assignment)) = options.live.assignment() {
        let sink = viewer(registry, &scenario, option)?;
        scenario.set(&format!("sink.{sink}.{assignment}"))?;
    }
    let folder = output_folder(&scenario, options);
    let _lock = folder.as_deref().map(FolderLock::take).transpose()?;
    let mut assembly = scenario.assemble(folder.as_deref())?;
    if Detail::get() == Detail::Verbose {
        assembly.sinks.push(("notes".to_owned(), Box::new(output::run::Notes)));
    }
    let stop = stop_on_signal();
    let text = options.format == Format::Text;
    let bar = Bar::new(text);
    let finished = runner::run(assembly, &stop, |progress| bar.run(progress));
    bar.done();
    let asked = options.sensitivity && finished.error.is_none() && !finished.interrupted;
    let found = asked.then(|| sensitivity(registry, document, &settings, None, &stop, &bar));
    print(&finished, &finished.events, found.transpose()?.as_ref(), text)?;
    if options.live.serve && !finished.interrupted {
        wait(&stop);
    }
    Ok(exit_code(&finished, options.accept_inconsistent))
}

/// The name of the one sink of the viewer's type, as a key in TOML.
fn viewer(registry: &Registry, scenario: &Scenario<'_>, option: &str) -> Result<String> {
    if registry.get(Kind::Sink, VIEWER).is_none() {
        return Err(CommandError::argument(
            option,
            "this navfuse was built without the rerun viewer; build it with `--features rerun`",
        ));
    }
    let sinks = scenario.sinks_of_type(VIEWER)?;
    match &sinks[..] {
        [sink] => Ok(key(sink)),
        [] => Err(CommandError::argument(
            option,
            "the scenario disables its sink of type rerun; set `enabled` of that sink to true",
        )),
        [one, ..] => Err(CommandError::argument(
            option,
            format!(
                "there are {} sinks of type rerun: [sink.{}]; disable all but one, such as with \
                 --set sink.{one}.enabled=false",
                sinks.len(),
                sinks.join("], [sink.")
            ),
        )),
    }
}

/// The folder that the sinks write into.
fn output_folder(scenario: &Scenario<'_>, options: &RunOptions) -> Option<PathBuf> {
    let default = || runs_folder(&scenario.name());
    (!options.no_output).then(|| options.out.clone().unwrap_or_else(default))
}

/// Prints the result of a run with its sensitivities, and these of its warnings and errors.
pub fn print(
    finished: &Finished,
    events: &[Event],
    found: Option<&Sensitivity>,
    text: bool,
) -> Result<()> {
    if text {
        if !Detail::is_quiet() {
            output::run::summary(&finished.summary);
            output::run::recorded(&finished.recorded);
        }
        found.into_iter().for_each(output::sensitivity::print);
    } else {
        let mut result = summary(finished)?;
        if let Some(found) = found {
            result["sensitivity"] = serde_json::to_value(found)?;
        }
        output::line(result);
    }
    let verdict = &finished.summary.verdict;
    // the reasons of the verdict follow
    if text && !Detail::is_quiet() {
        output::run::events(&output::run::unstated(events, verdict));
    } else {
        output::run::events(events);
    }
    if text {
        output::run::verdict(verdict);
    }
    Ok(())
}

/// The result of a run as `run --format json` prints it: the summary, its frame, the places of the
/// files, the findings, and the warnings and errors.
///
/// # Errors
/// When a number has no JSON.
pub fn summary(finished: &Finished) -> Result<Value> {
    let mut value = serde_json::to_value(&finished.summary)?;
    // `axes = "enu"` is a choice of a table; the state of the filter is always north, east, down
    value["frame"] = "ned".into();
    let path = |r: &Recorded| json!({ "sink": r.sink, "path": r.place });
    value["paths"] = finished.recorded.iter().map(path).collect();
    let seconds = |time: Time| (time > Time::MIN).then(|| time.seconds());
    let finding = |f: &Finding| {
        json!({
            "time_s": seconds(f.time), "about": f.about, "severity": f.severity.name(),
            "basis": f.basis.name(), "text": f.text, "remedy": f.remedy,
        })
    };
    value["findings"] = finished.findings.iter().map(finding).collect();
    let warning = |e: &Event| {
        let time = seconds(e.time);
        json!({ "time_s": time, "level": e.level, "about": e.about, "text": e.text })
    };
    value["warnings"] = finished.events.iter().map(warning).collect();
    Ok(value)
}

/// Keeps the process alive until Ctrl-C, so that browsers can still load the run.
fn wait(stop: &AtomicBool) {
    output::warn("serving until Ctrl-C");
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
}

fn exit_code(finished: &Finished, accept_inconsistent: bool) -> ExitCode {
    let unusable = finished.summary.verdict.level == VerdictLevel::DoNotUse;
    match (&finished.error, finished.interrupted) {
        (Some(_), _) => ExitCode::FAILURE,
        (None, true) => ExitCode::from(INTERRUPTED),
        (None, false) if finished.events.iter().any(|e| e.level == Level::Error) => {
            ExitCode::FAILURE
        }
        (None, false) if unusable && !accept_inconsistent => ExitCode::from(INCONSISTENT),
        (None, false) => ExitCode::SUCCESS,
    }
}
