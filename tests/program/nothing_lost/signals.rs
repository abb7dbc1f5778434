//! The signals with which a cluster and a terminal end a program.

use crate::common::recording::Recording;
use crate::common::{command, navfuse, stderr, stdout};
use crate::nothing_lost::{long_run, signal, wait_for};
use std::process::{Command, Stdio};

#[test]
fn a_run_ends_on_sigterm_and_sighup_as_on_ctrl_c() {
    let recording = Recording::new();
    for name in ["TERM", "HUP"] {
        let out = recording.path(name);
        let child = long_run(&out).spawn().expect("the command starts");
        wait_for(&out.join("run.mcap.part"), 1_000_000);
        signal(&child, name);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
        assert!(stderr(&output).contains("interrupted"), "{}", stderr(&output));
        assert!(stdout(&output).contains("dvl.scale"), "{}", stdout(&output));
        let log = out.join("run.mcap").display().to_string();
        let again = navfuse(&["replay", &log, "--no-output"]);
        assert!(!stderr(&again).contains("cut off"), "{}", stderr(&again));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_run_under_nohup_outlives_its_terminal() {
    let recording = Recording::new();
    let out = recording.path("out");
    let mut nohup = Command::new("nohup");
    nohup.arg(command().get_program()).arg("run").arg(crate::common::scenario("quickstart"));
    nohup.args(["--set", "sensor.imu.simulation.rate=1 kHz", "--out"]).arg(&out);
    nohup.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = nohup.spawn().expect("nohup starts");
    wait_for(&out.join("run.mcap.part"), 1_000_000);
    signal(&child, "HUP");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}
