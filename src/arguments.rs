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
  navfuse check my-scenario.toml              what a scenario composes, before it runs"
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
