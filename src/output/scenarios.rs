//! The results of campaigns of several scenarios as one table.

use super::{aside, line, right};
use navfuse_campaign::{Campaign, LIMIT, Outcomes, Results, WorstState};
use serde::Serialize;
use std::collections::BTreeMap;

/// One scenario of the table.
#[derive(Debug, Serialize)]
pub struct Row {
    /// Name of the scenario.
    scenario: String,
    /// Runs that reached their end.
    runs: usize,
    /// Runs that ended early.
    failed: usize,
    /// Worst component at the end.
    worst_at_end: Option<WorstState>,
    /// Worst component at any time.
    worst_ever: Option<WorstState>,
    /// Runs by what a user learns from them alone.
    #[serde(flatten)]
    outcomes: Outcomes,
    /// Verdict on the consistency of errors and uncertainty.
    consistent: Option<bool>,
}

/// The rows of the scenarios.
pub fn rows<'a>(all: impl Iterator<Item = (&'a Campaign, &'a Results)>) -> Vec<Row> {
    let row = |(campaign, results): (&Campaign, &Results)| {
        let (statistics, report) = (results.points.first()?, results.report.points.first()?);
        Some(Row {
            scenario: campaign.scenario.clone(),
            runs: statistics.runs,
            failed: statistics.failures.len(),
            worst_at_end: statistics.worst_at_end(&campaign.columns),
            worst_ever: statistics.worst_ever(&campaign.columns),
            outcomes: statistics.outcomes.clone(),
            consistent: report.verdict.as_ref().map(|v| v.consistent),
        })
    };
    all.filter_map(row).collect()
}

/// Prints a table with a row for each scenario.
pub fn table<'a>(all: impl Iterator<Item = (&'a Campaign, &'a Results)>) {
    let within = format!("within {LIMIT} sigma");
    let mut table = super::table(&[
        "scenario",
        "worst state",
        "at the end",
        "meanwhile",
        &within,
        "do not use",
        "doubtful",
        "missed",
        "named first",
        "warnings name",
        "verdict",
    ]);
    for row in rows(all) {
        let Outcomes { within, refused, doubtful, missed, warned, blamed } = &row.outcomes;
        let [end, ever] = [&row.worst_at_end, &row.worst_ever]
            .map(|worst| worst.as_ref().map_or_else(String::new, |w| ratio(w.ratio)));
        let verdict = match row.consistent {
            Some(true) => "consistent",
            Some(false) => "INCONSISTENT",
            None => "",
        };
        table.add_row([
            row.scenario.clone(),
            row.worst_at_end.as_ref().map_or_else(String::new, |w| w.name.clone()),
            end,
            ever,
            within.to_string(),
            refused.to_string(),
            doubtful.to_string(),
            missed.to_string(),
            counted(blamed),
            counted(warned),
            verdict.to_owned(),
        ]);
    }
    right(&mut table, 2..8);
    line(&table);
    aside("");
    aside("at the end, meanwhile: largest error of a state over its sigma, rms over the runs;");
    aside("missed: runs that end with a larger error and do not report \"do not use\";");
    aside("named first: sensor or state that the verdict of a run names first");
}

/// Names with the number of their runs, the most frequent first, such as `dvl 29, imu 1`.
fn counted(names: &BTreeMap<String, usize>) -> String {
    let mut names: Vec<(&String, &usize)> = names.iter().collect();
    names.sort_by_key(|(_, runs)| std::cmp::Reverse(**runs));
    let names = names.iter().map(|(name, runs)| format!("{name} {runs}"));
    names.collect::<Vec<_>>().join(", ")
}

/// A ratio to three digits, such as `1.02`, `23.4` or `1.2e5`.
fn ratio(ratio: f64) -> String {
    match ratio {
        r if r < 9.995 => format!("{r:.2}"),
        r if r < 99.95 => format!("{r:.1}"),
        r if r < 99_999.5 => format!("{r:.0}"),
        r => format!("{r:.1e}"),
    }
}
