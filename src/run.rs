//! `navfuse run` and `navfuse replay`.

use crate::arguments::{Format, Replay, Run, RunOptions};
use crate::print;
use crate::progress::{Bar, INTERRUPTED, stop_on_ctrl_c};
use navfuse_core::document::Document;
use navfuse_core::model::record::Level;
use navfuse_core::plugin::{Kind, Registry};
use navfuse_core::run::runner;
use navfuse_core::run::runner::Finished;
use navfuse_core::run::scenario::Scenario;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// `navfuse run`
pub fn run(registry: &Registry, arguments: &Run) -> Result<ExitCode> {
    let document = Document::from_file(&arguments.scenario)?;
    go(registry, document, &[], &arguments.options)
}

/// `navfuse replay`
pub fn replay(registry: &Registry, arguments: &Replay) -> Result<ExitCode> {
    let (document, source) = of_log(&arguments.log, arguments.scenario.as_deref())?;
    let mut options = arguments.options.clone();
    if options.out.is_none() {
        options.out =
            Some(PathBuf::from("runs").join(folder_name(&format!("{}-replay", document.stem()))));
    }
    go(registry, document, &[source], &options)
}

/// The scenario of a log, or another one, and the setting that makes the log its source.
fn of_log(log: &Path, scenario: Option<&Path>) -> Result<(Document, String)> {
    let path = std::fs::canonicalize(log)
        .map_err(|e| format!("{}: cannot be read: {e}", log.display()))?;
    let document = match scenario {
        Some(path) => Document::from_file(path)?,
        None => {
            let info = navfuse_mcap::read_scenario(log)?;
            Document::parse(
                path.with_file_name(format!("{}.toml", folder_name(&info.name)))
                    .display()
                    .to_string(),
                info.scenario,
            )?
        }
    };
    Ok((document, format!("source={{ mcap = {{ path = {:?} }} }}", path.display().to_string())))
}

/// The document of a scenario; of a log, as [`of_log`] with the settings.
pub fn document_of(path: &Path) -> Result<(Document, Vec<String>)> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
        return Ok((Document::from_file(path)?, Vec::new()));
    }
    let (document, source) = of_log(path, None)?;
    Ok((document, vec![source]))
}

fn go(
    registry: &Registry,
    document: Document,
    first: &[String],
    options: &RunOptions,
) -> Result<ExitCode> {
    let mut settings = first.to_vec();
    settings.extend(options.set.iter().cloned());
    settings.extend(live(registry, options)?);
    let scenario = Scenario::new(registry, document, &settings)?;
    let output = output_folder(&scenario, options)?;
    let assembly = scenario.assemble(output.as_deref())?;
    let stop = stop_on_ctrl_c();
    let text = options.format == Format::Text;
    let bar = Bar::new(text);
    let finished = runner::run(assembly, &stop, |progress| bar.run(progress));
    bar.done();
    report(&finished, text)?;
    if options.live.serve && !finished.interrupted {
        print::warn("serving until Ctrl-C");
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
    }
    Ok(match (&finished.error, finished.interrupted) {
        (Some(_), _) => ExitCode::FAILURE,
        (None, true) => ExitCode::from(INTERRUPTED),
        (None, false) if finished.events.iter().any(|e| e.level == Level::Error) => {
            ExitCode::FAILURE
        }
        (None, false) => ExitCode::SUCCESS,
    })
}

/// The settings that show the run live.
fn live(registry: &Registry, options: &RunOptions) -> Result<Vec<String>> {
    let live = &options.live;
    let setting = match (live.rerun, &live.connect, live.serve) {
        (true, _, _) => "sink.rerun.spawn=true".to_owned(),
        (_, Some(address), _) => format!("sink.rerun.connect={address:?}"),
        (_, _, true) => "sink.rerun.serve=true".to_owned(),
        _ => return Ok(Vec::new()),
    };
    if registry.get(Kind::Sink, "rerun").is_none() {
        return Err(
            "this navfuse was built without the rerun viewer; build it with `--features rerun`"
                .into(),
        );
    }
    Ok(vec![setting])
}

/// Makes the folder that the sinks write into.
fn output_folder(scenario: &Scenario<'_>, options: &RunOptions) -> Result<Option<PathBuf>> {
    if options.no_output {
        return Ok(None);
    }
    let folder = options
        .out
        .clone()
        .unwrap_or_else(|| Path::new("runs").join(folder_name(&scenario.name())));
    std::fs::create_dir_all(&folder).map_err(|e| {
        format!(
            "{}: the output folder cannot be made: {e}; give another with --out, or --no-output",
            folder.display()
        )
    })?;
    Ok(Some(folder))
}

/// A scenario's name as the name of a folder: whatever else it holds, it does not lead out of `runs`.
pub fn folder_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(plain).collect();
    let name = name.trim_start_matches('.');
    if name.is_empty() { "run".to_owned() } else { name.to_owned() }
}

fn report(finished: &Finished, text: bool) -> Result<()> {
    if text {
        print::summary(&finished.summary);
        print::recorded(&finished.recorded);
    } else {
        print::line(serde_json::to_string(&finished.summary)?);
    }
    print::events(&finished.events);
    Ok(())
}
