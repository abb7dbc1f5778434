//! `navfuse monte-carlo`.

use crate::error::{CommandError, Result};
use crate::execution::campaign::{self, CampaignOptions, Draws, Kind};
use crate::output::campaign::Shown;
use clap::Args;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `monte-carlo`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse monte-carlo scenarios/pan-wu-3d.toml
  navfuse monte-carlo scenarios/pan-wu-3d.toml --runs 1000 --from \"700 s\"
  # is twice the noise that the filter assumes detected?
  navfuse monte-carlo scenarios/pan-wu-3d.toml \\
      --set sensor.imu.simulation.noise=2
  # one job of an array; `navfuse merge` joins the parts
  navfuse monte-carlo scenarios/pan-wu-3d.toml --shard 3/7 --out parts/3
  # one table of many scenarios: does a run report its fault?
  navfuse monte-carlo scenarios/faults/*.toml --runs 30 --no-output

Each run draws the initial errors from the priors, fresh noise, and the truth of every state for \
which the scenario states none. The command writes:
  campaign.html    a page: verdict, tables, plots, and the runs to look at
  worst-N.html     the reports of these runs, at most 5 and one for 10 runs
  report.json      the tables that it prints
  epochs.parquet   RMSE, sigma, bound, ANEES and NIS over time
  runs.parquet     one row for each run and epoch: errors, sigmas, NEES, NIS
  bounds.parquet   the Cramer-Rao bound over time, filtered and smoothed
  *.svg, *.rrd     plots of them, and the same for the rerun viewer")]
pub struct MonteCarlo {
    /// The scenario, a TOML file; its samples are simulated. Several
    /// scenarios give one table with a row for each
    #[arg(required = true)]
    pub scenario: Vec<PathBuf>,
    /// Number of runs
    #[arg(long, default_value_t = 300)]
    pub runs: usize,
    #[command(flatten)]
    pub draws: Draws,
    #[command(flatten)]
    pub options: CampaignOptions,
}

/// Runs a scenario many times and tests whether its uncertainty is consistent.
pub fn monte_carlo(registry: &Registry, arguments: &MonteCarlo) -> Result<ExitCode> {
    if arguments.runs == 0 {
        let message = "give at least one run; `navfuse bound` needs none";
        return Err(CommandError::argument("--runs 0", message));
    }
    let options = campaign::drawn(arguments.runs, &arguments.draws, &[])?;
    let [path] = &arguments.scenario[..] else {
        return campaign::run_several(registry, &arguments.scenario, &arguments.options, &options);
    };
    let scenario = &path.display().to_string();
    let kind = Kind { name: "monte-carlo", shown: Shown::Consistency, scenario };
    campaign::run(registry, path, &arguments.options, options, &kind)
}
