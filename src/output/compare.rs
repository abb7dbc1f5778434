//! The comparison of runs as tables.

use super::run::number;
use super::run::tone;
use super::terminal::{Detail, Tone};
use super::{line, marked_line, marked_table, right, table};
use navfuse_report::compare::{Comparison, RunResult, StateResult};

/// Number of states in the table of the largest differences.
const STATES: usize = 5;

/// Prints the comparison: runs, states that differ most, differing keys, sensors, states, and the
/// verdicts.
pub fn tables(comparison: &Comparison) {
    if !Detail::is_quiet() {
        for run in &comparison.runs {
            line(format_args!("{}  {}", run.letter, run.origin));
        }
        line("");
        differences(comparison);
        keys(comparison);
        results(comparison);
        sensors(comparison);
        states(comparison);
    }
    for run in &comparison.runs {
        let verdict = run.verdict_text.as_deref().unwrap_or("not judged");
        let mark = run.severity.map(|severity| (severity.verdict(), tone(severity.into())));
        marked_line(format_args!("verdict of {}: {verdict}", run.letter), mark.as_slice());
    }
}

/// The first heading, and after it the letters of the runs.
fn headings<'a>(first: &'a str, comparison: &'a Comparison) -> Vec<&'a str> {
    let letters = comparison.runs.iter().map(|r| r.letter.as_str());
    std::iter::once(first).chain(letters).collect()
}

fn keys(comparison: &Comparison) {
    if comparison.scenario.is_empty() {
        line("the scenarios are equal\n");
        return;
    }
    let mut rows = table(&headings("scenario", comparison));
    for key in &comparison.scenario {
        let shown = |v: &Option<String>| v.clone().unwrap_or_else(|| "not set".to_owned());
        rows.add_row(std::iter::once(key.key.clone()).chain(key.values.iter().map(shown)));
    }
    line(format_args!("{rows}\n"));
}

fn differences(comparison: &Comparison) {
    let first = comparison.runs.first().map_or("", |r| r.letter.as_str());
    let mut rows = table(&["largest difference", "run", "in sigma", "at"]);
    for largest in comparison.differences.iter().take(STATES) {
        rows.add_row([
            largest.state.clone(),
            format!("{} - {first}", largest.run),
            format!("{:.2}", largest.sigmas),
            format!("{:.1} s", largest.time_s),
        ]);
    }
    if !comparison.differences.is_empty() {
        right(&mut rows, 2..4);
        line(format_args!("{rows}\n"));
    }
}

fn results(comparison: &Comparison) {
    let mut rows = table(&headings("result", comparison));
    let mut add = |name: &str, value: &dyn Fn(&RunResult) -> Option<String>| {
        let values: Vec<Option<String>> = comparison.runs.iter().map(value).collect();
        if values.iter().any(Option::is_some) {
            let shown = values.into_iter().map(Option::unwrap_or_default);
            rows.add_row(std::iter::once(name.to_owned()).chain(shown));
        }
    };
    let metres = |m: Option<f64>| m.map(|m| format!("{m:.2} m"));
    add("horizontal error at the end", &|r| metres(r.final_error_m));
    add("horizontal error, rms", &|r| metres(r.rms_error_m));
    add("distance", &|r| r.distance_m.map(|m| format!("{m:.0} m")));
    add("duration", &|r| Some(format!("{:.0} s", r.duration_s)));
    add("warnings and errors", &|r| Some(r.warnings.to_string()));
    add("verdict", &|r| Some(r.words().to_owned()));
    right(&mut rows, 1..comparison.runs.len() + 1);
    line(format_args!("{rows}\n"));
}

fn sensors(comparison: &Comparison) {
    let mut rows =
        table(&["sensor", "run", "used", "gated", "rejected", "mean NIS", "expected", ""]);
    for sensor in &comparison.sensors {
        let mut name = sensor.sensor.clone();
        for (run, result) in comparison.runs.iter().zip(&sensor.runs) {
            let mut cells = vec![std::mem::take(&mut name), run.letter.clone()];
            if let Some(r) = result {
                let nis = |nis: Option<f64>| nis.map_or_else(String::new, |n| format!("{n:.2}"));
                cells.extend([r.used, r.gated, r.rejected].map(|count| count.to_string()));
                cells.extend([nis(r.mean_nis), nis(r.expected_nis)]);
                cells.push(if r.inside { "" } else { "outside" }.to_owned());
            }
            rows.add_row(cells);
        }
    }
    right(&mut rows, 2..7);
    marked_table(&rows, &[("outside", Tone::Bad)]);
    line("");
}

fn states(comparison: &Comparison) {
    let first = comparison.runs.first().map_or("", |r| r.letter.as_str());
    let minus = format!("minus {first}");
    let headings = ["state", "", "error", "rms", "1-sigma", &minus, "its sigma", "unit"];
    let mut rows = table(&headings);
    for state in &comparison.states {
        state_rows(state, comparison, |cells| {
            rows.add_row(cells);
        });
    }
    right(&mut rows, 2..7);
    line(format_args!("{rows}\n"));
    line(format_args!(
        "its sigma: of the difference of independent estimates; runs that share samples differ by \
         less{}\n",
        comparison.other_ends().map_or_else(String::new, |ends| format!(". {ends}"))
    ));
}

fn state_rows(state: &StateResult, comparison: &Comparison, mut add: impl FnMut(Vec<String>)) {
    let mut name = state.state.clone();
    for (run, result) in comparison.runs.iter().zip(&state.runs) {
        let mut cells = vec![std::mem::take(&mut name), run.letter.clone()];
        if let Some(r) = result {
            let shown = |v: Option<f64>| v.map_or_else(String::new, |v| number(v, r.sigma));
            cells.extend(
                [r.error, r.rms_error, Some(r.sigma), r.difference, r.difference_sigma].map(shown),
            );
            cells.push(state.unit.clone());
        }
        add(cells);
    }
}
