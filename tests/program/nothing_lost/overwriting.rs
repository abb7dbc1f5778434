//! No command writes over an input or over a file that navfuse did not write, and every one keeps
//! its earlier result.

use crate::common::recording::Recording;
use crate::common::{command, stderr, stdout};
use crate::nothing_lost::run;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;

/// Calls of the commands that write, with `@` for the output: a file, or a folder and the file in
/// it that stands for all.
const CALLS: &[(&str, &str, &str)] = &[
    ("run", "rest.toml --out @", "run.mcap"),
    #[cfg(feature = "rerun")]
    ("run", "rest.toml --out @", "run.rrd"),
    ("replay", "out/run.mcap --out @", "run.mcap"),
    ("smooth", "rest.toml --out @", "run.mcap"),
    ("monte-carlo", "quick.toml --runs 1 --out @", "report.json"),
    ("bound", "quick.toml --out @", "bounds.parquet"),
    ("sweep", "quick.toml --vary estimator.update=ekf,iekf --out @", "campaign.json"),
    ("merge", "part --out @", "report.json"),
    ("observability", "rest.toml --out @", "observability.json"),
    ("report", "out/run.mcap --out @", ""),
    ("compare", "out/run.mcap rest.toml --out @", "compare.html"),
    ("export", "out/run.mcap --to csv --out @", ""),
    ("export", "out/run.mcap --to tum --out @", ""),
    ("export", "out/run.mcap --to ros2 --out @", "metadata.yaml"),
    ("completions", "man --out @", "navfuse-run.1"),
    ("import", "imu.csv dvl.csv --position 30,5,0 --out @", ""),
    ("calibrate", "moving.toml --method ekf --initialise @", ""),
];

/// Commands that run for minutes, or that write into a new folder alone. They reject a file of
/// somebody else before they begin.
const LONG_CALLS: [(&str, &str, &str); 4] = [
    ("figures", "pan-wu --out @", "index.html"),
    ("diagnose", "rest.toml --apply @", ""),
    ("new-plugin", "my-sensor --path @", "Cargo.toml"),
    ("live", "rest.toml --set link={stdin={}} --out @", "run.mcap"),
];

/// Commands that write no file. `view` writes a recording beside a log that has none.
const OTHERS: [&str; 9] =
    ["budget", "check", "detect", "list", "play", "schema", "sensitivity", "status", "view"];

/// The files and folders below a folder, with their content.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(content(&path));
        } else {
            found.insert(path.display().to_string(), fs::read(&path).expect("it can be read"));
        }
    }
    found
}

fn output(recording: &Recording, name: &str, arguments: &str, out: &str) -> Output {
    let mut command = command();
    command.current_dir(recording.folder()).arg(name);
    command.args(arguments.split(' ').map(|a| if a == "@" { out } else { a }));
    command.output().expect("the command starts")
}

fn call(recording: &Recording, name: &str, arguments: &str, out: &str) -> (bool, String) {
    let output = output(recording, name, arguments, out);
    (output.status.code().is_some_and(|code| [0, 3].contains(&code)), stderr(&output))
}

/// A folder with a log, scenarios, and a part of a campaign.
fn prepared() -> Recording {
    let recording = Recording::new();
    assert!(run(&recording, &[]).status.success());
    let quick = fs::read_to_string(crate::common::scenario("quickstart")).expect("it is there");
    recording.write("quick.toml", &quick.replace("[estimator]", "[estimator]\nstop = \"90 s\""));
    recording.write("moving.toml", &quick);
    let (done, error) =
        call(&recording, "monte-carlo", "quick.toml --runs 1 --shard 1/1 --out @", "part");
    assert!(done, "{error}");
    recording
}

