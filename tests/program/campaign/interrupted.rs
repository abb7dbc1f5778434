//! Ctrl-C in the middle of a campaign, and worse.
#![cfg(unix)]

use crate::campaign::same::files;
use crate::campaign::{SHORT, json, output, path, table};
use crate::common::{command, navfuse, stderr};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Starts a campaign of very many runs in a folder, and interrupts it once at least a thousand rows
/// are written.
fn interrupt(folder: &Path, more: &[&str]) -> Output {
    let mut campaign = command();
    campaign.args([
        "monte-carlo",
        &path("quickstart"),
        "--runs",
        "100000",
        "--set",
        "estimator.stop=100 s",
    ]);
    campaign.args(["--every", "100 ms", "--out"]).arg(folder).args(more);
    let child =
        campaign.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the command starts");
    let begun = Instant::now();
    while std::fs::metadata(folder.join("runs.parquet.part")).map_or(0, |m| m.len()) < 100_000 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no runs are written");
        std::thread::sleep(Duration::from_millis(5));
    }
    let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(signal.is_ok_and(|s| s.success()));
    child.wait_with_output().expect("it ends")
}

#[test]
fn an_interrupted_campaign_reports_the_completed_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = interrupt(folder.path(), &[]);
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    let done =
        json(&folder.path().join("campaign.json"))["done"].as_u64().expect("the number of jobs");
    assert!(
        stderr(&output).contains(&format!("interrupted: {done} of 100001 jobs were done")),
        "{}",
        stderr(&output)
    );
    let report = json(&folder.path().join("report.json"));
    let runs = report["points"][0]["runs"].as_u64().expect("the number of runs");
    assert_eq!(runs, done - 1); // one job is the bound
    let rows = table(&folder.path().join("runs.parquet"));
    assert_eq!(rows["run"].len() as u64, 401 * runs); // from 60 s to 100 s
    assert_eq!(table(&folder.path().join("epochs.parquet"))["runs"], vec![runs as f64; 401]);
    assert_eq!(table(&folder.path().join("bounds.parquet"))["epoch"].len(), 401);
}

#[test]
fn an_interrupted_part_names_the_remedy_and_is_not_merged() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = interrupt(folder.path(), &["--shard", "1/2", "--format=json"]);
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("interrupted: ") && stderr(&output).contains("run it again"),
        "{}",
        stderr(&output)
    );
    let printed: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!((&printed["shard"], &printed["asked"]), (&"1/2".into(), &50_000.into()));
    let log = json(&folder.path().join("campaign.json"));
    assert_eq!(printed["done"], log["done"]);
    assert!(!table(&folder.path().join("runs.parquet"))["run"].is_empty());
    let merged = folder.path().join("merged");
    let output = navfuse(&[
        "merge",
        &folder.path().display().to_string(),
        "--out",
        &merged.display().to_string(),
    ]);
    let message = stderr(&output);
    let expected =
        format!("part 1/2 was interrupted after {} of 50000 jobs; run it again", log["done"]);
    assert!(!output.status.success() && message.contains(&expected), "{message}");
    assert!(!merged.exists());
}

#[test]
fn a_killed_campaign_resumes_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
    let quickstart = path("quickstart");
    let campaign = [&["monte-carlo", &quickstart, "--runs=40", "--jobs=2"], &SHORT[..]].concat();
    let into = |out: &Path, more: &[&str]| {
        let out = out.display().to_string();
        output(&[&campaign, more, &["--out", &out]].concat())
    };
    into(&whole, &[]);
    let mut started = command();
    let child = started.args(&campaign).arg("--out").arg(&killed).stdout(Stdio::null()).spawn();
    let mut child = child.expect("the command starts");
    let journal = killed.join("campaign.journal");
    let begun = Instant::now();
    while std::fs::metadata(&journal).map_or(0, |m| m.len()) < 100_000 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no journal is written");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("it can be killed"); // SIGKILL
    child.wait().expect("it ends");
    assert!(!killed.join("campaign.json").exists(), "it was killed before its end");
    let other = ["--seed=9", "--resume", "--out", &killed.display().to_string()];
    let refused = stderr(&navfuse(&[&campaign, &other[..]].concat()));
    assert!(refused.contains("campaign.journal") && refused.contains("--seed"), "{refused}");
    into(&killed, &["--resume"]);
    std::fs::remove_dir_all(killed.join("earlier")).expect("the table of runs was cut off");
    assert!(files(&killed) == files(&whole));
    // once it is complete, nothing is left to do
    let report = std::fs::metadata(killed.join("report.json")).and_then(|m| m.modified());
    into(&killed, &["--resume"]);
    let again = std::fs::metadata(killed.join("report.json")).and_then(|m| m.modified());
    assert_eq!(report.ok(), again.ok());
}
