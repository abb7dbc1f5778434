//! `navfuse run`.

use crate::error::Result;
use crate::execution::input::document;
use crate::execution::run::{RunOptions, execute};
use clap::Args;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse run scenarios/pan-wu-3d.toml
  navfuse run dive.toml --set seed=7 --set \"sensor.dvl.noise=5 mm/s\"
  navfuse run dive.toml --set source.csv.directory=/data/dive-10 --out runs/10
  navfuse run scenarios/quickstart.toml --format json | jq .states")]
pub struct Run {
    /// The scenario, a TOML file; `-` reads standard input
    pub scenario: PathBuf,
    #[command(flatten)]
    pub options: RunOptions,
}

/// Runs a scenario.
pub fn run(registry: &Registry, arguments: &Run) -> Result<ExitCode> {
    let document = document(&arguments.scenario)?;
    execute(registry, document, &[], &arguments.options)
}
