//! A diagnosis as a table.

use super::run::tone;
use super::terminal::Detail;
use super::{line, marked_table, right, table};
use navfuse_core::model::record::finding::Severity;
use navfuse_diagnose::{Diagnosis, Trial};

/// Rows of the table.
const ROWS: usize = 10;

/// Prints the table of the trials, and the best change.
pub fn print(diagnosis: &Diagnosis) {
    if Detail::get() != Detail::Quiet {
        trials(diagnosis);
    }
    conclusion(diagnosis);
}

fn trials(diagnosis: &Diagnosis) {
    let mut rows = table(&["change", "2 ln L", "margin", "mean NIS", "verdict", "end moves"]);
    rows.add_row(row(&Trial { change: "none".to_owned(), ..diagnosis.unchanged.clone() }, None));
    for (k, trial) in diagnosis.trials.iter().take(ROWS).enumerate() {
        rows.add_row(row(trial, diagnosis.trials.get(k + 1)));
    }
    right(&mut rows, 1..4);
    right(&mut rows, 5..6);
    marked_table(&rows, &Severity::ALL.map(|severity| (severity.verdict(), tone(severity.into()))));
    let unfit = match diagnosis.unfit {
        0 => String::new(),
        n => format!("; {n} do not fit this scenario"),
    };
    line(format_args!("{} changes were tried{unfit}", diagnosis.tried));
}

/// Cells of a trial; its margin is that over the next one.
fn row(trial: &Trial, next: Option<&Trial>) -> [String; 6] {
    let margin = next.map_or_else(String::new, |next| format!("{:.0}", trial.score - next.score));
    let nis =
        if trial.mean_nis.is_finite() { format!("{:.2}", trial.mean_nis) } else { String::new() };
    [
        trial.words(),
        format!("{:.0}", trial.gain),
        margin,
        nis,
        trial.severity.verdict().to_owned(),
        trial.moves(),
    ]
}

/// Prints the best change and its assignments.
fn conclusion(diagnosis: &Diagnosis) {
    line(diagnosis.conclusion());
    for setting in diagnosis.best().iter().flat_map(|best| &best.settings) {
        line(format_args!("  --set '{setting}'"));
    }
    if let Some(why) = diagnosis.best().and_then(|best| best.unmended) {
        line(format_args!("no key of a scenario mends it in full: {why}"));
    }
    let rivals = diagnosis.rivals();
    if !rivals.is_empty() {
        line(format_args!("without a clear margin over: {}", rivals.join("; ")));
    }
}
