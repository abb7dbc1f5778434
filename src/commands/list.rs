//! `navfuse list`.

use crate::error::{CommandError, Result};
use crate::output::terminal::{Detail, Stream};
use crate::output::{line, table};
use clap::Args;
use navfuse_core::document::did_you_mean;
use navfuse_core::plugin::{Entry, Kind, Registry};
use navfuse_core::run::schema::{Parameter, parameters};
use std::process::ExitCode;

/// Arguments of `list`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse list            every type that a scenario can use
  navfuse list dvl        the keys of [sensor.dvl]: unit, default, meaning")]
pub struct List {
    /// A type, such as `dvl`
    pub name: Option<String>,
}

/// Width of the terminal below which the meanings of parameters stand below them, columns.
const WIDE: usize = 110;
/// Text below a table with calibration keys.
const CALIBRATION: &str = "\
A calibration is a value, held fixed, or a table: initial, sigma, truth (for the simulator),
random_walk, correlation_time, mode = \"estimate\" | \"fixed\" | \"consider\". With a sigma it is
estimated.
";

/// Lists the registered types, or the parameters of one.
pub fn list(registry: &Registry, arguments: &List) -> Result<ExitCode> {
    match arguments.name.as_deref() {
        None => types(registry),
        Some(name) => return parameters_of(registry, name),
    }
    Ok(ExitCode::SUCCESS)
}

fn types(registry: &Registry) {
    for kind in Kind::ALL {
        let mut rows = table(&[kind.table(), "what it is"]);
        for entry in registry.entries().filter(|e| e.kind == kind) {
            rows.add_row([entry.name.to_string(), description(entry)]);
        }
        line(format_args!("{rows}\n"));
    }
    line("`navfuse list TYPE` prints the parameters of one type.");
}

fn parameters_of(registry: &Registry, name: &str) -> Result<ExitCode> {
    let entries: Vec<&Entry> = registry.entries().filter(|e| &*e.name == name).collect();
    if entries.is_empty() {
        let hint = did_you_mean(name, registry.entries().map(|e| &*e.name));
        let hint = hint.map_or_else(String::new, |n| format!("did you mean {n:?}? "));
        return Err(CommandError::Request(format!(
            "no type is called {name:?}; {hint}`navfuse list` prints all types"
        )));
    }
    for entry in entries {
        line(format_args!("[{}.{}]\n{}\n", entry.kind.table(), entry.name, description(entry)));
        let parameters = parameters(entry);
        let calibrated = parameters.iter().any(|p| p.takes.starts_with("calibration"));
        let narrow = Stream::Output.width().is_some_and(|width| width < WIDE);
        if narrow && !Detail::is_quiet() {
            parameters.iter().for_each(below_each_other);
        } else {
            let mut rows = table(&["key", "takes", "default", "meaning"]);
            for p in parameters {
                rows.add_row([p.key, p.takes, p.default, p.meaning]);
            }
            line(format_args!("{rows}\n"));
        }
        if calibrated {
            line(CALIBRATION);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints a parameter with its meaning below it: a column beside three others would have two words a line.
fn below_each_other(p: &Parameter) {
    let default = match p.default.as_str() {
        "-" => String::new(),
        "(required)" => ", required".to_owned(),
        default => format!(", default {default}"),
    };
    line(format_args!("{}: {}{default}", p.key, p.takes));
    line(format_args!("    {}\n", p.meaning));
}

fn description(entry: &Entry) -> String {
    let text = entry.schema.get("description").and_then(serde_json::Value::as_str);
    text.unwrap_or_default().replace('\n', " ")
}
