//! Readers written by others find the estimates in the exported files.
//!
//! They come from the Python package index into a virtual environment under the target folder, or
//! are those of the interpreter that NAVFUSE_EXPORT_PYTHON names. Without Python or the index, the
//! test prints that it is skipped, and passes.

use crate::common::root;
use crate::{FORMATS, run};
use std::path::{Path, PathBuf};
use std::process::Command;

const PACKAGES: [&str; 7] = ["evo", "fastkml", "geojson", "gpxpy", "pandas", "pyarrow", "pynmea2"];

fn works(python: &Path) -> bool {
    let import = format!("import {}", PACKAGES.join(", "));
    Command::new(python).args(["-c", &import]).output().is_ok_and(|o| o.status.success())
}

/// Returns a Python with the readers, or prints the reason why there is none.
fn python() -> Option<PathBuf> {
    if let Some(python) = std::env::var_os("NAVFUSE_EXPORT_PYTHON").map(PathBuf::from) {
        assert!(works(&python), "{} lacks one of {PACKAGES:?}", python.display());
        return Some(python);
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("exports");
    let python = folder.join("bin/python");
    if works(&python) {
        return Some(python);
    }
    let run = |program: &Path, arguments: &[&str]| {
        let output = Command::new(program).args(arguments).output();
        output.is_ok_and(|o| o.status.success())
    };
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    let installed = run(Path::new("python3"), &["-m", "venv", &folder.display().to_string()])
        && run(&python, &[&pip[..], &PACKAGES].concat());
    if installed && works(&python) {
        return Some(python);
    }
    println!("skipped: {} need python3 with venv, and PyPI", PACKAGES.join(", "));
    None
}

#[test]
fn other_programs_read_the_estimates_of_the_log() {
    let Some(python) = python() else { return };
    let run = run();
    for (format, _) in FORMATS {
        run.export(format, &["--origin", "2026-06-01T08:00:00Z"]);
    }
    run.export(
        "tum",
        &["--axes", "enu", "--output", &run.log.with_file_name("enu.tum").display().to_string()],
    );
    let script = root().join("tests/export/foreign.py");
    let output = Command::new(&python).arg(script).arg(&run.log).output().expect("it starts");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(printed.lines().filter(|l| l.ends_with("agrees")).count(), 8, "{printed}");
}
