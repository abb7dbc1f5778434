//! The result of a campaign as tables.

use super::Table;
use super::{line, right, table};
use crate::error::{CommandError, Result};
use navfuse_campaign::words::{band, begins, number, ratio, three};
use navfuse_campaign::{Campaign, Component, Judged, PointReport, Results, StateReport, WorstRun};
use std::path::{Path, PathBuf};

/// The tables that are shown.
#[derive(Clone, Copy, Debug)]
pub enum Shown<'a> {
    /// Errors against sigma and bound.
    Consistency,
    /// The bound alone.
    Bound,
    /// A grid, of these states or components, or of all.
    Grid(&'a [String]),
}

impl Shown<'_> {
    /// Rejects the name of a state that the campaign does not have.
    pub fn check(self, plan: &Campaign) -> Result<()> {
        let Self::Grid(names) = self else { return Ok(()) };
        let components = &plan.columns.components;
        match names.iter().find(|name| !components.iter().any(|c| is_of(c, name))) {
            None => Ok(()),
            Some(name) => {
                let mut all: Vec<&str> = components.iter().map(|c| c.state.as_str()).collect();
                all.dedup();
                Err(CommandError::argument(
                    format!("--show {name}"),
                    format!("there is no such state; there are {}", all.join(", ")),
                ))
            }
        }
    }

    /// True for a component that is shown.
    pub fn shows(self, component: &Component) -> bool {
        match self {
            Self::Grid(names) if !names.is_empty() => {
                names.iter().any(|name| is_of(component, name))
            }
            _ => true,
        }
    }
}

/// True if `name` is the name of the component, of its state, or of the owner of the state.
fn is_of(component: &Component, name: &str) -> bool {
    let full = component.name();
    full == name || full.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'))
}

/// Prints the result of a campaign; `scenario` is the file with which a run can be repeated.
pub fn results(plan: &Campaign, results: &Results, shown: Shown<'_>, scenario: &str) {
    match (shown, results.report.points.first()) {
        (Shown::Grid(_), _) => grid(plan, results, shown),
        (Shown::Consistency, Some(point)) => consistency(plan, point),
        (Shown::Bound, Some(_)) => bound(plan, results),
        (_, None) => {}
    }
    worst(&results.report.points, scenario);
}

/// Prints the verdict of each point in a line; a bound has none.
pub fn verdicts(results: &Results) {
    for point in &results.report.points {
        let Some(verdict) = &point.verdict else { continue };
        let point: String = point.values.iter().map(|value| format!("{value}, ")).collect();
        line(format_args!("{point}verdict: {}", verdict.text));
    }
}

/// Prints how to repeat the run to look at first: a run that failed, or else the run with the
/// largest NEES.
fn worst(points: &[PointReport], scenario: &str) {
    let all = points.iter().filter_map(|p| p.worst.as_ref());
    let failed = all.clone().find(|w| w.failure.is_some());
    let largest = || {
        all.max_by(|a, b| {
            a.nees.unwrap_or(f64::INFINITY).total_cmp(&b.nees.unwrap_or(f64::INFINITY))
        })
    };
    let Some(WorstRun { run, nees, again, .. }) = failed.or_else(largest) else { return };
    let why = nees
        .map_or("ended early".to_owned(), |n| format!("has the largest NEES at the end, {n:.1}"));
    let scenario =
        if scenario.contains(' ') { format!("{scenario:?}") } else { scenario.to_owned() };
    line(format_args!("run {run} {why}; again: navfuse run {scenario} {again}"));
}

/// Prints the names of the files that were written.
pub fn files(files: &[PathBuf], out: Option<&Path>) {
    let Some(out) = out else { return };
    let names =
        files.iter().filter_map(|f| f.file_name()).map(|n| n.to_string_lossy().into_owned());
    line(format_args!("{}: {}", out.display(), names.collect::<Vec<_>>().join(", ")));
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(String::new, |s| format!("{:.1} %", 100.0 * s))
}

/// The name of a state, on the row of its first component only.
fn once(states: &[StateReport], k: usize) -> String {
    if begins(states, k) { states[k].component.state.clone() } else { String::new() }
}

