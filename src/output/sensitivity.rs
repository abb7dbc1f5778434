//! The sensitivities of a run as a table.

use super::terminal::Tone;
use super::{line, marked_table, right, table};
use navfuse_diagnose::{Row, Sensitivity};

/// Mark of a change beyond sigma.
const MARK: &str = "> sigma";

/// Prints the change of each state by each thing, and the things that matter.
pub fn print(found: &Sensitivity) {
    if found.things.is_empty() {
        return line("the scenario models everything of usual size");
    }
    // the names are wider than the numbers below them
    line("change of the end by");
    let numbers: Vec<String> = (1..=found.things.len()).map(|k| format!("({k})")).collect();
    for (number, thing) in numbers.iter().zip(&found.things) {
        line(format_args!("  {number} {thing}"));
    }
    let headings = ["state", "unit", "sigma"].into_iter();
    let headings = headings.chain(numbers.iter().map(String::as_str)).chain([""]);
    let mut rows = table(&headings.collect::<Vec<_>>());
    found.rows.iter().for_each(|row| {
        rows.add_row(cells(row));
    });
    right(&mut rows, 2..3 + found.things.len());
    marked_table(&rows, &[(MARK, Tone::Doubtful)]);
    line(format_args!(
        "{} of {} components would move by more than their sigma",
        found.exceeding(),
        found.rows.len()
    ));
}

fn cells(row: &Row) -> Vec<String> {
    let number = |value: &f64| format!("{value:.2e}");
    let mark = if row.exceeds { MARK } else { "" };
    [format!("{} {}", row.state, row.component), row.unit.to_owned(), number(&row.sigma)]
        .into_iter()
        .chain(row.moves.iter().map(number))
        .chain([mark.to_owned()])
        .collect()
}
