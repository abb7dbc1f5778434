//! `navfuse monte-carlo`, `bound`, `sweep` and `merge` as a user calls them.

mod again;
mod bad_input;
mod from;
mod interrupted;
mod json;
mod readers;
mod same;
mod several;

use crate::common::{navfuse, scenario, stderr, stdout};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// 40 s of filter in the quickstart.
const SHORT: [&str; 2] = ["--set", "estimator.stop=100 s"];

/// Returns the path of a scenario of the repository as an argument.
fn path(name: &str) -> String {
    scenario(name).display().to_string()
}

/// Calls the command, which succeeds, and returns its output.
fn output(arguments: &[&str]) -> String {
    let output = navfuse(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    stdout(&output)
}

/// Returns the JSON object in a file.
fn json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns the columns of numbers of a Parquet file.
fn table(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let file = std::fs::File::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let reader =
        SerializedFileReader::new(file).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut columns: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for row in reader.get_row_iter(None).expect("it has rows") {
        let row = row.expect("a row");
        for (name, field) in row.get_column_iter() {
            let value = match field {
                Field::Long(whole) => *whole as f64,
                Field::Double(real) => *real,
                _ => continue,
            };
            columns.entry(name.clone()).or_default().push(value);
        }
    }
    columns
}
