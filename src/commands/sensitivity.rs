//! `navfuse sensitivity`.

use crate::error::Result;
use crate::execution::input::document_of;
use crate::execution::sensitivity::sensitivity as sensitivities;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::{self, Format};
use clap::Args;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `sensitivity`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse sensitivity scenarios/quickstart.toml
  navfuse sensitivity runs/dive/run.mcap
  navfuse sensitivity dive.toml --format json | jq '.rows[] | select(.exceeds)'
  navfuse report dive.toml --sensitivity     has the same table on its page

The command runs the samples again with each thing that the scenario does not model: a bias of a \
Doppler instrument of 1 cm/s, axes of the IMU of 10 arcsec, a deflection of the vertical of 10 \
arcsec, lever arms of 2 cm, a speed of sound off by 1 m/s. It prints the change of each state at \
the end beside its sigma. A state that would move by more than its sigma is marked: model the \
thing, or do not trust that sigma.")]
pub struct Sensitivity {
    /// The scenario, a TOML file, or the log of a run
    pub scenario: PathBuf,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Number of threads [default: one a core]
    #[arg(long)]
    pub jobs: Option<usize>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Prints the sensitivity of the result to what the scenario does not model.
pub fn sensitivity(registry: &Registry, arguments: &Sensitivity) -> Result<ExitCode> {
    let (document, first) = document_of(&arguments.scenario)?;
    let settings = [first, arguments.set.clone()].concat();
    let text = arguments.format == Format::Text;
    let (stop, bar) = (stop_on_signal(), Bar::new(text));
    let found = sensitivities(registry, document, &settings, arguments.jobs, &stop, &bar)?;
    if text {
        output::sensitivity::print(&found);
    } else {
        output::line(serde_json::to_string(&found)?);
    }
    Ok(if found.interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}
