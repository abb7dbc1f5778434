//! `navfuse report`.

use crate::print;
use crate::progress::{Bar, INTERRUPTED, stop_on_ctrl_c};
use crate::run::{document_of, folder_name};
use clap::Args;
use navfuse_core::document::Document;
use navfuse_core::model::stream::Sink;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_observability::{ObservabilityReport, Tracker, TrackerSink};
use navfuse_report::{History, Recorder};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// How often what is determined is looked at, s.
const EVERY: f64 = 1.0;

/// Arguments of `report`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse report runs/pan-wu-3d/run.mcap                     writes runs/pan-wu-3d/report.html
  navfuse report scenarios/pan-wu-3d.toml --set seed=7       runs it first; writes runs/pan-wu-3d/report.html
  navfuse report dive.mcap --out dive.html

The page has the track, every state with its bounds of 3 sigma and the truth where that is known, the innovations with their
gates, what became of each sensor's samples, the calibration before and after, the events and the scenario. It is one file
that needs neither network nor script; print it to have it on paper.")]
pub struct Report {
    /// A log, which is an MCAP file that navfuse wrote, or a scenario, a TOML file
    pub of: PathBuf,
    /// The page [default: report.html beside the log, or in runs/NAME of the scenario]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
}

/// `navfuse report`
pub fn report(registry: &Registry, arguments: &Report) -> Result<ExitCode> {
    let stop = stop_on_ctrl_c();
    let bar = Bar::new(true);
    let of = &arguments.of;
    let (history, observed, folder, end) = if of
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
    {
        let document = Document::from_file(of)?;
        let (watch, kept) = TrackerSink::new(EVERY);
        let sinks: [(String, Box<dyn Sink>); 1] = [("observability".to_owned(), Box::new(watch))];
        let (history, end) = run(registry, document, &arguments.set, sinks, &stop, &bar)?;
        let observed = if end == End::Interrupted { None } else { judged(&history.name, &kept) };
        let folder = Path::new("runs").join(folder_name(&history.name));
        (history, observed, folder, end)
    } else {
        if !arguments.set.is_empty() {
            let message =
                "a log is told as it was recorded; `navfuse replay` runs the filter again";
            return Err(format!("--set: {message}").into());
        }
        let history = navfuse_report::read_log(of, |read| bar.log(read))?;
        let observed = observed(registry, of, &stop, &bar)?;
        (history, observed, of.parent().map_or_else(PathBuf::new, Path::to_path_buf), End::Whole)
    };
    bar.done();
    let page = navfuse_report::page::report(&history, observed.as_ref())?;
    let out = arguments.out.clone().unwrap_or_else(|| folder.join("report.html"));
    write(&out, &page)?;
    for warning in &history.warnings {
        print::warn(format_args!("warning: {warning}"));
    }
    print::line(out.display());
    Ok(end.code())
}

/// What the run of a log determines of each state, by running the filter again on its samples. None where that cannot be, as of
/// a log that another program with more types wrote.
fn observed(
    registry: &Registry,
    log: &Path,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<Option<ObservabilityReport>> {
    let (document, settings) = match document_of(log) {
        Ok(found) => found,
        Err(error) => return unjudged(&*error),
    };
    let scenario = Scenario::new(registry, document, &settings)?;
    let mut assembly = match scenario.assemble(None) {
        Ok(assembly) => assembly,
        Err(error) => return unjudged(&error),
    };
    let (watch, kept) = TrackerSink::new(EVERY);
    assembly.sinks.push(("observability".to_owned(), Box::new(watch)));
    runner::run(assembly, stop, |progress| bar.run(progress));
    bar.done();
    Ok(judged(&scenario.name(), &kept))
}

/// What a watched run determined; nothing where the filter did not start.
fn judged(name: &str, kept: &Mutex<Option<Tracker>>) -> Option<ObservabilityReport> {
    let tracker = kept.lock().ok().and_then(|mut kept| kept.take());
    tracker.filter(Tracker::started).map(|tracker| ObservabilityReport::new(name, &tracker))
}

/// Says why the states are not judged.
fn unjudged(why: &dyn std::fmt::Display) -> Result<Option<ObservabilityReport>> {
    print::warn(format_args!("warning: the page is without verdicts of observability: {why}"));
    Ok(None)
}

/// How a run ended.
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
    /// What the command exits with.
    pub fn code(self) -> ExitCode {
        match self {
            Self::Whole => ExitCode::SUCCESS,
            Self::Interrupted => ExitCode::from(INTERRUPTED),
            Self::Failed => ExitCode::FAILURE,
        }
    }
}

/// Runs a scenario for its history, with more sinks.
pub fn run(
    registry: &Registry,
    document: Document,
    settings: &[String],
    sinks: impl IntoIterator<Item = (String, Box<dyn Sink>)>,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<(History, End)> {
    let scenario = Scenario::new(registry, document, settings)?;
    let mut assembly = scenario.assemble(None)?;
    let (recorder, history) = Recorder::new();
    assembly.sinks.push(("report".to_owned(), Box::new(recorder)));
    assembly.sinks.extend(sinks);
    let finished = runner::run(assembly, stop, |progress| bar.run(progress));
    bar.done();
    print::events(&finished.events);
    let history = history.recv()?;
    match finished.error {
        // what was estimated until then is told
        Some(error) if history.blocks.is_empty() => Err(error.into()),
        Some(_) => Ok((history, End::Failed)),
        None if finished.interrupted => Ok((history, End::Interrupted)),
        None => Ok((history, End::Whole)),
    }
}

/// Writes a file, and the folder that it is in.
pub fn write(path: &Path, text: &str) -> Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let written =
        folder.map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(path, text));
    Ok(written.map_err(|e| {
        format!("{}: cannot be written: {e}; give another place with --out", path.display())
    })?)
}
