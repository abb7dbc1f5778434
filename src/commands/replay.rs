//! `navfuse replay`.

use crate::error::Result;
use crate::execution::input::{log_of, of_log, runs_folder};
use crate::execution::run::{RunOptions, execute};
use clap::Args;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `replay`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse replay runs/pan-wu-3d         the log in it
  navfuse replay dive.mcap --set sensor.dvl.gate=0.999 --out runs/with-gate
  navfuse replay dive.mcap --scenario better.toml")]
pub struct Replay {
    /// The log, an MCAP file that navfuse wrote, or the folder of a run with one
    pub log: PathBuf,
    /// A scenario to use in place of the one in the log; the log replaces its sources
    #[arg(long)]
    pub scenario: Option<PathBuf>,
    #[command(flatten)]
    pub options: RunOptions,
}

/// Runs the filter again on the samples of a log.
pub fn replay(registry: &Registry, arguments: &Replay) -> Result<ExitCode> {
    let log = log_of(&arguments.log)?;
    let (document, source) = of_log(&log, arguments.scenario.as_deref())?;
    let mut options = arguments.options.clone();
    if options.out.is_none() {
        options.out = Some(runs_folder(&format!("{}-replay", document.stem())));
    }
    execute(registry, document, &[source], &options)
}
