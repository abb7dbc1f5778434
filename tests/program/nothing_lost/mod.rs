//! Nothing is lost, nothing is overwritten, and a log from a stranger can do nothing but be read.

mod bounds;
#[cfg(target_os = "linux")]
mod disk_full;
mod folders;
mod overwriting;
#[cfg(unix)]
mod signals;
mod stranger;

use crate::common::recording::Recording;
use crate::common::{command, scenario};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Runs the recording's scenario with the output in its folder.
fn run(recording: &Recording, more: &[&str]) -> Output {
    let (scenario, out) = (recording.path("rest.toml"), recording.path("out"));
    let mut command = command();
    command.arg("run").arg(scenario).arg("--out").arg(out).args(more);
    command.output().expect("the command starts")
}

/// A run of many seconds into a folder.
fn long_run(folder: &Path) -> Command {
    // a shell under nohup ignores SIGHUP, and its children inherit that
    let mut long = Command::new("env");
    long.arg("--default-signal=HUP")
        .arg(command().get_program())
        .arg("run")
        .arg(scenario("pan-wu-3d"))
        .arg("--out")
        .arg(folder);
    long.args(["--set", "sensor.imu.simulation.rate=1 kHz", "--set", "estimator.start=0 s"]);
    long.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    long
}

/// Waits until a file has this many bytes.
fn wait_for(path: &Path, bytes: u64) {
    let begun = Instant::now();
    while std::fs::metadata(path).map_or(0, |m| m.len()) < bytes {
        assert!(begun.elapsed() < Duration::from_secs(60), "no {}", path.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Sends a signal to a program.
fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|s| s.success()));
}
