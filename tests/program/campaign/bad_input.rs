//! Bad input to campaigns gives a message that names the place and the remedy, and no panic.

use crate::campaign::{SHORT, output, path};
use crate::common::recording::Recording;
use crate::common::{navfuse, stderr, stdout};
use std::path::{Path, PathBuf};

/// Checks that the command fails with a message that has all of the parts, without a panic or
/// results.
fn fails_with(arguments: &[&str], parts: &[&str]) {
    let output = navfuse(arguments);
    let message = stderr(&output);
    assert!(!output.status.success(), "{arguments:?} should fail: {}", stdout(&output));
    for part in parts {
        assert!(message.contains(part), "{arguments:?}: no {part:?} in:\n{message}");
    }
    assert!(!message.contains("panicked"), "{message}");
    assert_eq!(stdout(&output), "", "{arguments:?}");
}

/// Checks a short campaign of the quickstart with an error, which writes nothing.
fn campaign_fails_with(command: &str, more: &[&str], parts: &[&str]) {
    fails_with(&[&[command, &path("quickstart"), "--no-output"], more].concat(), parts);
}

#[test]
fn recorded_data_are_rejected() {
    let recording = Recording::new();
    let scenario = recording.path("rest.toml").display().to_string();
    for command in ["monte-carlo", "bound"] {
        fails_with(
            &[command, &scenario, "--no-output"],
            &["recording", "simulated", "[source.simulation]"],
        );
    }
}

#[test]
fn a_scenario_with_neither_a_reference_nor_initial_values_is_rejected() {
    let off = ["--set", "sensor.reference.enabled=false"];
    for command in ["monte-carlo", "bound"] {
        campaign_fails_with(
            command,
            &off,
            &["quickstart.toml:13", "initial value", "[sensor.reference]"],
        );
    }
}

#[test]
fn options_that_do_not_fit_are_named() {
    let fails = |more: &[&str], parts: &[&str]| campaign_fails_with("monte-carlo", more, parts);
    fails(&["--every", "5 m"], &["--every \"5 m\"", "length", "time is needed", "min"]);
    fails(&["--every", "0 s"], &["--every 0 s", "positive"]);
    fails(&["--every", "soon"], &["--every \"soon\""]);
    fails(&["--jobs", "0"], &["--jobs 0", "at least one"]);
    fails(&["--runs", "0"], &["--runs 0", "at least one", "navfuse bound"]);
    fails(&["--runs", "1000001"], &["--runs 1000001", "at most 1000000"]);
    fails(&["--seed", "10000000000000"], &["--seed 10000000000000", "at most"]);
    fails(&["--set", "sensor.dvl.noize=1 cm/s"], &["noize", "did you mean \"noise\"?"]);
    let quickstart = path("quickstart");
    for shard in ["8/7", "0/7", "seven", "1/0"] {
        let parts = ["--shard", shard, "1/7, 2/7 ... 7/7"];
        fails_with(&["monte-carlo", &quickstart, "--shard", shard, "--out", "never-made"], &parts);
    }
    assert!(!Path::new("never-made").exists());
    fails_with(&["monte-carlo", "not-there.toml"], &["not-there.toml"]);
}

#[test]
fn an_output_folder_that_is_a_file_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("taken");
    std::fs::write(&file, "mine").expect("the test can write");
    let out = file.display().to_string();
    fails_with(
        &["monte-carlo", &path("quickstart"), "--runs=1", "--out", &out],
        &[&out, "--out", "cannot be made"],
    );
    assert_eq!(std::fs::read_to_string(&file).expect("it is there"), "mine");
}

#[test]
fn a_variation_that_does_not_fit_is_named() {
    let fails = |vary: &[&str], parts: &[&str]| campaign_fails_with("sweep", vary, parts);
    fails(&["--vary", "sensor.dvl.noize=1 cm/s"], &["sensor.dvl.noize", "did you mean \"noise\"?"]);
    fails(
        &["--vary", "sensor.dvl.noise=1 cm/s,2 cm"],
        &["sensor.dvl.noise", "2 cm", "length", "cm/s"],
    );
    fails(&["--vary", "sensor.dvl.noise"], &["--vary \"sensor.dvl.noise\"", "key.path=v1,v2"]);
    fails(&["--vary", "sensor.dvl.noise="], &["--vary \"sensor.dvl.noise=\"", "key.path=v1,v2"]);
    fails(
        &["--vary", "sensor.dvl.noise=1 cm/s,"],
        &["--vary \"sensor.dvl.noise=1 cm/s,\"", "not empty"],
    );
    fails(
        &["--vary", "sensor.dvl.noise=1 cm/s,1 cm/s"],
        &["sensor.dvl.noise", "1 cm/s is given twice"],
    );
    fails(&["--vary", "seed=1,2"], &["--vary seed", "--seed"]);
    fails(&["--vary", "estimator.draw=all,start"], &["--vary estimator.draw", "--start=given"]);
    let noise = "sensor.dvl.noise=1 cm/s";
    fails(&["--vary", noise, "--vary", noise], &["--vary sensor.dvl.noise", "twice", "KEY=V1,V2"]);
    fails(&["--vary", noise, "--show", "dvl.skale"], &["--show dvl.skale", "dvl.scale"]);
    fails(&[], &["--vary"]);
}

/// Three parts of a short campaign.
struct Parts {
    folder: tempfile::TempDir,
}

impl Parts {
    fn new() -> Self {
        let parts = Self { folder: tempfile::tempdir().expect("a folder") };
        (1..=3)
            .for_each(|index| parts.make(&index.to_string(), &format!("{index}/3"), &["--seed=1"]));
        parts
    }

