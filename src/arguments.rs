//! The arguments of the command.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Multisensor navigation from a TOML scenario: a simulated or recorded vehicle, its sensors, an error-state EKF that
/// calibrates them, a log and a recording for the rerun viewer.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "\
Start here:
  navfuse run scenarios/quickstart.toml       the smallest useful scenario, on simulated sensors
  navfuse list                                what can be put into a scenario
  navfuse list dvl                            the parameters of one type
  navfuse check my-scenario.toml              what a scenario composes, before it runs
  navfuse monte-carlo my-scenario.toml        whether its sigma can be trusted"
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a scenario: print what was estimated, write a log and a recording
    Run(Run),
    /// Check a scenario without running it, and print what it composes
    Check(Check),
    /// List the registered types, or the parameters of one
    List {
        /// A type, such as `dvl`
        name: Option<String>,
    },
    /// Print the JSON Schema of scenarios, by which editors complete and check them
    Schema,
    /// Run the filter again on the samples of a log, with the scenario that is in it
    Replay(Replay),
    /// Run a scenario many times and judge its sigma: errors against sigma, bound and chi-square bands
    MonteCarlo(MonteCarlo),
    /// Compute how good a scenario can ever be: its Cramer-Rao bound, filtered and smoothed
    Bound(Bound),
    /// Compute the bound, or run a campaign, for every combination of values of some keys
    Sweep(Sweep),
    /// Say what a scenario or a log determines of each state, when it became so, and what is missing
    Observability(crate::observability::Observability),
    /// Join the parts of a campaign that ran with --shard
    Merge(Merge),
    /// Calibrate the DVL: IO-DVLC of Pan & Wu, the methods that they compare with, and the filter
    Calibrate(crate::calibrate::Calibrate),
    /// Write one page about a run, which opens offline: track, states, innovations, calibration before and after
    Report(crate::report::Report),
    /// Make the figures of a paper from runs of its scenarios
    Figures(crate::figures::Figures),
    /// Write a crate with a sensor of your own, which builds and runs at once
    NewPlugin(NewPlugin),
}

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse run scenarios/pan-wu-3d.toml
  navfuse run scenarios/pan-wu-3d.toml --set seed=7 --set \"sensor.dvl.noise=5 mm/s\"
  navfuse run scenarios/snapir.toml --set source.csv.directory=/data/snapir/T10 --out runs/T10
  navfuse run scenarios/quickstart.toml --format json | jq .states")]
pub struct Run {
    /// The scenario, a TOML file
    pub scenario: PathBuf,
    /// How it runs.
    #[command(flatten)]
    pub options: RunOptions,
}

/// Arguments of `replay`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse replay runs/pan-wu-3d/run.mcap
  navfuse replay dive.mcap --set \"sensor.dvl.gate=0.999\" --out runs/dive-with-gate
  navfuse replay dive.mcap --scenario better.toml")]
pub struct Replay {
    /// The log, an MCAP file that navfuse wrote
    pub log: PathBuf,
    /// Another scenario than the one in the log; its sources are replaced by the log
    #[arg(long)]
    pub scenario: Option<PathBuf>,
    /// How it runs.
    #[command(flatten)]
    pub options: RunOptions,
}

/// How a run runs.
#[derive(Clone, Debug, Args)]
pub struct RunOptions {
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Folder for the log and the recording [default: runs/NAME of the scenario]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Write nothing: no log, no recording
    #[arg(long, conflicts_with_all = ["out", "rerun", "connect", "serve"])]
    pub no_output: bool,
    /// Where the run is shown while it runs.
    #[command(flatten)]
    pub live: Live,
}

/// Where a run is shown live.
#[derive(Clone, Debug, Args)]
#[group(multiple = false)]
pub struct Live {
    /// Start the rerun viewer and show the run in it while it runs
    #[arg(long)]
    pub rerun: bool,
    /// Show the run in a rerun viewer that is running, at this address
    #[arg(long, value_name = "ADDR")]
    pub connect: Option<String>,
    /// Serve the run to web browsers until Ctrl-C
    #[arg(long)]
    pub serve: bool,
}

/// Arguments of `monte-carlo`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse monte-carlo scenarios/pan-wu-3d.toml
  navfuse monte-carlo scenarios/pan-wu-3d.toml --runs 1000 --every \"10 s\" --from \"700 s\"
  navfuse monte-carlo scenarios/pan-wu-3d.toml --set sensor.imu.simulation.noise=2     is a wrong sigma noticed?
  navfuse monte-carlo scenarios/pan-wu-3d.toml --shard 3/7 --out parts/3               one job of an array; then `merge`

Each run draws the initial errors from the priors, fresh noise, and the truth of every state for which the scenario states
none. What it writes:
  report.json      the tables below
  epochs.parquet   RMSE, sigma, bound, ANEES and NIS over time
  runs.parquet     one row a run and epoch: errors, sigmas, NEES, NIS
  bounds.parquet   the Cramer-Rao bound over time, filtered and smoothed
  *.svg, *.rrd     plots of them, and the same for the rerun viewer")]
