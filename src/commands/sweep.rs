//! `navfuse sweep`.

use crate::error::Result;
use crate::execution::campaign::{self, CampaignOptions, Draws, Kind};
use crate::output::campaign::Shown;
use clap::Args;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse sweep scenarios/pan-wu-3d.toml --show dvl \\
      --vary \"sensor.dvl.noise=2 mm/s,5 mm/s,1 cm/s\"
  navfuse sweep scenarios/pan-wu-3d.toml --show ins.attitude.yaw \\
      --vary \"source.simulation.start.latitude=0 deg,30 deg,60 deg\" \\
      --vary \"sensor.imu.gyro_noise=0.01 deg/h/sqrt(Hz),0.1 deg/h/sqrt(Hz)\"
  # a campaign of 50 runs at each point
  navfuse sweep scenarios/pan-wu-3d.toml --runs 50 \\
      --vary sensor.dvl.simulation.noise=1,2,3")]
pub struct Sweep {
    /// The scenario, a TOML file; its samples are simulated
    pub scenario: PathBuf,
    /// A key and its values; may be given again, for every combination
    #[arg(long, value_name = "KEY.PATH=V1,V2,...", required = true)]
    pub vary: Vec<String>,
    /// A state or component to show, such as dvl.scale or ins.attitude.yaw; may be given again
    /// [default: all]
    #[arg(long, value_name = "STATE")]
    pub show: Vec<String>,
    /// Number of runs at each point; 0 computes the bound alone
    #[arg(long, default_value_t = 0)]
    pub runs: usize,
    #[command(flatten)]
    pub draws: Draws,
    #[command(flatten)]
    pub options: CampaignOptions,
}

/// Computes the bound, or runs a campaign, over a grid of values.
pub fn sweep(registry: &Registry, arguments: &Sweep) -> Result<ExitCode> {
    let options = campaign::drawn(arguments.runs, &arguments.draws, &arguments.vary)?;
    let scenario = &arguments.scenario.display().to_string();
    let kind = Kind { name: "sweep", shown: Shown::Grid(&arguments.show), scenario };
    campaign::run(registry, &arguments.scenario, &arguments.options, options, &kind)
}
