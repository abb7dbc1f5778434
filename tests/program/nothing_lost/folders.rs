//! The folder of a run: earlier results are kept, one run writes at a time, and a killed run leaves
//! what it had.

use crate::common::recording::Recording;
use crate::common::{navfuse, stderr, stdout};
use crate::nothing_lost::{long_run, run, signal, wait_for};
use std::path::PathBuf;

#[test]
fn an_earlier_result_is_kept_in_a_folder_of_its_time() {
    let recording = Recording::new();
    let log = recording.path("out/run.mcap");
    let mut logs = Vec::new();
    for seed in ["seed=1", "seed=2", "seed=3"] {
        let output = run(&recording, &["--set", seed, "--set", "sink.csv.enabled=true"]);
        assert!(output.status.success(), "{}", stderr(&output));
        logs.push(std::fs::read(&log).expect("the newest log has the same place every time"));
    }
    let earlier = std::fs::read_dir(recording.path("out/earlier")).expect("the folder is there");
    let mut earlier: Vec<PathBuf> = earlier.map(|e| e.expect("an entry").path()).collect();
    earlier.sort();
    assert_eq!(earlier.len(), 2, "{earlier:?}");
    for (folder, log) in earlier.iter().zip(&logs) {
        assert!(std::fs::read(folder.join("run.mcap")).expect("the log is kept") == *log);
        assert!(folder.join("estimate.csv").is_file());
    }
    assert!(!recording.path("out/run.mcap.part").exists());
    assert!(!recording.path("out/.lock").exists());
}

#[test]
fn a_scenario_with_an_error_leaves_the_earlier_result_in_its_place() {
    let recording = Recording::new();
    assert!(run(&recording, &[]).status.success());
    let log = std::fs::read(recording.path("out/run.mcap")).expect("the log is there");
    assert!(!run(&recording, &["--set", "source.csv.directory=nowhere"]).status.success());
    assert!(std::fs::read(recording.path("out/run.mcap")).expect("it is still there") == log);
    assert!(!recording.path("out/earlier").exists());
}

#[test]
fn two_runs_into_one_folder_at_once_are_refused() {
    let recording = Recording::new();
    let out = recording.path("out");
    let mut first = long_run(&out).spawn().expect("the command starts");
    wait_for(&out.join("run.mcap.part"), 1);
    let second = run(&recording, &[]);
    let refused = stderr(&second);
    first.kill().expect("it runs");
    first.wait().expect("it ends");
    assert_eq!(second.status.code(), Some(1), "{}", stdout(&second));
    assert!(refused.contains("another run writes into this folder"), "{refused}");
    assert!(refused.contains("out") && refused.contains("--out"), "{refused}");
    // the lock ends with the program, however that ends
    let third = run(&recording, &[]);
    assert!(third.status.success(), "{}", stderr(&third));
}

#[cfg(unix)]
#[test]
fn a_killed_run_leaves_a_part_of_its_log_that_can_be_replayed() {
    let recording = Recording::new();
    let out = recording.path("out");
    let mut child = long_run(&out).spawn().expect("the command starts");
    let part = out.join("run.mcap.part");
    wait_for(&part, 1_000_000);
    signal(&child, "KILL");
    child.wait().expect("it ends");
    let whole = out.join("run.mcap").display().to_string();
    let refused = stderr(&navfuse(&["replay", &whole, "--no-output"]));
    assert!(refused.contains("killed") && refused.contains(".part"), "{refused}");
    let part = part.display().to_string();
    let again = navfuse(&["replay", &part, "--format=json", "--no-output"]);
    assert!(again.status.success(), "{}", stderr(&again));
    let result: serde_json::Value = serde_json::from_str(&stdout(&again)).expect("one JSON object");
    assert!(result["samples"]["imu"]["read"].as_u64() > Some(1000), "{result}");
    // the next run keeps it
    assert!(run(&recording, &[]).status.success());
    let earlier = std::fs::read_dir(out.join("earlier")).expect("the folder is there");
    let kept = earlier.flatten().any(|e| e.path().join("run.mcap.part").is_file());
    assert!(kept);
}
