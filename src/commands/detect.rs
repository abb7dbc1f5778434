//! `navfuse detect`.

use crate::error::{CommandError, Result};
use crate::execution::campaign::threads;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::{self, Format};
use clap::Args;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_diagnose::Options;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `detect`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse detect docs/detection/kinds.toml
  navfuse detect kinds.toml --only gyro --runs 30 --format json

The command puts each kind of fault of the file into its scenario. It prints the verdict beside \
the evidence in the innovations, which is twice the logarithm of the likelihood ratio of a \
filter that knows the fault. Below 22.6 no test can find a fault. A second table counts false \
alarms, misses and wrong names.")]
pub struct Detect {
    /// The file of kinds of faults, TOML
    pub kinds: PathBuf,
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
    let file = Document::from_file(&arguments.kinds)?;
    let mut kinds = navfuse_diagnose::Kinds::of(&file)?;
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
    let interrupted = rows.iter().any(|row| (row.runs.len() as u64) < arguments.runs);
    Ok(if interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}
