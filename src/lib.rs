//! The `navfuse` command, and the plugins that it ships with.
//!
//! A program with one more plugin:
//! ```no_run
//! # use navfuse_core::plugin::{Plugin, Registry};
//! # struct MyPlugin;
//! # impl Plugin for MyPlugin { fn build(&self, _: &mut Registry) {} }
//! fn main() -> std::process::ExitCode {
//!     let mut registry = navfuse::standard_plugins();
//!     registry.add(&MyPlugin);
//!     navfuse::command(&registry)
//! }
//! ```

mod commands;
mod error;
mod execution;
mod output;

use clap::error::{ContextKind, ContextValue};
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use navfuse_core::document::did_you_mean;
use navfuse_core::input::Held;
use navfuse_core::plugin::Registry;
use output::terminal::Detail;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

pub use commands::calibrate::{From as CalibrationAttitude, calibration};
pub use error::CommandError;
pub use execution::input::document_of;
pub use execution::run::summary;

/// The registry with the plugins that ship with navfuse.
pub fn standard_plugins() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DopplerPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_odometer::OdometerPlugin)
        .add(&navfuse_relative_pose::RelativePosePlugin)
        .add(&navfuse_constraints::ConstraintsPlugin)
        .add(&navfuse_heading::HeadingPlugin)
        .add(&navfuse_dead_reckoning::DeadReckoningPlugin)
        .add(&navfuse_acoustic::AcousticPlugin)
        .add(&navfuse_terrain::TerrainPlugin)
        .add(&navfuse_point_mass::PointMassPlugin)
        .add(&navfuse_simulation::SimulationPlugin)
        .add(&navfuse_csv::CsvPlugin)
        .add(&navfuse_dvl_files::DvlFilesPlugin)
        .add(&navfuse_nmea::NmeaPlugin)
        .add(&navfuse_vehicle_logs::VehicleLogsPlugin)
        .add(&navfuse_links::LinksPlugin)
        .add(&navfuse_dds::DdsPlugin)
        .add(&navfuse_foxglove::FoxglovePlugin)
        .add(&navfuse_mcap::McapPlugin)
        .add(&navfuse_ros2::Ros2Plugin)
        .add(&navfuse_observability::ObservabilityPlugin);
    #[cfg(feature = "rerun")]
    registry.add(&navfuse_viewer::ViewerPlugin);
    registry
}

/// Multisensor navigation from a TOML scenario: fuses the sensors of a simulated, recorded or moving
/// vehicle, calibrates them, judges the run, and writes a log and a recording for the rerun viewer.
#[derive(Debug, Parser)]
#[command(
    name = "navfuse",
    version,
    after_help = "\
Start here:
  navfuse run scenarios/quickstart.toml   run the smallest useful scenario
  navfuse list                            list the types that a scenario can use
  navfuse list dvl                        list the parameters of one type
  navfuse check my-scenario.toml          compose a scenario without running it
  navfuse monte-carlo my-scenario.toml    test whether its sigma is consistent"
)]
struct Arguments {
    #[command(subcommand)]
    command: Commands,
    /// Print results alone, a line for each: no tables, no progress, no warnings
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Print all warnings, and the notes of a run as it goes on
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
}

impl Arguments {
    fn detail(&self) -> Detail {
        match (self.quiet, self.verbose) {
            (true, _) => Detail::Quiet,
            (_, true) => Detail::Verbose,
            _ => Detail::Usual,
        }
    }
}

/// Examples of `schema`.
const SCHEMA_HELP: &str = "\
Examples:
  navfuse schema > scenarios/navfuse.schema.json

A first line `#:schema navfuse.schema.json` in a scenario makes editors with a TOML language \
server use it: they complete keys, and mark misspelt ones and values of a wrong unit.";