    /// Makes a part of a campaign of five runs.
    fn make(&self, name: &str, shard: &str, more: &[&str]) {
        let (quickstart, out) = (path("quickstart"), self.at(name));
        let campaign = [
            "monte-carlo",
            &quickstart,
            "--runs=5",
            "--shard",
            shard,
            "--out",
            &out,
            SHORT[0],
            SHORT[1],
        ];
        output(&[&campaign, more].concat());
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn at(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// Checks that merging those parts fails with a message that has all of these words, without
    /// results.
    fn fail_with(&self, parts: &[&str], words: &[&str]) {
        let out = self.at("merged");
        let parts: Vec<String> = parts.iter().map(|name| self.at(name)).collect();
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        fails_with(&[&["merge"], &parts[..], &["--out", &out]].concat(), words);
        assert!(!self.path("merged").join("report.json").exists());
    }

    /// Tests with a damaged file, which is restored afterwards.
    fn damaged(&self, file: &str, damage: impl Fn(&[u8]) -> Option<Vec<u8>>, words: &[&str]) {
        let path = self.path(file);
        let bytes = std::fs::read(&path).expect("it is there");
        match damage(&bytes) {
            Some(other) => std::fs::write(&path, other).expect("the test can write"),
            None => std::fs::remove_file(&path).expect("the test can remove it"),
        }
        self.fail_with(&["1", "2", "3"], words);
        std::fs::write(&path, bytes).expect("the test can write");
    }
}

#[test]
fn parts_that_do_not_fit_or_are_missing_are_named() {
    let parts = Parts::new();
    parts.fail_with(&["1", "2"], &["part 3/3 is missing", "--shard 3/3"]);
    parts.fail_with(&["2", "3"], &["part 1/3 is missing", "--shard 1/3"]);
    parts.fail_with(&["1", "2", "2", "3"], &["part 2/3 is given twice", &parts.at("2")]);
    parts.fail_with(
        &["1", "2", "nowhere"],
        &[&parts.at("nowhere"), "no part of a campaign", "--shard"],
    );
    parts.make("other seed", "3/3", &["--seed=2"]);
    parts.fail_with(
        &["1", "2", "other seed"],
        &[&parts.at("other seed"), "another campaign", "--seed is 2 instead of 1"],
    );
    parts.make("other scenario", "3/3", &["--seed=1", "--set", "sensor.dvl.noise=2 cm/s"]);
    parts.fail_with(
        &["1", "2", "other scenario"],
        &[&parts.at("other scenario"), "the scenarios differ"],
    );
    parts.make("3 of 4", "3/4", &["--seed=1"]);
    parts.fail_with(&["1", "2", "3 of 4"], &[&parts.at("3 of 4"), "it has 4 parts instead of 3"]);
    let (quickstart, whole) = (path("quickstart"), parts.at("whole"));
    output(&["monte-carlo", &quickstart, "--runs=1", "--out", &whole, SHORT[0], SHORT[1]]);
    parts.fail_with(&["whole"], &[&whole, "a whole campaign", "--shard"]);
    fails_with(&["merge"], &["<PARTS>"]);
    let [one, two, three] = ["1", "2", "3"].map(|name| parts.at(name));
    fails_with(
        &["merge", &one, &two, &three, "--out", &one],
        &[&one, "cannot be the output", "--out"],
    );
    fails_with(
        &["merge", &one, &two, &three, "--show=dvk", "--out", &parts.at("merged")],
        &["--show dvk", "sweep"],
    );
}

#[test]
fn damaged_parts_are_named_with_the_remedy() {
    let parts = Parts::new();
    let half = |bytes: &[u8]| Some(bytes[..bytes.len() / 2].to_vec());
    let gone = |_: &[u8]| None;
    let (runs, bounds, log) = ("3/runs.parquet", "1/bounds.parquet", "2/campaign.json");
    for file in [runs, bounds] {
        let named = parts.at(file);
        parts.damaged(file, half, &[&named, "not complete", "make it again"]);
        parts.damaged(file, gone, &[&named, "make it again"]);
        parts.damaged(file, |_| Some(b"nothing of the kind".to_vec()), &[&named, "make it again"]);
    }
    parts.damaged(log, half, &[&parts.at(log), "not complete", "run this part again"]);
    parts.damaged(log, gone, &[&parts.at(log), "no part of a campaign"]);
    // a file of another part in its place
    let other = std::fs::read(parts.path("2/runs.parquet")).expect("it is there");
    parts.damaged(
        runs,
        |_| Some(other.clone()),
        &[&parts.at("3"), "runs.parquet", "part 3/3", "run it again"],
    );
    let other = std::fs::read(parts.path(bounds)).expect("it is there");
    parts.damaged(
        "2/bounds.parquet",
        |_| Some(other.clone()),
        &[&parts.at("2"), "bounds.parquet", "part 2/3"],
    );
    // one bit: in the middle of the numbers, which are compressed, and near the end
    for file in [runs, bounds] {
        for place in [3, 9] {
            let flip = |bytes: &[u8]| {
                let mut bytes = bytes.to_vec();
                let at = bytes.len() * place / 10;
                bytes[at] ^= 0x10;
                Some(bytes)
            };
            parts.damaged(file, flip, &[&parts.at(file), "again"]);
        }
    }
    // undamaged, they are one campaign
    let [one, two, three] = ["1", "2", "3"].map(|name| parts.at(name));
    output(&["merge", &one, &two, &three, "--out", &parts.at("merged")]);
}
