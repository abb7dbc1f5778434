//! Shared by the end-to-end tests: the command as a user calls it, and the library as a program
//! does.
#![allow(dead_code, reason = "every test file uses a part of it")]

pub mod recording;

use navfuse_core::document::Document;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
#[allow(unused_imports, reason = "some test files skip nothing of their own")]
pub use navfuse_testing::absent::{Need, data, skip};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

/// Returns the root of the repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the path of a scenario of the repository.
pub fn scenario(name: &str) -> PathBuf {
    root().join("scenarios").join(format!("{name}.toml"))
}

/// Runs a scenario in this process, without sinks.
pub fn run_without_sinks(path: &Path, settings: &[String]) -> Finished {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(path).expect("the scenario is there");
    let scenario = Scenario::new(&registry, document, settings).expect("the settings fit");
    let assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    runner::run(assembly, &AtomicBool::new(false), |_| {})
}

/// Returns the command.
pub fn command() -> Command {
    Command::new(env!("CARGO_BIN_EXE_navfuse"))
}

/// Calls the command.
pub fn navfuse(arguments: &[&str]) -> Output {
    command().args(arguments).output().expect("the command starts")
}

/// Returns standard output as text.
pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Returns standard error as text.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns the folder of the recorded Snapir runs; without them, the test is skipped.
pub fn snapir() -> Option<PathBuf> {
    let origin = "The recordings are runs T01, T06, T10 and T12 of the public repository \
                  ansfl/A-KIT (Cohen & Klein 2025), prepared as in \
                  docs/src/explanation/validation.md";
    data("snapir", origin)
}

/// Returns the folder of the recorded drive; without it, the test is skipped.
pub fn drive() -> Option<PathBuf> {
    let origin = "The recording is data/drive_0708 of the public repository \
                  rtklibexplorer/GNSS_IMU, prepared as in docs/src/explanation/validation.md";
    data("drive", origin)
}

/// Runs `job` for every item on all cores, in order.
pub fn parallel<T: Send, I: Send + Sync + Copy>(
    items: &[I],
    job: impl Fn(I) -> T + Sync,
) -> Vec<T> {
    items.par_iter().map(|item| job(*item)).collect()
}