pub struct MonteCarlo {
    /// The scenario, a TOML file; its samples are simulated
    pub scenario: PathBuf,
    /// Runs
    #[arg(long, default_value_t = 100)]
    pub runs: usize,
    /// What is drawn for each run.
    #[command(flatten)]
    pub draws: Draws,
    /// How it is done.
    #[command(flatten)]
    pub options: CampaignOptions,
}

/// What is drawn for each run.
#[derive(Clone, Debug, Args)]
pub struct Draws {
    /// Seed of the campaign; run r has the seed 1000000 times that, plus r [default: that of the scenario]
    #[arg(long)]
    pub seed: Option<u64>,
    /// What is drawn beside the noise
    #[arg(long, value_enum, default_value_t = Start::Drawn)]
    pub start: Start,
    /// Judge errors and sigmas from this time on: what comes before is recorded, but is no part of the verdict
    #[arg(long, value_name = "TIME")]
    pub from: Option<String>,
}

/// What is drawn beside the noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Start {
    /// Initial errors from the priors, and the truths that the scenario does not state
    Drawn,
    /// Only what the scenario's own `estimator.draw` says
    Given,
}

/// Arguments of `bound`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse bound scenarios/pan-wu-3d.toml
  navfuse bound scenarios/pan-wu-3d.toml --set \"sensor.dvl.noise=2 mm/s\"     would a better DVL help?

The bound is the covariance of the best estimate that any filter can make of these sensors on this trajectory; the smoothed
one is that of the best estimate from all samples, also later ones.")]
pub struct Bound {
    /// The scenario, a TOML file; its samples are simulated
    pub scenario: PathBuf,
    /// How it is done.
    #[command(flatten)]
    pub options: CampaignOptions,
}

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse sweep scenarios/pan-wu-3d.toml --vary \"sensor.dvl.noise=2 mm/s,5 mm/s,1 cm/s,2 cm/s\" --show dvl
  navfuse sweep scenarios/pan-wu-3d.toml --show ins.attitude.yaw \\
      --vary \"source.simulation.start.latitude=0 deg,30 deg,60 deg\" \\
      --vary \"sensor.imu.gyro_noise=0.01 deg/h/sqrt(Hz),0.1 deg/h/sqrt(Hz),1 deg/h/sqrt(Hz)\"
  navfuse sweep scenarios/pan-wu-3d.toml --vary sensor.dvl.simulation.noise=1,2,3 --runs 50     a campaign at each point")]
pub struct Sweep {
    /// The scenario, a TOML file; its samples are simulated
    pub scenario: PathBuf,
    /// A key and its values; may be given again, for every combination
    #[arg(long, value_name = "KEY.PATH=V1,V2,...", required = true)]
    pub vary: Vec<String>,
    /// A state or component to show, such as dvl.scale or ins.attitude.yaw; may be given again [default: all]
    #[arg(long, value_name = "STATE")]
    pub show: Vec<String>,
    /// Runs at each point; 0 is the bound alone
    #[arg(long, default_value_t = 0)]
    pub runs: usize,
    /// What is drawn for each run.
    #[command(flatten)]
    pub draws: Draws,
    /// How it is done.
    #[command(flatten)]
    pub options: CampaignOptions,
}

/// Arguments of `merge`.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  for i in 1 2 3; do navfuse monte-carlo scenarios/pan-wu-3d.toml --shard $i/3 --out parts/$i; done
  navfuse merge parts/* --out whole

The parts may run on different machines and in any order. What comes out is what one machine would have written.")]
pub struct Merge {
    /// The folders of all parts
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Folder for what they are together [default: runs/NAME-merged]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// A state or component to show of a sweep; may be given again [default: all]
    #[arg(long, value_name = "STATE")]
    pub show: Vec<String>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// How a campaign is done.
#[derive(Clone, Debug, Args)]
pub struct CampaignOptions {
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Threads [default: one a core]
    #[arg(long)]
    pub jobs: Option<usize>,
    /// How often a run is looked at [default: so that there are about 300 epochs]
    #[arg(long, value_name = "TIME")]
    pub every: Option<String>,
    /// Do only this part, such as 3/7, for `merge`
    #[arg(long, value_name = "I/N")]
    pub shard: Option<navfuse_campaign::Shard>,
    /// Folder for the tables and plots [default: runs/NAME-COMMAND]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Write nothing
    #[arg(long, conflicts_with_all = ["out", "shard"])]
    pub no_output: bool,
}

/// Arguments of `new-plugin`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse new-plugin my-sensor
  navfuse new-plugin my-sensor --path ../sensors/mine --navfuse ~/navfuse")]
pub struct NewPlugin {
    /// Name of the crate and of its sensor type: small letters, digits, - and _
    pub name: String,
    /// Folder to write it to [default: ./NAME]
    #[arg(long, value_name = "DIR")]
    pub path: Option<PathBuf>,
    /// Folder of navfuse's source [default: that of which this program was built; where it is gone, its version]
    #[arg(long, value_name = "PATH")]
    pub navfuse: Option<PathBuf>,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct Check {
    /// The scenario, a TOML file
    pub scenario: PathBuf,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
}

/// How the result is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Tables for people
    Text,
    /// One JSON object on standard output, and nothing else there
    Json,
}
