//! Plugins in crates of their own, outside of the workspace: those in `examples`, and one from
//! `navfuse new-plugin`. They are built without a network, pass their tests, and run their
//! scenarios.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod common;

use common::{navfuse, root, stderr, stdout};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Mutex;

/// Lock for one crate at a time, since the crates share the build of navfuse.
static BUILDING: Mutex<()> = Mutex::new(());

/// The test of a crate, with the features of its command: both use one build of navfuse.
const TEST: &[&str] = &["test", "--offline", "--features", "command"];

/// Calls cargo in a crate, with the versions of the workspace.
fn cargo(folder: &Path, arguments: &[&str]) -> Output {
    std::fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock"))
        .expect("the workspace has a Cargo.lock");
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .current_dir(folder)
        .env("CARGO_TARGET_DIR", root().join("target/outside"))
        // most of the time is the build: no debug information, and the rest of navfuse not optimised
        .env("CARGO_PROFILE_DEV_DEBUG", "false")
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0")
        .output()
        .expect("cargo starts");
    assert!(
        output.status.success(),
        "cargo {}:\n{}{}",
        arguments.join(" "),
        stdout(&output),
        stderr(&output)
    );
    output
}

/// Tests a crate, runs its scenario, and returns the printed line of a state.
fn state(folder: &Path, name: &str) -> String {
    let _one = BUILDING.lock();
    cargo(folder, &["fmt", "--check"]);
    let tested = cargo(folder, TEST);
    assert!(stdout(&tested).contains("test result: ok. 1 passed"), "{}", stdout(&tested));
    let ran = cargo(folder, &["--offline", "navfuse", "run", "scenario.toml", "--no-output"]);
    let printed = stdout(&ran);
    let line = printed.lines().find(|l| l.contains(name));
    line.unwrap_or_else(|| panic!("no {name} in:\n{printed}")).to_owned()
}

/// Counts all lines of a file, including blank lines and comments.
fn lines(path: &Path) -> usize {
    std::fs::read_to_string(path).expect("the file is there").lines().count()
}

#[test]
fn a_sensor_that_the_tree_does_not_contain_is_one_file_of_a_page_and_a_main_of_10_lines() {
    let folder = root().join("examples/outside-sensor");
    assert!(lines(&folder.join("src/lib.rs")) <= 60);
    assert!(lines(&folder.join("src/main.rs")) < 10);
    state(&folder, "magnetometer.declination");
}

#[test]
fn process_manifold_trajectory_source_and_sink_are_pluggable_from_outside() {
    let _one = BUILDING.lock();
    let folder = root().join("examples/outside-vehicle");
    cargo(&folder, &["fmt", "--check"]);
    let tested = cargo(&folder, TEST);
    assert!(stdout(&tested).contains("test result: ok. 1 passed"), "{}", stdout(&tested));
    let out = tempfile::tempdir().unwrap();
    let run = |name: &str, source: Option<String>| {
        let path = out.path().join(name).display().to_string();
        let mut arguments = vec!["--offline", "navfuse", "run", "scenario.toml", "--out", &path];
        arguments.extend(["--format", "json"]);
        if let Some(source) = &source {
            arguments.extend(["--set", source]);
        }
        let summary: serde_json::Value =
            serde_json::from_slice(&cargo(&folder, &arguments).stdout).unwrap();
        summary["states"].clone()
    };
    let first = run("first", None);
    assert!(first.to_string().contains("steady.course"), "{first}");
    let samples = out.path().join("first/samples.txt");
    let again = run(
        "again",
        Some(format!("source={{ lines = {{ path = {:?} }} }}", samples.display().to_string())),
    );
    assert_eq!(first, again, "the source reads what the sink wrote, to the bit");
    assert_eq!(
        std::fs::read(&samples).unwrap(),
        std::fs::read(out.path().join("again/samples.txt")).unwrap()
    );
}

#[test]
fn a_new_plugin_builds_conforms_and_runs_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sea-log");
    let made = navfuse(&["new-plugin", "sea-log", "--path", path.to_str().unwrap()]);
    assert!(made.status.success(), "{}", stderr(&made));
    assert!(lines(&path.join("src/lib.rs")) <= 60);
    assert!(lines(&path.join("src/main.rs")) < 10);
    state(&path, "sea-log.scale");
}

#[test]
fn a_new_plugin_overwrites_nothing_and_has_a_name_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, path: &Path, message: &str| {
        let made = navfuse(&["new-plugin", name, "--path", path.to_str().unwrap()]);
        assert!(!made.status.success() && stderr(&made).contains(message), "{}", stderr(&made));
    };
    refused("mine", folder.path(), "is there already; remove it, or give another --path");
    let path = folder.path().join("new");
    refused("dvl", &path, "there is a sensor type dvl already");
    refused("Mine", &path, "\"Mine\" is not a valid crate name: start with a lower-case letter");
    assert!(!path.exists());
}
