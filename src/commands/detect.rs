//! `navfuse detect`.

use crate::error::{CommandError, Result};
use crate::execution::campaign::threads;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::{self, Format};
use clap::Args;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_diagnose::{Kinds, Options};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Arguments of `detect`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse detect docs/detection/kinds.toml
  navfuse detect kinds.toml --only gyro --runs 30 --format json
  navfuse detect docs/detection/*.toml --data ../data     all faults

The command puts each kind of fault of the file into its scenario. It prints the verdict beside \
the evidence in the innovations, which is twice the logarithm of the likelihood ratio of a \
filter that knows the fault. Below 22.6 no test can find a fault. A second table counts false \
alarms, misses and wrong names.")]
pub struct Detect {
    /// The files of kinds of faults, TOML
    #[arg(required = true)]
    pub kinds: Vec<PathBuf>,
    /// Folder with the recordings of kinds that have one; without it they are left out
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Runs of each kind, with the seeds from 1 on
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    pub runs: u64,
    /// Only kinds whose names contain this text
    #[arg(long, value_name = "TEXT", default_value = "")]
    pub only: String,
    /// Number of threads [default: one a core]
    #[arg(long)]
    pub jobs: Option<usize>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Prints the verdict on each kind of fault.
pub fn detect(registry: &Registry, arguments: &Detect) -> Result<ExitCode> {
    let options = Options { threads: threads(arguments.jobs)?, seconds: f64::INFINITY };
    let mut kinds = Kinds::default();
    for path in &arguments.kinds {
        kinds.kind.extend(Kinds::of(&Document::from_file(path)?)?.kind);
    }
    for recording in kinds.find_recordings(arguments.data.as_deref()) {
        output::warn(format_args!(
            "warning: the kinds of the recording {} are left out: there is no such folder below --data",
            recording.display()
        ));
    }
    kinds.kind.retain(|kind| kind.name.contains(&arguments.only));
    if kinds.kind.is_empty() {
        let message = "no kind has this text in its name; the file lists the kinds";
        return Err(CommandError::argument(format!("--only {}", arguments.only), message));
    }
    let text = arguments.format == Format::Text;
    let (stop, bar) = (stop_on_signal(), Bar::new(text));
    let show = |done, all| bar.trials(done, all);
    let rows = navfuse_diagnose::detect(registry, &kinds, arguments.runs, &options, &stop, &show);
    bar.done();
    let rows = rows?;
    if text {
        output::detect::print(&rows);
    } else {
        output::line(serde_json::to_string(&rows)?);
    }
    Ok(if stop.load(Ordering::Relaxed) { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}