fn consistency(plan: &Campaign, point: &PointReport) {
    let failed =
        if point.failed > 0 { format!(", {} failed", point.failed) } else { String::new() };
    line(format_args!(
        "{}: {} runs{failed}, seed {}; {}:",
        plan.scenario,
        point.runs,
        plan.seed,
        if plan.smooths {
            "smoothed, root mean square over the run".to_owned()
        } else {
            format!("at {:.0} s", point.end_s)
        }
    ));
    let mut rows = table(&[
        "state",
        "",
        "RMSE",
        "1-sigma",
        "RMSE/sigma",
        "bound",
        "RMSE/bound",
        "mean error",
        "unit",
    ]);
    for (k, s) in point.states.iter().enumerate() {
        rows.add_row([
            once(&point.states, k),
            s.component.component.clone(),
            three(s.rmse),
            three(s.sigma),
            ratio(s.rmse_over_sigma),
            three(s.bound),
            ratio(s.rmse_over_bound),
            three(s.mean_error),
            s.component.unit.clone(),
        ]);
    }
    right(&mut rows, 2..8);
    line(format_args!("{rows}\n"));
    let mut rows = table(&["NEES", "dim", "mean", "95 % band", "epochs inside", "RMSE/bound"]);
    for a in &point.anees {
        let mean = number(a.value);
        let (dim, inside) = (a.dimension.to_string(), percent(a.inside));
        rows.add_row([a.of.clone(), dim, mean, band(a.band), inside, ratio(a.rmse_over_bound)]);
    }
    right(&mut rows, 1..6);
    line(format_args!("{rows}\n"));
    if !point.nis.is_empty() {
        let mut rows = table(&["NIS", "used", "gated", "mean", "expected", "95 % band"]);
        for n in &point.nis {
            let limits =
                n.band.map_or_else(String::new, |b| format!("{:.4} to {:.4}", b.low, b.high));
            let value = |v: Option<f64>| v.map_or_else(String::new, |v| format!("{v:.4}"));
            let (used, gated) = (n.used.to_string(), percent(Some(n.gated)));
            rows.add_row([n.sensor.clone(), used, gated, value(n.mean), value(n.expected), limits]);
        }
        right(&mut rows, 1..6);
        line(format_args!("{rows}\n"));
    }
    let Judged { consistent, doubtful, do_not_use } = point.judged;
    line(format_args!(
        "judged alone: {consistent} consistent, {doubtful} doubtful, {do_not_use} do not use"
    ));
    if let Some(verdict) = &point.verdict {
        let from = plan.from.map_or_else(String::new, |t| format!(" from {t} s on"));
        let word = if verdict.consistent { "consistent" } else { "INCONSISTENT" };
        line(format_args!("verdict{from}: {word}"));
        verdict.findings.iter().for_each(|f| line(format_args!("  {}", f.text)));
    }
}

fn bound(plan: &Campaign, results: &Results) {
    let Some(bound) = results.points.first().and_then(|p| p.bound.as_ref()) else { return };
    let (Some(first), Some(last)) = (bound.rows.first(), bound.rows.last()) else { return };
    line(format_args!(
        "{}: the least 1-sigma that a filter, or a smoother, can reach",
        plan.scenario
    ));
    let (start, end) = (format!("{:.0} s", first.1), format!("{:.0} s", last.1));
    let mut rows = table(&["state", "", &start, &end, "smoothed, rms", "unit"]);
    let states = &results.report.points[0].states;
    for (k, s) in states.iter().enumerate() {
        rows.add_row([
            once(states, k),
            s.component.component.clone(),
            number(Some(first.2[k])),
            number(Some(last.2[k])),
            number(s.smoothed),
            s.component.unit.clone(),
        ]);
    }
    right(&mut rows, 2..5);
    line(format_args!("{rows}\n"));
}

/// Prints one table a state: a row for each point, a column for each component.
fn grid(plan: &Campaign, results: &Results, shown: Shown<'_>) {
    let runs = plan.runs > 0;
    let what = if runs {
        format!("RMSE of {} runs over 1-sigma bound", plan.runs)
    } else {
        "1-sigma bound".into()
    };
    let points = &results.report.points;
    line(format_args!("{}: {what} at the end, {} points", plan.scenario, points.len()));
    for block in 0..plan.columns.blocks.len() {
        let range: Vec<usize> = plan
            .columns
            .of_block(block)
            .filter(|k| shown.shows(&plan.columns.components[*k]))
            .collect();
        if range.is_empty() {
            continue;
        }
        let mut headings: Vec<String> = plan.keys.clone();
        for c in range.iter().map(|k| &plan.columns.components[*k]) {
            headings.push(if c.unit.is_empty() {
                c.component.clone()
            } else {
                format!("{} [{}]", c.component, c.unit)
            });
        }
        let headings: Vec<&str> = headings.iter().map(String::as_str).collect();
        let mut rows: Table = table(&headings);
        for point in points {
            let mut cells = point.values.clone();
            for s in range.iter().map(|k| &point.states[*k]) {
                cells.push(if runs {
                    format!("{} / {}", number(s.rmse), number(s.bound))
                } else {
                    number(s.bound)
                });
            }
            rows.add_row(cells);
        }
        right(&mut rows, plan.keys.len()..plan.keys.len() + range.len());
        line(format_args!("{}\n{rows}\n", plan.columns.blocks[block].name));
    }
    if runs {
        let mut headings: Vec<&str> = plan.keys.iter().map(String::as_str).collect();
        headings.extend(["judged alone", "verdict"]);
        let mut rows = table(&headings);
        for point in points {
            let verdict = point.verdict.as_ref().map_or_else(String::new, |v| v.text.clone());
            let Judged { consistent, doubtful, do_not_use } = point.judged;
            let judged =
                format!("{consistent} consistent, {doubtful} doubtful, {do_not_use} do not use");
            rows.add_row([point.values.as_slice(), &[judged, verdict]].concat());
        }
        line(format_args!("{rows}\n"));
    }
}
