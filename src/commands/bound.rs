//! `navfuse bound`.

use crate::error::Result;
use crate::execution::campaign::{self, CampaignOptions, Kind};
use crate::output::campaign::Shown;
use clap::Args;
use navfuse_campaign::Options;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `bound`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse bound scenarios/pan-wu-3d.toml
  # would a better DVL help?
  navfuse bound scenarios/pan-wu-3d.toml --set \"sensor.dvl.noise=2 mm/s\"

The bound is the covariance of the best estimate that any filter can make of these sensors on \
this trajectory. The smoothed bound belongs to the best estimate from all samples, later ones \
included.")]
pub struct Bound {
    /// The scenario, a TOML file; its samples are simulated
    pub scenario: PathBuf,
    #[command(flatten)]
    pub options: CampaignOptions,
}

/// Computes the Cramer-Rao bound of a scenario.
pub fn bound(registry: &Registry, arguments: &Bound) -> Result<ExitCode> {
    let scenario = &arguments.scenario.display().to_string();
    let kind = Kind { name: "bound", shown: Shown::Bound, scenario };
    campaign::run(registry, &arguments.scenario, &arguments.options, Options::default(), &kind)
}
