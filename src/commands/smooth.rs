//! `navfuse smooth`.

use crate::error::Result;
use crate::execution::input::{document_of, runs_folder};
use crate::execution::run::{RunOptions, execute};
use clap::Args;
use navfuse_core::plugin::Registry;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `smooth`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse smooth scenarios/tactical.toml          writes runs/tactical-smoothed
  navfuse smooth runs/tactical/run.mcap --out runs/tactical-best
  navfuse smooth scenarios/auv.toml --lag \"30 s\"  while the run goes on
  navfuse smooth scenarios/calibration.toml --passes 5    relinearised

The filter runs to the end, and a second pass goes back to the beginning. The log, the recording \
and the tables contain the smoothed estimates with their sigma, and the recording also shows the \
track of the filter. `smooth = true` in [estimator] smooths every run of a scenario. With --lag, \
or `lag` in [estimator], each estimate appears while the run goes on, once the lag has passed.")]
pub struct Smooth {
    /// A scenario, which is a TOML file, or a log, which is an MCAP file that navfuse wrote
    #[arg(value_name = "SCENARIO|LOG")]
    pub of: PathBuf,
    /// Smooth with a fixed lag while the run goes on: each estimate uses the samples up to this time
    /// after it, such as "30 s"
    #[arg(long, value_name = "TIME")]
    pub lag: Option<String>,
    /// Largest number of passes; each further pass linearises at the smoothed trajectory of the pass
    /// before, until no component changes by more than 0.001 sigma
    #[arg(long, value_name = "N", conflicts_with = "lag")]
    pub passes: Option<NonZeroU32>,
    #[command(flatten)]
    pub options: RunOptions,
}

/// Smooths a run.
pub fn smooth(registry: &Registry, arguments: &Smooth) -> Result<ExitCode> {
    let (document, mut settings) = document_of(&arguments.of)?;
    settings.push("estimator.smooth=true".to_owned());
    if let Some(lag) = &arguments.lag {
        settings.push(format!("estimator.lag={lag:?}"));
    }
    if let Some(passes) = arguments.passes {
        settings.push(format!("estimator.passes={passes}"));
    }
    let mut options = arguments.options.clone();
    if options.out.is_none() && !options.no_output {
        options.out = Some(runs_folder(&format!("{}-smoothed", document.stem())));
    }
    execute(registry, document, &settings, &options)
}
