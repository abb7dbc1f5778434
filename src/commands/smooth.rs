//! `navfuse smooth`.

use crate::error::Result;
use crate::execution::input::{document_of, runs_folder};
use crate::execution::run::{RunOptions, execute};
use clap::Args;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `smooth`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse smooth scenarios/tactical.toml                     writes runs/tactical-smoothed
  navfuse smooth runs/tactical/run.mcap --out runs/tactical-best
  navfuse smooth scenarios/snapir.toml --set source.csv.directory=/data/snapir/T10

The filter runs to the end, and a second pass goes back to the beginning. The log, the recording
and the tables have the smoothed estimates with their sigma, and the recording shows the track of
the filter beside them. `smooth = true` in [estimator] does the same in every run of a scenario.")]
pub struct Smooth {
    /// A scenario, which is a TOML file, or a log, which is an MCAP file that navfuse wrote
    pub of: PathBuf,
    #[command(flatten)]
    pub options: RunOptions,
}

/// Smooths a run.
pub fn smooth(registry: &Registry, arguments: &Smooth) -> Result<ExitCode> {
    let (document, mut settings) = document_of(&arguments.of)?;
    settings.push("estimator.smooth=true".to_owned());
    let mut options = arguments.options.clone();
    if options.out.is_none() && !options.no_output {
        options.out = Some(runs_folder(&format!("{}-smoothed", document.stem())));
    }
    execute(registry, document, &settings, &options)
}
