//! Readers written by others find the estimates in the exported files.
//!
//! They come from the Python package index into a virtual environment under the target folder, or
//! are those of the interpreter that NAVFUSE_EXPORT_PYTHON names. Without Python or the index, the
//! test is skipped.

use crate::common::root;
use crate::export::{FORMATS, run};
use navfuse_testing::python;
use std::process::Command;

#[test]
fn other_programs_read_the_estimates_of_the_log() {
    let Some(python) = python::tables(env!("CARGO_TARGET_TMPDIR")).python() else { return };
    let run = run();
    for (format, _) in FORMATS {
        run.export(format, &["--origin", "2026-06-01T08:00:00Z"]);
    }
    run.export(
        "tum",
        &["--axes", "enu", "--output", &run.log.with_file_name("enu.tum").display().to_string()],
    );
    let script = root().join("tests/program/export/foreign.py");
    let output = Command::new(&python).arg(script).arg(&run.log).output().expect("it starts");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(printed.lines().filter(|l| l.ends_with("agrees")).count(), 8, "{printed}");
}
