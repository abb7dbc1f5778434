//! `navfuse check`, `navfuse list` and `navfuse schema`.

use crate::arguments::Check;
use crate::print::{line, table};
use navfuse_core::document::{Document, did_you_mean};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::plugin::{Entry, Kind, Registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::run::schema::{parameters, scenario_schema};
use navfuse_core::state::{Block, Dynamics, Mode};
use std::error::Error;
use std::process::ExitCode;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// `navfuse check`
pub fn check(registry: &Registry, arguments: &Check) -> Result<ExitCode> {
    let scenario =
        Scenario::new(registry, Document::from_file(&arguments.scenario)?, &arguments.set)?;
    let assembly = scenario.assemble(None)?;
    let composition = &assembly.composition;
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
    let mut sensors = table(&["sensor", "type", "for", "channels", "gate", "simulated"]);
    for sensor in &composition.sensors {
        let channels: Vec<String> = sensor.info.channels.iter().map(|c| c.column()).collect();
        let purpose = match sensor.info.purpose {
            Purpose::Input => "drives a process",
            Purpose::Measurement => "corrects the state",
            Purpose::Reference => "start and comparison",
        };
        let gate = match (sensor.info.purpose, sensor.gate.probability()) {
            (Purpose::Measurement, Some(p)) => p.to_string(),
            (Purpose::Measurement, None) => "off".to_owned(),
            _ => String::new(),
        };
        let rate =
            sensor.simulation.as_ref().map_or_else(String::new, |s| s.rate.value().to_string());
        let (name, kind) = (sensor.info.name.clone(), sensor.info.kind.clone());
        sensors.add_row([name, kind, purpose.to_owned(), channels.join(" "), gate, rate]);
    }
    line(format_args!("{sensors}\n"));
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
    Ok(ExitCode::SUCCESS)
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

/// `navfuse list`
pub fn list(registry: &Registry, name: Option<&str>) -> Result<ExitCode> {
    let Some(name) = name else {
        for kind in Kind::ALL {
            let mut rows = table(&[kind.table(), "what it is"]);
            for entry in registry.entries().filter(|e| e.kind == kind) {
                rows.add_row([entry.name.to_owned(), description(entry)]);
            }
            line(format_args!("{rows}\n"));
        }
        line(format_args!("`navfuse list TYPE` prints the parameters of one type."));
        return Ok(ExitCode::SUCCESS);
    };
    let entries: Vec<&Entry> = registry.entries().filter(|e| e.name == name).collect();
    if entries.is_empty() {
        let hint = did_you_mean(name, registry.entries().map(|e| e.name));
        let hint = hint.map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        return Err(
            format!("no type is called {name:?}{hint} `navfuse list` prints them all").into()
        );
    }
    for entry in entries {
        line(format_args!("[{}.{}]\n{}\n", entry.kind.table(), entry.name, description(entry)));
        let mut rows = table(&["key", "takes", "default", "meaning"]);
        let parameters = parameters(entry);
        let calibrated = parameters.iter().any(|p| p.takes.starts_with("calibration"));
        for p in parameters {
            rows.add_row([p.key, p.takes, p.default, p.meaning]);
        }
        line(format_args!("{rows}\n"));
        if calibrated {
            line(CALIBRATION);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What `calibration` means in the column of what a key takes.
const CALIBRATION: &str = "\
A calibration is a value, held fixed, or a table: initial, sigma, truth (for the simulator), random_walk, correlation_time,
mode = \"estimate\" | \"fixed\" | \"consider\". With a sigma it is estimated.
";

fn description(entry: &Entry) -> String {
    let text = entry.schema.get("description").and_then(serde_json::Value::as_str);
    text.unwrap_or_default().replace('\n', " ")
}

/// `navfuse schema`
pub fn schema(registry: &Registry) -> Result<ExitCode> {
    line(serde_json::to_string_pretty(&scenario_schema(registry))?);
    Ok(ExitCode::SUCCESS)
}