#[test]
fn every_command_that_writes_has_a_case() {
    let definition = navfuse::definition();
    let names: Vec<&str> = definition.get_subcommands().map(clap::Command::get_name).collect();
    for name in &names {
        let mut calls = CALLS.iter().chain(&LONG_CALLS);
        let has_case = calls.any(|(command, ..)| command == name) || OTHERS.contains(name);
        assert!(has_case, "navfuse {name} has no case in CALLS");
    }
    for name in CALLS.iter().chain(&LONG_CALLS).map(|(name, ..)| name).chain(&OTHERS) {
        assert!(names.contains(name), "there is no command {name}");
    }
}

#[test]
fn no_command_writes_over_a_file_of_somebody_else() {
    let recording = prepared();
    for (k, (name, arguments, inner)) in CALLS.iter().chain(&LONG_CALLS).enumerate() {
        let out = format!("theirs-{k}");
        let file = recording.path(&out).join(inner);
        let file = if inner.is_empty() { recording.path(&out) } else { file };
        fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
        fs::write(&file, "theirs").expect("the test can write");
        let (done, error) = call(&recording, name, arguments, &out);
        assert!(!done, "{name} {arguments}: {error}");
        let why = match *name {
            "new-plugin" => "is there already",
            _ => "navfuse did not write it",
        };
        assert!(error.contains(&out) && error.contains(why), "{name} {arguments}: {error}");
        assert_eq!(error.matches("give another").count(), 1, "one remedy: {error}");
        assert_eq!(fs::read_to_string(&file).expect("it is there"), "theirs", "{name}");
    }
}

#[test]
fn every_command_keeps_its_earlier_result_and_prints_results_alone_where_asked() {
    let recording = prepared();
    for (k, (name, arguments, inner)) in CALLS.iter().enumerate() {
        let out = format!("again-{k}");
        let (done, error) = call(&recording, name, arguments, &out);
        assert!(done, "{name} {arguments}: {error}");
        let path = recording.path(&out);
        let file = if inner.is_empty() { path } else { path.join(inner) };
        let first = fs::read(&file).expect("it was written");
        let again = output(&recording, name, &format!("{arguments} -q"), &out);
        assert!(again.status.code().is_some_and(|code| [0, 3].contains(&code)), "{name} again");
        assert_eq!(stderr(&again), "", "{name} {arguments}");
        let printed = stdout(&again);
        assert!(!printed.contains('─') && printed.lines().count() < 60, "{name}: {printed}");
        let earlier = content(&file.with_file_name("earlier"));
        assert!(earlier.values().any(|kept| *kept == first), "{name} {arguments}");
    }
}

/// Spellings of the path of an input.
#[test]
#[cfg(unix)]
fn no_command_writes_over_its_input_whatever_its_name() {
    let recording = prepared();
    let (log, folder) = (recording.path("out/run.mcap"), recording.folder().display().to_string());
    std::os::unix::fs::symlink(&log, recording.path("link")).expect("a link");
    std::os::unix::fs::symlink(recording.path("link"), recording.path("chain")).expect("a link");
    fs::hard_link(&log, recording.path("hard")).expect("a link");
    let before = content(recording.folder());
    let spellings = [
        "out/run.mcap",
        "./out/../out/run.mcap",
        "link",
        "chain",
        "hard",
        &format!("{folder}/link"),
    ];
    for out in spellings {
        for arguments in ["report", "export --to csv", "export --to sbet", "export --to geojson"] {
            let (name, more) = arguments.split_once(' ').unwrap_or((arguments, ""));
            let arguments = format!("out/run.mcap {more} --out @").replace("  ", " ");
            let (done, error) = call(&recording, name, &arguments, out);
            assert!(!done && error.contains("it is an input"), "{name} {out}: {error}");
        }
    }
    for (name, arguments, out) in [
        ("replay", "out/run.mcap --out @", "out"),
        ("merge", "part --out @", "part"),
        ("calibrate", "moving.toml --method ekf --initialise @", "moving.toml"),
        ("compare", "out/run.mcap rest.toml --out @", "out/run.mcap"),
    ] {
        let (done, error) = call(&recording, name, arguments, out);
        assert!(!done, "{name}: {error}");
    }
    assert!(content(recording.folder()) == before);
}
