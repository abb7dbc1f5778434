//! `navfuse status`.

use crate::error::{CommandError, Result};
use crate::output::{Format, line, table};
use clap::Args;
use navfuse_live::{STATUS, SensorState, Status as State};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, SystemTime};

/// Age of the state of a run beyond which the run has stopped: it is written every second.
const STOPPED: Duration = Duration::from_secs(5);

/// Arguments of `status`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse status runs/vehicle
  navfuse status runs/vehicle --format json | jq .sensors")]
pub struct Status {
    /// The folder of the run
    pub folder: PathBuf,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Prints the state of a live run. The exit code is 1 if the run has stopped.
pub fn status(arguments: &Status) -> Result<ExitCode> {
    let path = arguments.folder.join(STATUS);
    let remedy = "; name the folder of a run of `navfuse live`";
    let read = std::fs::read_to_string(&path);
    let text = read.map_err(CommandError::file(&path, "cannot be read", remedy))?;
    let state: State = serde_json::from_str(&text).map_err(|e| {
        let text = format!("{}: not whole: {e}; is the disk full?", path.display());
        CommandError::Request(text)
    })?;
    let changed = std::fs::metadata(&path).and_then(|m| m.modified()).ok();
    let age = changed.and_then(|at| SystemTime::now().duration_since(at).ok()).unwrap_or_default();
    if arguments.format == Format::Text {
        print(&state, age);
    } else {
        line(text.trim_end());
    }
    Ok(if age > STOPPED { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn print(state: &State, age: Duration) {
    let time =
        state.time_s.map_or("no estimate yet".to_owned(), |t| format!("estimate at {t:.3} s"));
    let now = match age > STOPPED {
        true => format!("stopped, {:.0} s ago", age.as_secs_f64()),
        false => "running".to_owned(),
    };
    line(format_args!("{}: {now}; {time}; {}", state.name, state.text));
    for (what, sigma) in [
        ("position, m", state.accuracy.position_m),
        ("velocity, m/s", state.accuracy.velocity_mps),
        ("attitude, deg", state.accuracy.attitude_deg),
    ] {
        if let Some([north, east, down]) = sigma {
            line(format_args!("1-sigma of the {what}: {north:.3}, {east:.3}, {down:.3}"));
        }
    }
    let [median, most, largest] = state.latency_ms;
    line(format_args!("latency, ms: median {median:.3}, 99 % {most:.3}, largest {largest:.3}"));
    let columns = ["sensor", "state", "Hz", "age, s", "NIS", "used", "gated", "rejected"];
    let mut rows = table(&[&columns[..], &["wrong stamps"]].concat());
    for sensor in &state.sensors {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.1}"));
        rows.add_row([
            sensor.name.clone(),
            words(sensor.state).to_owned(),
            number(sensor.rate_hz),
            number(sensor.age_s),
            number(sensor.nis),
            sensor.used.to_string(),
            sensor.gated.to_string(),
            sensor.rejected.to_string(),
            sensor.refused.to_string(),
        ]);
    }
    line(format_args!("{rows}"));
    if let Some(command) = &state.command {
        line(format_args!("last command: {command}"));
    }
    for sensor in &state.sensors {
        if let Some([drift, sigma]) = sensor.clock.drift_ppm {
            let delay = sensor.clock.delay_s.map_or(String::new(), |delay| {
                format!("{:.1} ms behind the driving sensor, ", 1e3 * delay)
            });
            let name = &sensor.name;
            line(format_args!(
                "clock of {name}: {delay}drift {drift:.0} ppm, 1-sigma {sigma:.0} ppm"
            ));
        }
    }
    for link in state.links.iter().filter(|link| link.dropped > 0 || link.ended) {
        let ended = if link.ended { ", ended" } else { "" };
        line(format_args!(
            "link {}: {} samples, {} dropped{ended}",
            link.name, link.samples, link.dropped
        ));
    }
}

fn words(state: SensorState) -> &'static str {
    match state {
        SensorState::Waiting => "waiting",
        SensorState::Used => "used",
        SensorState::Gated => "gated",
        SensorState::Rejected => "rejected",
        SensorState::Silent => "silent",
        SensorState::Contradicting => "contradicting",
        SensorState::Off => "off",
    }
}
