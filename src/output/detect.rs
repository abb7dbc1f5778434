//! What verdicts make of faults, as tables.

use super::{line, right, table};
use navfuse_diagnose::{Finding, KindRow, Plainness, counts};

/// Prints a row for each kind, and the counts of all runs.
pub fn print(rows: &[KindRow]) {
    let headings = ["kind", "2 ln LR", "error", "silent", "named", "wrong name", "missed"];
    let mut kinds = table(&[&headings[..], &["named first"]].concat());
    rows.iter().for_each(|row| {
        kinds.add_row(kind(row));
    });
    right(&mut kinds, 1..headings.len());
    line(kinds);
    line("2 ln LR: median of twice the log-likelihood ratio of a filter that knows the fault;");
    line("error: median of the largest error at the end, in its sigma;");
    line("missed: an error beyond 3.5 sigma, and no \"do not use\"");
    line("");
    confusion(rows);
}

fn kind(row: &KindRow) -> Vec<String> {
    let count = |finding| row.runs.iter().filter(|run| run.finding == finding).count();
    let mut names: Vec<&str> = row.runs.iter().filter_map(|run| run.named.as_deref()).collect();
    names.sort_unstable();
    names.dedup();
    let missed = row.runs.iter().filter(|run| run.missed()).count();
    let numbers = [
        median(row.runs.iter().filter_map(|run| run.ratio), 1),
        median(row.runs.iter().filter_map(|run| run.error), 2),
    ];
    let counts = [Finding::Silent, Finding::Named, Finding::WrongName].map(count);
    let counts = counts.into_iter().chain([missed]).map(|n| n.to_string());
    let name = [row.name.clone()].into_iter();
    name.chain(numbers).chain(counts).chain([names.join(", ")]).collect()
}

/// The median of numbers, with so many decimals; empty for none.
fn median(numbers: impl Iterator<Item = f64>, decimals: usize) -> String {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    let middle = numbers.get(numbers.len() / 2);
    middle.map_or_else(String::new, |number| format!("{number:.decimals$}"))
}

/// Prints the runs by how plain their fault is, and what their verdicts make of it.
fn confusion(rows: &[KindRow]) {
    let mut all = table(&["fault", "runs", "silent", "named", "wrong name", "missed"]);
    for plain in Plainness::ALL {
        let name = match plain {
            Plainness::Healthy => "none",
            Plainness::Hidden => "2 ln LR below 22.6",
            Plainness::Detectable => "2 ln LR from 22.6 to 36",
            Plainness::Plain => "2 ln LR above 36",
        };
        let of = counts(rows, plain);
        let numbers = [of.runs, of.silent, of.named, of.wrong_name, of.missed];
        let name = [name.to_owned()].into_iter();
        all.add_row(name.chain(numbers.map(|n| n.to_string())).collect::<Vec<_>>());
    }
    right(&mut all, 1..6);
    line(all);
}
