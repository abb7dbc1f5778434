//! A full disk: every time an error that names the file, in time, and the other files are whole.

use crate::common::recording::Recording;
use crate::common::{command, navfuse, stderr, stdout};
use crate::nothing_lost::run;
use std::os::unix::fs::symlink;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Time in which a full disk is reported. A run without fault takes 1 s; a program that waits for
/// ever, as the viewer's library did, takes all of it.
const PATIENCE: Duration = Duration::from_secs(60);

/// Waits for a program, and ends it when it does not end by itself.
fn in_time(mut command: Command) -> Output {
    let spawned = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = spawned.expect("the command starts");
    let begun = Instant::now();
    while child.try_wait().expect("it can be waited for").is_none() {
        if begun.elapsed() > PATIENCE {
            child.kill().expect("it can be ended");
            panic!("it did not end in {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().expect("it has ended")
}

fn fails_with(output: &Output, parts: &[&str]) {
    assert_eq!(output.status.code(), Some(1), "{}", stderr(output));
    for part in parts {
        assert!(stderr(output).contains(part), "no {part:?} in:\n{}", stderr(output));
    }
}

#[cfg(feature = "rerun")]
#[test]
fn a_recording_on_a_full_disk_is_an_error_and_the_log_is_whole() {
    let recording = Recording::new();
    std::fs::create_dir(recording.path("out")).expect("a folder");
    symlink("/dev/full", recording.path("out/run.rrd")).expect("a link");
    let mut command = command();
    command.arg("run").arg(recording.path("rest.toml")).arg("--out").arg(recording.path("out"));
    let output = in_time(command);
    fails_with(&output, &["rerun", "out/run.rrd", "No space left", "--out"]);
    assert!(stdout(&output).contains("dvl.scale"), "{}", stdout(&output));
    let log = recording.path("out/run.mcap").display().to_string();
    let again = navfuse(&["replay", &log, "--no-output"]);
    assert!(again.status.success(), "{}", stderr(&again));
    assert!(!stderr(&again).contains("cut off"), "{}", stderr(&again));
}

/// The limit of the size of a file stands for a disk that becomes full: 64 and 512 units of 512 or
/// 1024 bytes are before the first flush and in the middle of a recording of 2 MB.
#[cfg(feature = "rerun")]
#[test]
fn a_recording_that_is_cut_off_never_takes_its_name() {
    let recording = Recording::new();
    for units in ["64", "512"] {
        let out = recording.path(units);
        let mut sh = Command::new("sh");
        let script = "trap '' XFSZ; ulimit -f $1; shift; exec \"$@\"";
        sh.args(["-c", script, "sh", units, env!("CARGO_BIN_EXE_navfuse"), "run"]);
        sh.arg(crate::common::scenario("quickstart")).arg("--out").arg(&out);
        sh.args(["--set", "sink.mcap.enabled=false", "--set", "estimator.stop=200 s"]);
        let output = in_time(sh);
        fails_with(&output, &["run.rrd", "File too large"]);
        assert!(!out.join("run.rrd").exists());
    }
}

#[test]
fn tables_on_a_full_disk_are_an_error() {
    let recording = Recording::new();
    std::fs::create_dir(recording.path("out")).expect("a folder");
    symlink("/dev/full", recording.path("out/estimate.csv")).expect("a link");
    let output = run(&recording, &["--set", "sink.csv.enabled=true"]);
    fails_with(&output, &["csv", "out/estimate.csv", "No space left"]);
    assert!(recording.path("out/run.mcap").is_file());
}

#[test]
fn standard_output_on_a_full_disk_is_an_error() {
    let recording = Recording::new();
    for more in [&[][..], &["--format=json"]] {
        let full = std::fs::File::options().write(true).open("/dev/full").expect("Linux has it");
        let mut command = command();
        command.arg("run").arg(recording.path("rest.toml")).arg("--no-output").args(more);
        let output = command.stdout(full).output().expect("the command starts");
        fails_with(&output, &["standard output", "No space left"]);
    }
}

#[cfg(feature = "rerun")]
#[test]
fn figures_of_a_campaign_on_a_full_disk_are_an_error_and_the_tables_are_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    symlink("/dev/full", folder.path().join("campaign.rrd")).expect("a link");
    let mut bound = command();
    bound.arg("bound").arg(crate::common::scenario("quickstart")).arg("--out").arg(folder.path());
    bound.args(["--set", "estimator.stop=100 s"]);
    let output = in_time(bound);
    fails_with(&output, &["campaign.rrd", "No space left"]);
    assert!(stdout(&output).contains("dvl.scale"), "{}", stdout(&output));
    for name in ["bounds.parquet", "report.json", "bound.svg"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
}

#[test]
fn an_export_to_a_full_disk_or_a_closed_pipe_is_an_error_in_every_format() {
    let recording = Recording::new();
    assert!(run(&recording, &[]).status.success());
    let log = recording.path("out/run.mcap").display().to_string();
    for format in ["geojson", "kml", "gpx", "nmea", "sbet", "tum", "kitti", "csv", "parquet"] {
        let output = navfuse(&["export", &log, "--to", format, "--out", "/dev/full"]);
        fails_with(&output, &["/dev/full", "No space left"]);
        assert!(!stdout(&output).contains("epochs"), "{format}: {}", stdout(&output));
        let mut sh = Command::new("bash");
        let script = "\"$@\" | head -c 1 >/dev/null; exit ${PIPESTATUS[0]}";
        sh.args(["-c", script, "bash", env!("CARGO_BIN_EXE_navfuse"), "export", &log]);
        sh.args(["--to", format, "--out", "/dev/stdout"]);
        let output = in_time(sh);
        // the pipe holds 64 KiB, so that a short text may be written whole
        let code = output.status.code();
        assert!(code == Some(1) || code == Some(0) && stderr(&output).is_empty(), "{format}");
    }
}

#[test]
fn a_bag_on_a_full_disk_is_an_error_whichever_file_is_the_last() {
    let recording = Recording::new();
    assert!(run(&recording, &[]).status.success());
    let log = recording.path("out/run.mcap").display().to_string();
    for file in ["estimate_0.mcap", "metadata.yaml"] {
        let bag = recording.path(&format!("bag of {file}"));
        std::fs::create_dir(&bag).expect("a folder");
        symlink("/dev/full", bag.join(file)).expect("a link");
        let bag = bag.display().to_string();
        let output = navfuse(&["export", &log, "--to", "ros2", "--out", &bag]);
        fails_with(&output, &[file, "No space left"]);
        assert!(!stdout(&output).contains("epochs"), "{}", stdout(&output));
    }
}
