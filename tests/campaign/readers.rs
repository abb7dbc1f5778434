//! Two independent readers of Parquet files find the values of the report in the tables.
//!
//! They come from the Python package index into a virtual environment under the target folder.
//! Without Python or the index, the test prints that it is skipped, and passes.

use crate::common::root;
use crate::{SHORT, output, path};
use std::path::{Path, PathBuf};
use std::process::Command;

const READERS: [&str; 3] = ["polars==2.1.0", "pandas==3.1.1", "pyarrow==26.0.1"];

/// Runs a command and returns its output, or the reason of its failure.
fn run(command: &mut Command) -> Result<String, String> {
    let output = command.output().map_err(|e| e.to_string())?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if output.status.success() { Ok(text(&output.stdout)) } else { Err(text(&output.stderr)) }
}

/// Returns a Python with the readers.
fn python() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("tables");
    let python = folder.join("bin/python");
    let check = "import importlib.metadata as m\n\
                 for p in ('polars', 'pandas', 'pyarrow'): print(f'{p}=={m.version(p)}')";
    if run(Command::new(&python).args(["-c", check]))
        .is_ok_and(|found| found.split_whitespace().eq(READERS))
    {
        return Ok(python);
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    run(Command::new(&python)
        .args(["-m", "pip", "install", "--quiet", "--retries", "1"])
        .args(READERS))?;
    Ok(python)
}

#[test]
fn independent_readers_find_the_values_of_the_report_in_the_tables() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => {
            eprintln!("SKIPPED: no python3 with {}: {why}", READERS.join(", "));
            return;
        }
    };
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (campaign, sweep, quickstart) = (at("campaign"), at("sweep"), path("quickstart"));
    output(&["monte-carlo", &quickstart, "--runs=12", "--out", &campaign, SHORT[0], SHORT[1]]);
    // at the second point the scale factor is not a state: its columns are empty there
    let vary = ["--vary", "sensor.dvl.scale={sigma = \"1 %\"},{initial = 1.0}", "--runs=3"];
    output(&[&["sweep", &quickstart, "--out", &sweep], &vary[..], &SHORT].concat());
    let script = root().join("tests/campaign/readers.py");
    let printed = run(Command::new(&python).arg(script).args([&campaign, &sweep]))
        .unwrap_or_else(|e| panic!("{e}"));
    println!("{printed}");
    assert_eq!(printed.matches("agrees with its tables").count(), 4, "{printed}");
}
