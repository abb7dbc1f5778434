//! Memory does not grow with the length of a log.
#![cfg(target_os = "linux")]
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::{command, scenario};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Returns the peak resident memory of a command, MiB, as the kernel counts it.
fn peak_memory(command: &mut Command) -> f64 {
    let mut child =
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the command starts");
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0.0_f64;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        if let Some(kib) = line
            .and_then(|l| l.trim().strip_suffix(" kB"))
            .and_then(|l| l.trim().parse::<f64>().ok())
        {
            peak = peak.max(kib / 1024.0);
        }
        if let Some(status) = child.try_wait().expect("the command can be waited for") {
            assert!(status.success(), "{status}");
            return peak;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Runs the 3D scenario with an IMU of a rate, recording only the log, then replays that log.
fn peaks(out: &Path, rate: &str) -> (f64, f64) {
    let sinks = ["--set", "sink.rerun.enabled=false"];
    let rate = format!("sensor.imu.simulation.rate={rate}");
    let run = peak_memory(
        command()
            .arg("run")
            .arg(scenario("pan-wu-3d"))
            .args(sinks)
            .args(["--set", &rate])
            .arg("--out")
            .arg(out),
    );
    let replay = out.join("again");
    let log = out.join("run.mcap");
    let replay = peak_memory(command().arg("replay").arg(log).args(sinks).arg("--out").arg(replay));
    (run, replay)
}

/// With 206 thousand and 1.03 million IMU samples, neither run nor replay exceeds 64 MiB. Five
/// times the samples take at most 4 MiB more, while the log grows by far more.
#[test]
fn a_run_and_its_replay_stay_below_64_mib_for_any_length_of_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let (short, long) = (folder.path().join("short"), folder.path().join("long"));
    let (a, b) = (peaks(&short, "100 Hz"), peaks(&long, "500 Hz"));
    println!(
        "peak memory: {:.1} and {:.1} MiB to run, {:.1} and {:.1} MiB to replay",
        a.0, b.0, a.1, b.1
    );
    for (short, long) in [(a.0, b.0), (a.1, b.1)] {
        assert!(long < 64.0, "{long} MiB");
        assert!(long < short + 4.0, "{short} MiB, then {long} MiB");
    }
}
