//! `navfuse check`.

use crate::error::Result;
use crate::execution::input::document;
use crate::output::terminal::Detail;
use crate::output::{self, line, table};
use clap::Args;
use navfuse_core::compose::Composition;
use navfuse_core::model::sensor::{Purpose, Sensor};
use navfuse_core::plugin::{BuildError, Registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::{Block, Dynamics, Mode};
use navfuse_core::units::time::Time;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `check`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse check scenarios/pan-wu-3d.toml
  navfuse check my-scenario.toml --set sensor.dvl.enabled=false
  navfuse check - < my-scenario.toml

The command prints every state with its prior, every sensor with its channels, gate and \
simulated rate, and all sources and sinks. If the scenario has mistakes, it prints all of them \
with their lines instead. It runs nothing and writes nothing.")]
pub struct Check {
    /// The scenario, a TOML file; `-` reads standard input
    pub scenario: PathBuf,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
}

/// Composes a scenario and opens its sources, and prints what it consists of.
pub fn check(registry: &Registry, arguments: &Check) -> Result<ExitCode> {
    let scenario = Scenario::new(registry, document(&arguments.scenario)?, &arguments.set)?;
    registry.check()?;
    let mistakes = scenario.mistakes();
    if !mistakes.is_empty() {
        return Ok(rejected(arguments, mistakes));
    }
    let assembly = scenario.assemble(None)?;
    if Detail::is_quiet() {
        return Ok(ExitCode::SUCCESS);
    }
    let composition = &assembly.composition;
    states(composition);
    sensors(composition);
    for process in &composition.processes {
        let input = process.input.map_or("nothing", |k| &composition.sensors[k].info.name);
        line(format_args!("process {}: {}, driven by {input}", process.name, process.kind));
    }
    let mut sources: Vec<&str> = assembly.sources.iter().map(|(n, _)| n.as_str()).collect();
    let streams = sources.len();
    sources.dedup();
    line(format_args!("sources: {} ({streams} streams)", sources.join(", ")));
    line(format_args!("sinks: {}", scenario.sinks()?.join(", ")));
    for (about, text) in &composition.notes {
        line(format_args!("note: {about}: {text}"));
    }
    let scheduled = assembly.sources.iter().flat_map(|(_, source)| source.schedule());
    for event in scheduled.filter(|event| event.time == Time::MIN) {
        line(format_args!("note: {}: {}", event.about, event.text));
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the mistakes, each with the line of the file, and their number.
fn rejected(arguments: &Check, mistakes: Vec<BuildError>) -> ExitCode {
    let count = mistakes.len();
    for mistake in mistakes {
        output::mistake(&mistake.into());
    }
    if count > 1 {
        let file = arguments.scenario.display();
        output::warn(format_args!("error: {file}: {count} mistakes"));
    }
    ExitCode::FAILURE
}

/// Prints the states.
fn states(composition: &Composition) {
    let layout = &composition.layout;
    line(format_args!(
        "{}: {} error states in {} blocks",
        composition.name,
        layout.tangent,
        layout.blocks.len()
    ));
    let mut blocks = table(&["state", "dim", "mode", "prior 1-sigma", "unit", "moves by"]);
    for block in &layout.blocks {
        let dimension = block.tangent_range().len();
        blocks.add_row([
            block.name.clone(),
            dimension.to_string(),
            format!("{:?}", block.spec.mode).to_lowercase(),
            prior(block),
            block.spec.display.unit.to_owned(),
            moves(block, composition.processes.iter().map(|p| p.name.as_str())),
        ]);
    }
    line(format_args!("{blocks}\n"));
}

/// Prints the sensors.
fn sensors(composition: &Composition) {
    let mut rows = table(&["sensor", "type", "for", "channels", "gate", "simulated"]);
    for sensor in &composition.sensors {
        let channels: Vec<String> = sensor.info.channels.iter().map(|c| c.column()).collect();
        let purpose = match sensor.info.purpose {
            Purpose::Input => "drives a process",
            Purpose::Measurement => "corrects the state",
            Purpose::Reference => "start and comparison",
        };
        let rate =
            sensor.simulation.as_ref().map_or_else(String::new, |s| s.rate.value().to_string());
        let (name, kind) = (sensor.info.name.clone(), sensor.info.kind.clone());
        rows.add_row([name, kind, purpose.to_owned(), channels.join(" "), gate(sensor), rate]);
    }
    line(format_args!("{rows}\n"));
}

/// The probability of the gate of a sensor that corrects the state.
fn gate(sensor: &Sensor) -> String {
    match (sensor.info.purpose, sensor.gate.probability()) {
        (Purpose::Measurement, Some(p)) => p.to_string(),
        (Purpose::Measurement, None) => "off".to_owned(),
        _ => String::new(),
    }
}

/// The prior sigma of a block in its display unit.
fn prior(block: &Block) -> String {
    if block.spec.mode == Mode::Fixed {
        return "exact".to_owned();
    }
    let sigma: Vec<String> =
        block.spec.sigma.iter().map(|s| short(s / block.spec.display.scale)).collect();
    if sigma.windows(2).all(|w| w[0] == w[1]) { sigma[0].clone() } else { sigma.join(", ") }
}

/// Four digits.
fn short(value: f64) -> String {
    format!("{value:.3e}").parse::<f64>().unwrap_or(value).to_string()
}

/// The dynamics of a block in words.
fn moves<'a>(block: &Block, mut processes: impl Iterator<Item = &'a str>) -> String {
    let owner = block.name.split('.').next().unwrap_or_default();
    match &block.spec.dynamics {
        Dynamics::RandomWalk(_) => "random walk".to_owned(),
        Dynamics::GaussMarkov { time, .. } => format!("Gauss-Markov, {} s", short(*time)),
        Dynamics::Constant if processes.any(|p| p == owner) && !block.name.ends_with("bias") => {
            format!("process {owner}")
        }
        Dynamics::Constant => "constant".to_owned(),
    }
}
