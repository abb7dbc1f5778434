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

mod arguments;
mod calibrate;
mod campaign;
mod figures;
mod inspect;
mod new_plugin;
mod observability;
mod print;
mod print_campaign;
mod progress;
mod report;
mod run;

use arguments::{Arguments, Command};
use clap::Parser;
use navfuse_core::plugin::Registry;
use std::process::ExitCode;

/// The registry with the plugins that ship with navfuse.
pub fn standard_plugins() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DopplerPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_odometer::OdometerPlugin)
        .add(&navfuse_simulation::SimulationPlugin)
        .add(&navfuse_csv::CsvPlugin)
        .add(&navfuse_mcap::McapPlugin);
    #[cfg(feature = "rerun")]
    registry.add(&navfuse_viewer::ViewerPlugin);
    registry
}

/// Parses the arguments of the process and does what they say.
pub fn command(registry: &Registry) -> ExitCode {
    let command = Arguments::parse().command;
    if let Err(error) = registry.check() {
        print::warn(format_args!("error: {error}"));
        return ExitCode::FAILURE;
    }
    let done = match command {
        Command::Run(arguments) => run::run(registry, &arguments),
        Command::Replay(arguments) => run::replay(registry, &arguments),
        Command::MonteCarlo(arguments) => campaign::monte_carlo(registry, &arguments),
        Command::Bound(arguments) => campaign::bound(registry, &arguments),
        Command::Sweep(arguments) => campaign::sweep(registry, &arguments),
        Command::Observability(arguments) => observability::observability(registry, &arguments),
        Command::Merge(arguments) => campaign::merge(&arguments),
        Command::Calibrate(arguments) => calibrate::calibrate(registry, &arguments),
        Command::NewPlugin(arguments) => new_plugin::new_plugin(registry, &arguments),
        Command::Report(arguments) => report::report(registry, &arguments),
        Command::Figures(arguments) => figures::figures(registry, &arguments),
        Command::Check(arguments) => inspect::check(registry, &arguments),
        Command::List { name } => inspect::list(registry, name.as_deref()),
        Command::Schema => inspect::schema(registry),
    };
    done.unwrap_or_else(|error| {
        print::warn(format_args!("error: {error}"));
        ExitCode::FAILURE
    })
}
