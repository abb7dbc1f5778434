//! `navfuse merge`.

use crate::error::{CommandError, Result};
use crate::execution::campaign::{Kind, report, threads};
use crate::execution::input::runs_folder;
use crate::execution::worst::Again;
use crate::output::Format;
use crate::output::campaign::Shown;
use crate::output::progress::stop_on_signal;
use clap::Args;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `merge`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  for i in 1 2 3; do
      navfuse monte-carlo scenarios/pan-wu-3d.toml --shard $i/3 --out parts/$i
  done
  navfuse merge parts/* --out whole

The parts may run on different machines and in any order. The result equals the same campaign \
run on one machine.")]
pub struct Merge {
    /// The folders of all parts
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Folder for the whole campaign [default: runs/NAME-merged]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// A state or component of a sweep to show; may be given again [default: all]
    #[arg(long, value_name = "STATE")]
    pub show: Vec<String>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Joins the parts of a campaign, and prints the results as the command of the parts does.
pub fn merge(registry: &Registry, arguments: &Merge) -> Result<ExitCode> {
    let campaign = navfuse_campaign::campaign_of(&arguments.parts[0])?;
    let (name, shown) = match (campaign.keys.is_empty(), campaign.runs) {
        (false, _) => ("sweep", Shown::Grid(&arguments.show)),
        (true, 0) => ("bound", Shown::Bound),
        (true, _) => ("monte-carlo", Shown::Consistency),
    };
    shown.check(&campaign)?;
    if let (Shown::Consistency | Shown::Bound, Some(state)) = (shown, arguments.show.first()) {
        return Err(CommandError::argument(
            format!("--show {state}"),
            format!("only for a sweep, and these are parts of a `navfuse {name}`"),
        ));
    }
    let folder = || runs_folder(&format!("{}-merged", campaign.scenario));
    let out = arguments.out.clone().unwrap_or_else(folder);
    let results = navfuse_campaign::merge(&arguments.parts, &out)?;
    let kind = Kind { name, shown, scenario: "SCENARIO" };
    let document = Document::parse(format!("{}.toml", campaign.scenario), campaign.text.as_str())?;
    let (stop, threads) = (stop_on_signal(), threads(None)?);
    let again = Again { registry, document: &document, threads, stop: &stop };
    report(&campaign, &results, &kind, again, Some(&out), arguments.format == Format::Text)?;
    Ok(ExitCode::SUCCESS)
}