/// The subcommands.
#[derive(Debug, Subcommand)]
enum Commands {
    /// Run a scenario: print the estimates, write a log and a recording
    Run(commands::run::Run),
    /// Run a scenario on a vehicle, on the samples that arrive over its links
    Live(commands::live::Live),
    /// Print the state of a live run and of its sensors
    Status(commands::status::Status),
    /// Send the samples of a log or a scenario as they were recorded, to try a live run at the desk
    Play(commands::play::Play),
    /// Check a scenario without running it, and print its states and sensors
    Check(commands::check::Check),
    /// List the registered types, or the parameters of one
    List(commands::list::List),
    /// Print the JSON Schema of scenarios, with which editors complete and check them
    #[command(after_help = SCHEMA_HELP)]
    Schema,
    /// Run the filter again on the samples of a log, with the scenario in the log
    Replay(commands::replay::Replay),
    /// Smooth a run: the best estimate for every time from all samples, including later ones
    Smooth(commands::smooth::Smooth),
    /// Run a scenario many times, and test errors against sigma, bound and chi-square bands
    MonteCarlo(commands::monte_carlo::MonteCarlo),
    /// Compute the Cramer-Rao bound of a scenario, filtered and smoothed
    Bound(commands::bound::Bound),
    /// Compute the bound, or run a campaign, for every combination of values of some keys
    Sweep(commands::sweep::Sweep),
    /// Report which states a scenario or a log determines, since when, and what is missing
    Observability(commands::observability::Observability),
    /// Join the parts of a campaign that ran with --shard
    Merge(commands::merge::Merge),
    /// Calibrate the DVL: IO-DVLC of Pan & Wu, the methods that they compare with, and the filter
    Calibrate(commands::calibrate::Calibrate),
    /// Find the change of a scenario that explains its samples: run them with each of some hundred
    Diagnose(commands::diagnose::Diagnose),
    /// Put kinds of faults into scenarios, and print how well the verdict finds each
    Detect(commands::detect::Detect),
    /// Print how far each state would move if each error that nothing models had its usual size
    Sensitivity(commands::sensitivity::Sensitivity),
    /// Print the error budget of dead reckoning by velocity log and heading
    Budget(commands::budget::Budget),
    /// Write one page about a run, which opens offline: track, states, innovations, calibration
    Report(commands::report::Report),
    /// Compare runs: what differs in their scenarios and in their results
    Compare(commands::compare::Compare),
    /// Write the estimates of a log in another format, such as KML, SBET, TUM, CSV or a ROS 2 bag
    Export(commands::export::Export),
    /// Open a run in the rerun viewer; converts a log without a recording
    #[cfg(feature = "rerun")]
    View(commands::view::View),
    /// Print the completions of a shell, or write the manual pages
    Completions(commands::completions::Completions),
    /// Look at the files of a recording, and write a scenario that runs at once
    Import(commands::import::Import),
    /// Make the figures of a paper from runs of its scenarios
    Figures(commands::figures::Figures),
    /// Write a crate with a sensor of your own, which builds and runs at once
    NewPlugin(commands::new_plugin::NewPlugin),
}

/// Arguments with a path that is written, in any command. Every other path is read.
const OUTPUTS: [&str; 5] = ["apply", "out", "path", "write", "initialise"];

/// Holds the files that the arguments of a command name as its inputs, so that it writes over none.
fn hold_inputs(matches: &ArgMatches) -> Vec<Held> {
    let Some((_, matches)) = matches.subcommand() else { return Vec::new() };
    let names = matches.ids().map(clap::Id::as_str).filter(|name| !OUTPUTS.contains(name));
    let paths = names.filter_map(|name| matches.try_get_many::<PathBuf>(name).ok().flatten());
    paths.flatten().flat_map(|path| Held::all(path)).collect()
}

/// The clap definition of the command, for tests that hold something of every subcommand.
#[doc(hidden)]
pub fn definition() -> clap::Command {
    Arguments::command()
}

/// Parses the arguments of the process and runs the subcommand.
pub fn command(registry: &Registry) -> ExitCode {
    command_with(registry, std::env::args_os())
}

