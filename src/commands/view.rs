//! `navfuse view`.

use crate::error::{CommandError, Result};
use crate::execution::input::{has_extension, is_log, of_log};
use crate::output;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use clap::Args;
use navfuse_core::document::{key, quoted};
use navfuse_core::files::FolderLock;
use navfuse_core::plugin::{Kind, Registry};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_viewer::viewer;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `view`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse view runs/quickstart             the recording of a run, by its folder
  navfuse view runs/quickstart/run.mcap    the same, or the log converted to one
  navfuse view runs/quickstart-compare/compare.rrd

The viewer is the program `rerun`, or the one in the environment variable RERUN_BIN. A log is \
converted by running its filter again, and the recording is kept beside it.")]
pub struct View {
    /// A folder of a run, a log (MCAP), or a recording (RRD)
    #[arg(value_name = "RUN")]
    pub of: PathBuf,
}

/// Opens the recording of a run in the viewer.
pub fn view(registry: &Registry, arguments: &View) -> Result<ExitCode> {
    let found = found(&arguments.of)?;
    // a missing viewer is reported before a long log is converted
    let viewer = viewer::find()?;
    let recording = match found {
        Found::Recording(path) => path,
        Found::Log(log) => match convert(registry, &log)? {
            Some(recording) => recording,
            None => return Ok(ExitCode::from(INTERRUPTED)),
        },
    };
    for warning in &viewer.warnings {
        output::warn(format_args!("warning: {warning}"));
    }
    viewer.open(&recording)?;
    output::line(recording.display());
    Ok(ExitCode::SUCCESS)
}

/// What there is to be shown.
enum Found {
    Recording(PathBuf),
    Log(PathBuf),
}

/// The recording that belongs to a path, or the log where there is none.
fn found(path: &Path) -> Result<Found> {
    let cannot = |message: &str| Err(CommandError::argument(path.display().to_string(), message));
    if path.is_dir() {
        let [recording, log] = ["run.rrd", "run.mcap"].map(|name| path.join(name));
        return match (recording.is_file(), log.is_file()) {
            (true, _) => Ok(Found::Recording(recording)),
            (_, true) => Ok(Found::Log(log)),
            _ => cannot("the folder has neither run.rrd nor run.mcap; name a file"),
        };
    }
    if !path.is_file() {
        return cannot("there is no such file; `navfuse run` writes runs/NAME/run.rrd");
    }
    if is_log(path) {
        let recording = path.with_extension("rrd");
        let there = recording.is_file();
        return Ok(if there { Found::Recording(recording) } else { Found::Log(path.to_owned()) });
    }
    if has_extension(path, "rrd") {
        return Ok(Found::Recording(path.to_owned()));
    }
    cannot("neither a log (.mcap) nor a recording (.rrd); run a scenario first, with `navfuse run`")
}

/// Runs the filter again on the samples of a log, for a recording beside it. None where the user
/// ends it.
fn convert(registry: &Registry, log: &Path) -> Result<Option<PathBuf>> {
    let (document, source) = of_log(log, None)?;
    let recording = log.with_extension("rrd");
    let name = recording.file_name().unwrap_or_default().to_string_lossy().into_owned();
    // of the sinks, the viewer's alone writes
    let off = registry.entries().filter(|e| e.kind == Kind::Sink);
    let sinks = off.map(|e| match &*e.name {
        "rerun" => format!("rerun = {{ path = {} }}", quoted(&name)),
        other => format!("{} = {{ enabled = false }}", key(other)),
    });
    let sinks = format!("sink={{ {} }}", sinks.collect::<Vec<_>>().join(", "));
    let scenario = Scenario::new(registry, document, &[source, sinks])?;
    let folder = log.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let _lock = FolderLock::take(folder)?;
    // before the recording exists: a signal would leave a part of it
    let stop = stop_on_signal();
    let assembly = scenario.assemble(Some(folder))?;
    let bar = Bar::new(true);
    let finished = runner::run(assembly, &stop, |progress| bar.run(progress));
    bar.done();
    output::run::events(&finished.events);
    if finished.interrupted {
        // the next call would show the part as the whole run
        std::fs::remove_file(&recording).ok();
        return Ok(None);
    }
    match finished.error {
        Some(error) if !recording.is_file() => return Err(error.into()),
        Some(error) => output::warn(format_args!("warning: the run ended early: {error}")),
        None => {}
    }
    Ok(Some(recording))
}
