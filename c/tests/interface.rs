//! The C interface, by programs that the C compiler of this machine builds.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use navfuse_testing::absent::{Need, skip};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The folder of this crate.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Builds the example in a language of the compiler; `None` without a compiler.
fn build(language: &str, to: &Path) -> Option<PathBuf> {
    let library = std::env::current_exe().unwrap().parent().unwrap().to_owned();
    let program = to.join(format!("dive-{language}"));
    let built = Command::new("cc")
        .args(["-Wall", "-Wextra", "-Werror", "-x", language])
        .args([&root().join("examples/dive.c"), Path::new("-x"), Path::new("none")])
        .arg(format!("-I{}", root().join("include").display()))
        .arg(format!("-L{}", library.display()))
        .arg(format!("-Wl,-rpath,{}", library.display()))
        .args(["-lnavfuse_c", "-lm", "-o"])
        .arg(&program)
        .output();
    let Ok(built) = built else {
        skip(Need::Unix, "no C compiler");
        return None;
    };
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    Some(program)
}

fn run(program: &Path, arguments: &[&Path]) -> Output {
    Command::new(program).args(arguments).output().unwrap()
}

#[test]
fn a_program_in_c_pushes_samples_reads_the_estimate_and_has_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = build("c", folder.path()) else { return };
    let out = folder.path().join("out");
    let output = run(&program, &[&root().join("tests/dive.toml"), &out]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("s: 45.0000"), "{text}");
    assert!(out.join("run.mcap").is_file() && out.join("live.json").is_file());
}

#[test]
fn the_header_and_its_example_are_c_plus_plus_too() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = build("c++", folder.path()) else { return };
    let output = run(&program, &[&root().join("tests/dive.toml")]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_scenario_that_does_not_fit_is_refused_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = build("c", folder.path()) else { return };
    let wrong = folder.path().join("wrong.toml");
    std::fs::write(&wrong, "name = \"wrong\"\n[sensor.sonar]\n").unwrap();
    for (scenario, reason) in [(wrong, "sonar"), (folder.path().join("none.toml"), "none.toml")] {
        let output = run(&program, &[&scenario]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.contains(reason), "{text}");
    }
}
