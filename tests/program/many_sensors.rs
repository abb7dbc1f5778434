//! The cost of a run is linear in its samples, however many sensors they come from.

use crate::common::{scenario, stderr};
use navfuse_testing::absent::{Need, skip};
use std::path::Path;
use std::process::Command;

/// The instructions of a run of 2 s with some depth sensors, each with ten samples a second; none
/// without valgrind. Unlike a time, their number does not depend on what else the machine does.
fn instructions(folder: &Path, sensors: usize) -> Option<f64> {
    let quick = std::fs::read_to_string(scenario("quickstart")).expect("the scenario");
    let quick = quick.replace("start = \"60 s\"", "start = \"1 s\"\nstop = \"2 s\"");
    let depth = |k| {
        let simulation = "simulation = { rate = \"10 Hz\" }";
        format!("\n[sensor.d{k}]\ntype = \"depth\"\nnoise = \"5 cm\"\n{simulation}\n")
    };
    let path = folder.join("many.toml");
    let text: String = std::iter::once(quick).chain((0..sensors).map(depth)).collect();
    std::fs::write(&path, text).expect("the test can write");
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]);
    valgrind.arg(env!("CARGO_BIN_EXE_navfuse")).arg("run").arg(&path).arg("--no-output");
    let output = valgrind.output().ok()?;
    assert!(output.status.success(), "{}", stderr(&output));
    let printed = stderr(&output);
    let count = printed.lines().find_map(|line| line.split_once("Collected : "));
    count.and_then(|(_, count)| count.trim().parse().ok())
}

/// Twice the sensors have twice the samples, so that they cost twice as much beside what a run costs without
/// them. Where each sample costs in proportion to the number of sensors, the ratio is four; it is 2.4 if a
/// fifth of the cost of a hundred sensors grows so. It was 2.27 when the bound was set.
#[test]
fn twice_the_sensors_cost_twice_as_much() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(none) = instructions(folder.path(), 0) else {
        return skip(Need::Valgrind, "valgrind");
    };
    let cost = |sensors| instructions(folder.path(), sensors).expect("valgrind is there") - none;
    let (few, many) = (cost(100), cost(200));
    assert!(many / few < 2.4, "{few:e} and {many:e} instructions beside {none:e}");
}
