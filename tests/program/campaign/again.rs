//! A run of a campaign, repeated alone.

use crate::campaign::{SHORT, output, path, table};
use crate::common::{stderr, stdout};
use serde_json::Value;
use std::collections::BTreeMap;
use std::process::Command;

/// Repeats the worst run of each point with the arguments in the report; it ends with the errors in
/// `runs.parquet`.
fn ends_the_same(campaign: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    let scenario = campaign[1];
    let text = output(&[campaign, &["--out", &out, "--format=json"]].concat());
    let report: Value = serde_json::from_str(&text).expect("one JSON object");
    let rows = table(&folder.path().join("runs.parquet"));
    for (number, point) in report["points"].as_array().expect("the points").iter().enumerate() {
        let worst = &point["worst"];
        let again = worst["again"].as_str().expect("the arguments that repeat it");
        // as a shell reads it
        let line = format!("exec \"$0\" run \"$1\" --no-output --format=json {again}");
        let output = Command::new("sh")
            .args(["-c", &line, env!("CARGO_BIN_EXE_navfuse"), scenario])
            .output();
        let output = output.expect("the shell starts");
        assert!(output.status.success(), "{again}: {}", stderr(&output));
        let alone: Value = serde_json::from_str(&stdout(&output)).expect("one JSON object");
        let is_it = |k: &usize| {
            rows["point"][*k] == number as f64 && Some(rows["run"][*k]) == worst["run"].as_f64()
        };
        let last = (0..rows["run"].len()).rfind(is_it).expect("its rows");
        let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
        for state in point["states"].as_array().expect("the states") {
            let (name, component) =
                (state["state"].as_str().unwrap_or(""), state["component"].as_str().unwrap_or(""));
            let k = seen.entry(name).or_default();
            let error = alone["states"][name]["error"][*k].as_f64().expect("an error");
            assert_eq!(
                error,
                rows[&format!("{name}.{component}.error")][last],
                "{again}: {name}.{component}"
            );
            *k += 1;
        }
        assert_eq!(seen.values().sum::<usize>(), 19);
    }
}

#[cfg(unix)]
#[test]
fn a_run_repeated_as_reported_ends_with_the_same_errors() {
    let (quickstart, set) = (path("quickstart"), ["--set", "sensor.depth.noise=10 cm"]);
    let campaign = ["monte-carlo", &quickstart, "--runs", "3", SHORT[0], SHORT[1], set[0], set[1]];
    ends_the_same(&campaign);
    ends_the_same(&[&campaign[..], &["--start=given", "--seed=9"]].concat());
}

#[cfg(unix)]
#[test]
fn a_run_of_a_sweep_repeated_as_reported_ends_with_the_same_errors() {
    let vary =
        ["--vary", "sensor.dvl.misalignment.sigma=0.5 deg,[\"1 deg\", \"2 deg\", \"3 deg\"]"];
    ends_the_same(&[
        "sweep",
        &path("quickstart"),
        vary[0],
        vary[1],
        "--runs",
        "2",
        SHORT[0],
        SHORT[1],
    ]);
}

#[cfg(unix)]
#[test]
fn the_text_has_the_command_that_repeats_the_worst_run() {
    let quickstart = path("quickstart");
    let text =
        output(&["monte-carlo", &quickstart, "--runs", "2", "--no-output", SHORT[0], SHORT[1]]);
    let repeat = format!(
        "; again: navfuse run {quickstart} --set \"estimator.stop=100 s\" --set estimator.draw=all"
    );
    assert!(text.contains("has the largest NEES at the end") && text.contains(&repeat), "{text}");
}
