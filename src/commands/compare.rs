//! `navfuse compare`.

use crate::error::{CommandError, Result};
use crate::execution::history::{End, run};
use crate::execution::input::{document, is_log, log_of, runs_folder};
use crate::output;
use crate::output::Format;
use crate::output::progress::{Bar, stop_on_signal};
use clap::Args;
use navfuse_campaign::variation;
use navfuse_core::plugin::Registry;
use navfuse_report::compare::{Comparison, Run, apart, page, plots};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Letters of the runs. The figures distinguish as many colours.
const LETTERS: [&str; 5] = ["A", "B", "C", "D", "E"];

/// Arguments of `compare`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse compare runs/monday/run.mcap runs/tuesday/run.mcap
  navfuse compare scenarios/quickstart.toml my-quickstart.toml
  navfuse compare dive.toml --vary \"sensor.dvl.noise=5 mm/s,1 cm/s,5 cm/s\"
  navfuse compare dive.toml --vary sensor.gnss.enabled=true,false

The command prints the keys in which the scenarios differ, the states that differ most in sigma, \
the counts of the sensors, and every state at the end: error, rms error, 1-sigma, and the \
difference from the first run with its sigma. It writes compare.html, a page that draws the \
curves of all runs together, and compare.rrd, the same curves on one timeline for the rerun \
viewer, with the vehicles of all runs in one scene. Each scenario or log brings \
its own sources and samples.")]
pub struct Compare {
    /// Two or more runs: logs (MCAP), folders with a run.mcap, or scenarios (TOML), which the command
    /// runs first; or one scenario with --vary
    #[arg(required = true, value_name = "RUN")]
    pub of: Vec<PathBuf>,
    /// A key and its values, one run for each; may be given again, for every combination. A
    /// single value is compared with the unchanged scenario
    #[arg(long, value_name = "KEY.PATH=V1,V2,...")]
    pub vary: Vec<String>,
    /// Change a value of every scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Folder for the page and the recording [default: runs/NAME-compare, NAME of the first run]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Write neither page nor recording
    #[arg(long, conflicts_with = "out")]
    pub no_output: bool,
}

/// A run before it is read or run: the file, and the values that are changed.
struct Request {
    path: PathBuf,
    settings: Vec<String>,
}

/// Compares runs.
pub fn compare(registry: &Registry, arguments: &Compare) -> Result<ExitCode> {
    let requests = requests(arguments)?;
    let text = arguments.format == Format::Text;
    let (stop, bar) = (stop_on_signal(), Bar::new(text));
    let mut runs = Vec::new();
    let mut end = End::Whole;
    for (letter, request) in LETTERS.iter().zip(&requests) {
        let (run, its_end) = gather(registry, letter, request, &arguments.set, &stop, &bar)?;
        runs.push(run);
        if its_end == End::Interrupted {
            return Ok(its_end.code());
        }
        if its_end != End::Whole {
            end = its_end;
        }
    }
    let comparison = Comparison::new(&runs)?;
    let files = match arguments.no_output {
        true => Vec::new(),
        false => {
            let default = || runs_folder(&format!("{}-compare", runs[0].history.name));
            write(&comparison, &runs, &arguments.out.clone().unwrap_or_else(default))?
        }
    };
    if text {
        output::compare::tables(&comparison);
        files.iter().for_each(|path| output::line(path.display()));
    } else {
        let mut json = serde_json::to_value(&comparison)?;
        json["paths"] = files.iter().map(|path| path.display().to_string()).collect();
        output::line(json);
    }
    Ok(end.code())
}

/// The runs that the arguments ask for.
fn requests(arguments: &Compare) -> Result<Vec<Request>> {
    let grid = (arguments.vary.iter()).try_fold(vec![Vec::new()], |grid, vary| {
        let (key, values) = variation(vary)?;
        let extended = grid.iter().flat_map(|before: &Vec<String>| {
            let key = &key;
            values.iter().map(move |v| [&before[..], &[format!("{key}={v}")]].concat())
        });
        Ok::<_, CommandError>(extended.collect())
    })?;
    let mut requests = Vec::new();
    for of in &arguments.of {
        let path = log_of(of)?;
        let changed = arguments.vary.first().or(arguments.set.first());
        if let Some(change) = changed.filter(|_| is_log(&path)) {
            return Err(CommandError::argument(
                change,
                format!(
                    "{} is a log, which is compared as it was recorded; `navfuse replay` runs the \
                     filter again with other values",
                    path.display()
                ),
            ));
        }
        requests.extend(
            grid.iter().map(|settings| Request { path: path.clone(), settings: settings.clone() }),
        );
    }
    if let [varied] = &requests[..]
        && !varied.settings.is_empty()
    {
        requests.insert(0, Request { path: varied.path.clone(), settings: Vec::new() });
    }
    match requests.len() {
        0 | 1 => Err(CommandError::Request(
            "one run has nothing to be compared with: name two or more, or give --vary \
             KEY.PATH=V1,V2"
                .to_owned(),
        )),
        n if n > LETTERS.len() => Err(CommandError::Request(format!(
            "{n} runs are more than the {} whose curves have different colours; compare fewer of \
             them, or use `navfuse sweep`",
            LETTERS.len()
        ))),
        _ => Ok(requests),
    }
}

/// Reads a log, or runs a scenario.
fn gather(
    registry: &Registry,
    letter: &str,
    request: &Request,
    common: &[String],
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<(Run, End)> {
    let settings = [common, &request.settings].concat();
    let (history, end) = if is_log(&request.path) {
        let history = navfuse_report::read_log(&request.path, |read| bar.log(read))?;
        bar.done();
        (history, End::Whole)
    } else {
        let document = document(&request.path)?;
        let (history, end, _) = run(registry, document, &settings, Vec::new(), stop, bar)?;
        (history, end)
    };
    for warning in &history.warnings {
        output::warn(format_args!("warning: {}: {warning}", request.path.display()));
    }
    let path = request.path.display().to_string();
    let origin = [&[path], &request.settings[..]].concat().join(" ");
    Ok((Run { letter: letter.to_owned(), origin, history }, end))
}

/// Writes the page, and the recording where navfuse has the viewer; returns their paths.
fn write(comparison: &Comparison, runs: &[Run], folder: &Path) -> Result<Vec<PathBuf>> {
    let (largest, figures) = (apart::figure(runs), plots::figures(runs));
    let path = folder.join("compare.html");
    output::write(&path, &page::comparison(comparison, largest.as_ref(), &figures)?)?;
    #[cfg(feature = "rerun")]
    {
        use navfuse_report::compare::overview;
        use navfuse_viewer::figures::{Overview, record};
        let recording = folder.join("compare.rrd");
        let letters: Vec<&str> = runs.iter().map(|r| r.letter.as_str()).collect();
        let name = format!("comparison of {}", letters.join(", "));
        let tracks = plots::tracks(runs);
        let overview = Overview { page: &overview::page(comparison), figure: largest.as_ref() };
        record(&recording, &name, Some(&overview), &tracks, &figures)?;
        Ok(vec![path, recording])
    }
    #[cfg(not(feature = "rerun"))]
    Ok(vec![path])
}
