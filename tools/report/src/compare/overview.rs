//! First page of a comparison for a viewer, as Markdown: what differs, and the verdicts.

use super::{Comparison, RunResult};
use std::fmt::Write;

/// Number of states on the page.
const STATES: usize = 6;

/// Writes the page: the states that differ most, the keys that differ, and the runs with their
/// verdicts.
pub fn page(comparison: &Comparison) -> String {
    let mut page = String::new();
    let letters: Vec<&str> = comparison.runs.iter().map(|r| r.letter.as_str()).collect();
    let _ = writeln!(page, "# {}\n", letters.join(" against "));
    for run in &comparison.runs {
        let _ = writeln!(page, "- **{}** {}: **{}**", run.letter, run.origin, run.words());
    }
    let first = letters.first().copied().unwrap_or_default();
    states(&mut page, comparison, first);
    page.push_str("\n### Keys that differ\n\n");
    if comparison.scenario.is_empty() {
        page.push_str("The scenarios are equal.\n");
    } else {
        head(&mut page, "key", &letters);
    }
    for key in &comparison.scenario {
        let values = key.values.iter().map(|v| v.as_deref().unwrap_or("not set"));
        cells(&mut page, &key.key, values);
    }
    page.push_str("\n### Runs\n\n");
    head(&mut page, "", &letters);
    let mut row = |name: &str, value: &dyn Fn(&RunResult) -> Option<String>| {
        let values: Vec<Option<String>> = comparison.runs.iter().map(value).collect();
        if values.iter().any(Option::is_some) {
            let shown = values.iter().map(|v| v.as_deref().unwrap_or_default());
            cells(&mut page, name, shown);
        }
    };
    let metres = |m: Option<f64>| m.map(|m| format!("{m:.2} m"));
    row("horizontal error at the end", &|r| metres(r.final_error_m));
    row("horizontal error, rms", &|r| metres(r.rms_error_m));
    row("warnings and errors", &|r| Some(r.warnings.to_string()));
    page
}

/// The states that differ most.
fn states(page: &mut String, comparison: &Comparison, first: &str) {
    page.push_str("\n### States that differ most\n\n");
    if comparison.differences.is_empty() {
        page.push_str("The runs have no state and time in common.\n");
        return;
    }
    head(page, "state", &["run", "difference", "at"]);
    for largest in comparison.differences.iter().take(STATES) {
        let run = format!("{} - {first}", largest.run);
        let (sigmas, time) = (format!("{:.2} sigma", largest.sigmas), largest.time_s);
        cells(page, &largest.state, [run.as_str(), &sigmas, &format!("{time:.0} s")]);
    }
    page.push_str(
        "\nThe sigma is for independent errors: runs that share samples differ by less, and more \
         than 3 contradicts one of them.\n",
    );
}

/// The head of a table.
fn head(page: &mut String, first: &str, rest: &[&str]) {
    cells(page, first, rest.iter().copied());
    let _ = writeln!(page, "|---|{}", "---|".repeat(rest.len()));
}

/// A row of a table; the bar in a value would end its cell.
fn cells<'a>(page: &mut String, name: &str, values: impl IntoIterator<Item = &'a str>) {
    let _ = write!(page, "| {} |", name.replace('|', "\\|"));
    for value in values {
        let _ = write!(page, " {} |", value.replace('|', "\\|"));
    }
    page.push('\n');
}