/// Runs the subcommand that the arguments name; the first argument is the name of the program.
pub fn command_with(
    registry: &Registry,
    arguments: impl IntoIterator<Item = OsString>,
) -> ExitCode {
    let parsed = Arguments::command().try_get_matches_from(arguments);
    let parsed = parsed.and_then(|m| Arguments::from_arg_matches(&m).map(|a| (m, a)));
    let (matches, arguments) = match parsed {
        Ok(parsed) => parsed,
        Err(usage) => {
            let usage = with_meant(usage);
            usage.print().ok();
            return ExitCode::from(usage.exit_code() as u8);
        }
    };
    let _inputs = hold_inputs(&matches);
    arguments.detail().set();
    let command = arguments.command;
    let failed = |error: error::CommandError| {
        output::mistake(&error);
        ExitCode::FAILURE
    };
    let result = registry.check().map_err(Into::into).and_then(|()| run(registry, command));
    let code = result.unwrap_or_else(failed);
    output::check_standard_output().map_or_else(failed, |()| code)
}

/// Adds the subcommand that was meant, where one is near: clap compares letters at their places and suggests
/// nothing for `rnu`.
fn with_meant(mut usage: clap::Error) -> clap::Error {
    if usage.get(ContextKind::SuggestedSubcommand).is_none()
        && let Some(ContextValue::String(given)) = usage.get(ContextKind::InvalidSubcommand)
    {
        let definition = Arguments::command();
        let names = definition.get_subcommands().map(clap::Command::get_name);
        if let Some(meant) = did_you_mean(given, names).map(str::to_owned) {
            usage.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![meant]));
        }
    }
    usage
}

fn run(registry: &Registry, command: Commands) -> error::Result<ExitCode> {
    match command {
        Commands::Run(arguments) => commands::run::run(registry, &arguments),
        Commands::Live(arguments) => commands::live::live(registry, &arguments),
        Commands::Status(arguments) => commands::status::status(&arguments),
        Commands::Play(arguments) => commands::play::play(registry, &arguments),
        Commands::Replay(arguments) => commands::replay::replay(registry, &arguments),
        Commands::Smooth(arguments) => commands::smooth::smooth(registry, &arguments),
        Commands::MonteCarlo(arguments) => commands::monte_carlo::monte_carlo(registry, &arguments),
        Commands::Bound(arguments) => commands::bound::bound(registry, &arguments),
        Commands::Sweep(arguments) => commands::sweep::sweep(registry, &arguments),
        Commands::Observability(arguments) => {
            commands::observability::observability(registry, &arguments)
        }
        Commands::Merge(arguments) => commands::merge::merge(registry, &arguments),
        Commands::Calibrate(arguments) => commands::calibrate::calibrate(registry, &arguments),
        Commands::NewPlugin(arguments) => commands::new_plugin::new_plugin(registry, &arguments),
        Commands::Diagnose(arguments) => commands::diagnose::diagnose(registry, &arguments),
        Commands::Detect(arguments) => commands::detect::detect(registry, &arguments),
        Commands::Sensitivity(arguments) => {
            commands::sensitivity::sensitivity(registry, &arguments)
        }
        Commands::Budget(arguments) => commands::budget::budget(&arguments),
        Commands::Report(arguments) => commands::report::report(registry, &arguments),
        #[cfg(feature = "rerun")]
        Commands::View(arguments) => commands::view::view(registry, &arguments),
        Commands::Completions(arguments) => {
            commands::completions::completions(Arguments::command(), &arguments)
        }
        Commands::Compare(arguments) => commands::compare::compare(registry, &arguments),
        Commands::Export(arguments) => commands::export::export(registry, &arguments),
        Commands::Import(arguments) => commands::import::import(registry, &arguments),
        Commands::Figures(arguments) => commands::figures::figures(registry, &arguments),
        Commands::Check(arguments) => commands::check::check(registry, &arguments),
        Commands::List(arguments) => commands::list::list(registry, &arguments),
        Commands::Schema => commands::schema::schema(registry),
    }
}
