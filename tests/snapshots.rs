//! Tables and messages as the command prints them, whole: a change is reviewed by reading it.
//!
//! `INSTA_UPDATE=always cargo test --workspace --test snapshots` writes them anew; read `git diff`.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![cfg(unix)]

mod common;

use common::{command, root, stderr, stdout};
use std::io::Write;
use std::process::Stdio;

/// What a command prints on 100 columns, standard output first. Lines with times of computing are
/// left out.
fn printed(arguments: &[&str], input: &str) -> String {
    on_columns("100", arguments, input)
}

fn on_columns(columns: &str, arguments: &[&str], input: &str) -> String {
    let mut command = command();
    command.args(arguments).current_dir(root()).env("COLUMNS", columns).env("NO_COLOR", "1");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command starts");
    let pipe = child.stdin.take().expect("standard input is a pipe");
    (&pipe).write_all(input.as_bytes()).expect("the command reads its input");
    drop(pipe);
    let output = child.wait_with_output().expect("the command ends");
    let both = stdout(&output) + &stderr(&output);
    let lines = both.lines().filter(|l| !l.contains(" m in ") && !l.contains(" jobs on "));
    lines.map(|line| line.trim_end().to_owned() + "\n").collect()
}

#[test]
fn the_tables_of_a_run() {
    let run = ["run", "scenarios/quickstart.toml", "--no-output", "--set", "estimator.stop=200 s"];
    insta::assert_snapshot!(printed(&run, ""));
}

#[test]
fn a_verdict_with_a_fault() {
    let run = ["run", "scenarios/faults/dvl-lever-arm.toml", "--no-output"];
    insta::assert_snapshot!(printed(&run, ""));
}

#[test]
fn the_table_of_a_campaign() {
    let stop = ["--set", "estimator.stop=200 s"];
    let campaign = ["monte-carlo", "scenarios/quickstart.toml", "--runs=3", "--no-output"];
    insta::assert_snapshot!(printed(&[&campaign[..], &stop].concat(), ""));
}

#[test]
fn the_mistakes_of_a_scenario() {
    let scenario = "[sensor.dvl]\nnoise = \"5 kg\"\n\n[sensr.depth]\nnoise = \"5 cm\"\n";
    insta::assert_snapshot!(printed(&["check", "-"], scenario));
}

#[test]
fn the_help_of_every_command_on_80_columns() {
    let definition = navfuse::definition();
    let names = definition.get_subcommands().map(clap::Command::get_name);
    let mut help = on_columns("80", &["--help"], "");
    for name in names {
        help += &format!("\n$ navfuse {name} --help\n");
        help += &on_columns("80", &[name, "--help"], "");
    }
    insta::assert_snapshot!(help);
}
