//! `navfuse status`.

use crate::error::{CommandError, Result};
use crate::output::{Format, line, table};
use clap::Args;
use navfuse_live::{STATUS, Status as State};
use navfuse_observability::{Determination, words};
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
    estimate(state);
    let [median, most, largest] = state.latency_ms;
    line(format_args!("latency, ms: median {median:.3}, 99 % {most:.3}, largest {largest:.3}"));
    let columns = ["sensor", "state", "Hz", "age, s", "NIS", "share", "used", "gated", "rejected"];
    let mut rows = table(&[&columns[..], &["wrong stamps"]].concat());
    for sensor in &state.sensors {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.1}"));
        rows.add_row([
            sensor.name.clone(),
            sensor.state.word().to_owned(),
            number(sensor.rate_hz),
            number(sensor.age_s),
            number(sensor.nis),
            sensor.share.map_or("-".to_owned(), |share| format!("{:.0} %", 100.0 * share)),
            sensor.used.to_string(),
            sensor.gated.to_string(),
            sensor.rejected.to_string(),
            sensor.refused.to_string(),
        ]);
    }
    line(format_args!("{rows}"));
    open_states(state);
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

/// Prints the estimate and its 1-sigma, as far as there is one.
fn estimate(state: &State) {
    let (values, sigmas) = (&state.estimate, &state.accuracy);
    if let Some([latitude, longitude, height]) = values.position_deg_deg_m {
        line(format_args!("position: {latitude:.7} deg, {longitude:.7} deg, height {height:.2} m"));
    }
    if let Some([north, east, down]) = values.velocity_ned_mps {
        line(format_args!("velocity north, east, down, m/s: {north:.3}, {east:.3}, {down:.3}"));
    }
    if let Some([roll, pitch, heading]) = values.roll_pitch_heading_deg {
        line(format_args!("roll, pitch, heading, deg: {roll:.3}, {pitch:.3}, {heading:.3}"));
    }
    for (what, sigma) in [
        ("position, m", sigmas.position_m),
        ("velocity, m/s", sigmas.velocity_mps),
        ("attitude, deg", sigmas.attitude_deg),
    ] {
        if let Some([north, east, down]) = sigma {
            line(format_args!("1-sigma of the {what}: {north:.3}, {east:.3}, {down:.3}"));
        }
    }
}

/// Prints the components of the state that are not determined yet, and what would help.
fn open_states(state: &State) {
    let count = state.states.iter().filter(|s| s.verdict == Determination::Determined).count();
    if !state.states.is_empty() {
        line(format_args!("{count} of {} components are determined", state.states.len()));
    }
    for open in &state.states {
        if !matches!(open.verdict, Determination::InPart | Determination::NotDetermined) {
            continue;
        }
        let sigma = words::short(open.sigma);
        let help = open.manoeuvre.as_ref().map_or(String::new(), |m| format!("; would help: {m}"));
        let why = open.missing.as_deref().unwrap_or_default();
        let (title, unit, verdict) = (&open.title, &open.unit, open.verdict.text());
        line(format_args!("{title}: {verdict}, 1-sigma {sigma} {unit}: {why}{help}"));
    }
}
