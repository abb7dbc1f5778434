//! The result of a run as tables.

use super::{line, right, table, warn};
use comfy_table::Table;
use navfuse_core::model::record::{Event, Level};
use navfuse_core::model::verdict::Verdict;
use navfuse_core::run::summary::{Recorded, StateRow, Summary};
use navfuse_core::state::Mode;
use navfuse_core::units::time::Time;

/// Prints the result of a run.
pub fn summary(summary: &Summary) {
    line(&summary.scenario);
    let mut states = table(&["state", "", "estimate", "1-sigma", "error", "error/sigma", "unit"]);
    for row in &summary.rows {
        state(row, &mut states);
    }
    right(&mut states, 2..6);
    line(format_args!("{states}\n"));
    let mut sensors =
        table(&["sensor", "read", "used", "gated", "rejected", "mean NIS", "expected", "band", ""]);
    for (name, value) in &summary.samples {
        let text = |key: &str| value.get(key).map_or_else(String::new, ToString::to_string);
        let used = value
            .get("used")
            .or_else(|| value.get("accepted"))
            .map_or_else(String::new, ToString::to_string);
        let nis = value
            .get("mean_nis")
            .and_then(serde_json::Value::as_f64)
            .map_or_else(String::new, |n| format!("{n:.2}"));
        let mut rejected = text("rejected");
        if let Some(excluded) = value.get("excluded") {
            let and = if rejected.is_empty() { "" } else { ", " };
            rejected += &format!("{and}{excluded} excluded");
        }
        let [expected, band, mark] = consistency(&summary.verdict, name);
        let counts = [name.clone(), text("read"), used, text("gated"), rejected, nis];
        sensors.add_row([&counts[..], &[expected, band, mark]].concat());
    }
    right(&mut sensors, 1..8);
    line(format_args!("{sensors}\n"));
    for (name, start) in &summary.starts {
        line(format_args!("{name} {}", start["text"].as_str().unwrap_or_default()));
    }
    line(format_args!(
        "{:.0} s and {:.0} m in {:.2} s",
        summary.duration_s, summary.distance_m, summary.wall_s
    ));
    if let Some(e) = &summary.horizontal_error_m {
        let percent = e
            .percent_of_distance
            .map_or_else(String::new, |p| format!(", {p:.3} % of the distance"));
        line(format_args!(
            "horizontal error {:.2} m at the end{percent}; {:.2} m rms",
            e.last, e.rms
        ));
    }
    if let Some(e) = &summary.filtered_horizontal_error_m {
        line(format_args!("the filter alone: {:.2} m at the end; {:.2} m rms", e.last, e.rms));
    }
}

/// The expected NIS of a sensor, the band of its mean, and a mark if the mean is outside.
fn consistency(verdict: &Verdict, sensor: &str) -> [String; 3] {
    verdict.sensor(sensor).map_or_else(Default::default, |s| {
        let mark = if s.inside { "" } else { "outside" };
        [
            format!("{:.2}", s.expected_nis),
            format!("{:.2} to {:.2}", s.band.low, s.band.high),
            mark.to_owned(),
        ]
    })
}

/// Prints the reasons of a verdict with their remedies, and the verdict in the last line.
pub fn verdict(verdict: &Verdict) {
    for reason in &verdict.reasons {
        let level = navfuse_core::model::verdict::VerdictLevel::from(reason.severity).words();
        let remedy =
            if reason.remedy.is_empty() { String::new() } else { format!("; {}", reason.remedy) };
        line(format_args!("{level}: {reason}{remedy}"));
    }
    line(format_args!("verdict: {verdict}"));
}

fn state(row: &StateRow, table: &mut Table) {
    if row.mode == Mode::Fixed && row.error.is_none() {
        return;
    }
    for (k, component) in row.components.iter().enumerate() {
        let sigma = row.sigma[k];
        let angle =
            row.estimate.len() == 3 && row.unit == "m" && k < 2 && component.ends_with("itude");
        let estimate = if angle {
            format!("{:.7} deg", row.estimate[k])
        } else {
            number(row.estimate[k], sigma)
        };
        let error = row.error.as_ref().map(|e| e[k]);
        let then = row.error_sigma[k]; // at the error's time
        let ratio = error.filter(|_| then > 0.0).map_or_else(String::new, |e| fixed(e / then, 1));
        let sigma_text = match row.mode {
            Mode::Fixed => "fixed".to_owned(),
            Mode::Consider => format!("{} considered", number(sigma, sigma)),
            Mode::Estimate => number(sigma, sigma),
        };
        table.add_row([
            if k == 0 { row.name.clone() } else { String::new() },
            (*component).to_owned(),
            estimate,
            sigma_text,
            error.map_or_else(String::new, |e| number(e, sigma)),
            ratio,
            row.unit.to_owned(),
        ]);
    }
}

/// A number with the digits that are significant given its sigma, and one more.
pub fn number(value: f64, sigma: f64) -> String {
    let decimals = if sigma > 0.0 && sigma.is_finite() {
        (1.0 - sigma.log10().floor()).clamp(0.0, 9.0)
    } else {
        6.0
    };
    fixed(value, decimals as usize)
}

/// A number with this many decimals; a zero has no sign.
fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = value.is_finite() && !text.contains(|c: char| c.is_ascii_digit() && c != '0');
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Prints the places that the sinks wrote to.
pub fn recorded(recorded: &[Recorded]) {
    for r in recorded {
        line(format_args!("{:<6} {}", r.sink, r.place));
    }
}

/// Prints warnings and errors on standard error: at most 20 warnings, and all errors.
pub fn events(events: &[Event]) {
    const SHOWN: usize = 20;
    let when = |e: &Event| if e.time == Time::MIN { String::new() } else { format!("{} ", e.time) };
    let word = |e: &Event| if e.level == Level::Error { "error" } else { "warning" };
    for e in events.iter().filter(|e| e.level < Level::Error).take(SHOWN) {
        warn(format_args!("{}: {}{}: {}", word(e), when(e), e.about, e.text));
    }
    let more = events.iter().filter(|e| e.level < Level::Error).count().saturating_sub(SHOWN);
    if more > 0 {
        warn(format_args!("and {more} more warnings: see the log"));
    }
    for e in events.iter().filter(|e| e.level == Level::Error) {
        warn(format_args!("{}: {}{}: {}", word(e), when(e), e.about, e.text));
    }
}
