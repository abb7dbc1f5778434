//! `navfuse diagnose`.

use crate::error::{CommandError, Result};
use crate::execution::campaign::threads;
use crate::execution::input::{document_of, is_log, log_in};
use crate::execution::run::INCONSISTENT;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::{self, Format, write_files};
use clap::Args;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_diagnose::{Diagnosis, Options, Trial};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Time for the runs of all changes, s; the best ones follow on all samples.
const SECONDS: f64 = 30.0;

/// Arguments of `diagnose`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse diagnose dive.toml
  navfuse diagnose dive.toml --apply mended.toml && navfuse run mended.toml
  navfuse diagnose runs/dive/run.mcap --set sensor.gnss.enabled=false
  navfuse diagnose dive.toml --out runs/diagnosis  a page, and numbers as JSON
  navfuse diagnose dive.toml --format json | jq .trials[0]

The command runs the samples again with each of some hundred changes of the scenario: lags, \
lever arms, biases, noise, units, signs and axes of every sensor, priors, leap seconds, a sensor \
left out. It compares how likely each makes the same samples, and prints the best ones. A change \
is a remedy only if the run with it is consistent.

Exit code 3: neither the scenario nor the best change gives a run that may be used.")]
pub struct Diagnose {
    /// The scenario, a TOML file, or the log of a run
    pub scenario: PathBuf,
    /// Write a copy of the scenario with the best change, beside the scenario
    #[arg(long, value_name = "OUT.toml")]
    pub apply: Option<PathBuf>,
    /// Folder for a page (HTML) and the numbers (JSON)
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Number of threads [default: one a core]
    #[arg(long)]
    pub jobs: Option<usize>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Finds the change of a scenario that explains its samples.
pub fn diagnose(registry: &Registry, arguments: &Diagnose) -> Result<ExitCode> {
    let options = Options { threads: threads(arguments.jobs)?, seconds: SECONDS };
    let of = log_in(&arguments.scenario).unwrap_or_else(|| arguments.scenario.clone());
    let (mut document, first) = document_of(&of)?;
    let settings = [&first[..], &arguments.set].concat();
    settings.iter().try_for_each(|s| document.set(s))?;
    let target = arguments.apply.as_deref();
    target.map_or(Ok(()), |out| check_target(&of, out))?;
    // a setting that cannot be written ends the command here, and not after its runs
    let writes = target.is_some() || arguments.out.is_some();
    let scenario = match writes {
        true => navfuse_diagnose::apply(document.text(), &settings)?,
        false => String::new(),
    };
    let text = arguments.format == Format::Text;
    let (stop, bar) = (stop_on_signal(), Bar::new(text));
    let show = |done, all| bar.trials(done, all);
    let diagnosis = navfuse_diagnose::diagnose(registry, &document, &options, &stop, &show);
    bar.done();
    let diagnosis = diagnosis?;
    if text {
        output::diagnose::print(&diagnosis);
    } else {
        output::line(serde_json::to_string(&diagnosis)?);
    }
    if let Some(out) = &arguments.out {
        let name = Scenario::new(registry, document.clone(), &[])?.name();
        write_page(&name, &scenario, &diagnosis, out, text)?;
    }
    if diagnosis.interrupted {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    match (target, diagnosis.best()) {
        (Some(out), Some(best)) => write(&scenario, best, out, text)?,
        (Some(out), None) => {
            output::warn(format_args!("no change to write: {} is not written", out.display()));
        }
        (None, _) => {}
    }
    Ok(exit_code(&diagnosis))
}

/// Tests that the copy may be written, before the work begins. The paths in a scenario start at its
/// folder; the scenario of a log has the log as its source.
fn check_target(scenario: &Path, out: &Path) -> Result<()> {
    let folder = |path: &Path| {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        std::fs::canonicalize(folder.unwrap_or(Path::new("."))).ok()
    };
    if !is_log(scenario) && folder(scenario) != folder(out) {
        let name = out.file_name().unwrap_or_default();
        let place = scenario.with_file_name(name);
        let message = "the paths in a scenario start at its folder; write the copy beside it";
        let message = format!("{message}: --apply {}", place.display());
        return Err(CommandError::argument(format!("--apply {}", out.display()), message));
    }
    output::check(out)
}

/// Writes the scenario with the best change.
fn write(scenario: &str, best: &Trial, out: &Path, shown: bool) -> Result<()> {
    output::write(out, &navfuse_diagnose::apply(scenario, &best.settings)?)?;
    if shown {
        output::line(format_args!("{}", out.display()));
    }
    Ok(())
}

/// Writes the page of a diagnosis, and its numbers.
fn write_page(
    name: &str,
    scenario: &str,
    diagnosis: &Diagnosis,
    out: &Path,
    shown: bool,
) -> Result<()> {
    let page = navfuse_report::diagnosis::page(name, scenario, diagnosis)?;
    let files = [
        ("diagnosis.json".to_owned(), serde_json::to_string_pretty(diagnosis)?),
        ("diagnosis.html".to_owned(), page),
    ];
    write_files(out, files, shown)
}

fn exit_code(diagnosis: &Diagnosis) -> ExitCode {
    let unusable = |trial: &Trial| trial.level == VerdictLevel::DoNotUse;
    match unusable(&diagnosis.unchanged) && diagnosis.best().is_none_or(unusable) {
        true => ExitCode::from(INCONSISTENT),
        false => ExitCode::SUCCESS,
    }
}
