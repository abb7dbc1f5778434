//! Two independent readers of Parquet files find the values of the report in the tables.
//!
//! They come from the Python package index into a virtual environment under the target folder.
//! Without Python or the index, the test is skipped.

use crate::campaign::{SHORT, output, path};
use crate::common::root;
use navfuse_testing::python;
use std::process::Command;

#[test]
fn independent_readers_find_the_values_of_the_report_in_the_tables() {
    let Some(python) = python::tables(env!("CARGO_TARGET_TMPDIR")).python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (campaign, sweep, quickstart) = (at("campaign"), at("sweep"), path("quickstart"));
    output(&["monte-carlo", &quickstart, "--runs=12", "--out", &campaign, SHORT[0], SHORT[1]]);
    // at the second point the scale factor is not a state: its columns are empty there
    let vary = ["--vary", "sensor.dvl.scale={sigma = \"1 %\"},{initial = 1.0}", "--runs=3"];
    output(&[&["sweep", &quickstart, "--out", &sweep], &vary[..], &SHORT].concat());
    let script = root().join("tests/program/campaign/readers.py");
    let printed = python::output(Command::new(&python).arg(script).args([&campaign, &sweep]))
        .unwrap_or_else(|e| panic!("{e}"));
    println!("{printed}");
    assert_eq!(printed.matches("agrees with its tables").count(), 4, "{printed}");
}
