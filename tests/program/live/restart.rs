//! The end of a run by a signal or by force, and its restart.

use super::desk::{Desk, dive, result, send, sentences, warnings};
use crate::common::{navfuse, stderr, stdout};
use navfuse_testing::absent::{Need, skip};
use serde_json::Value;
use std::io::Write;
use std::time::{Duration, Instant};

const STDIN: &str = "[link.stdin]\n";

/// The sentences of a part of the dive.
fn part(from: f64, to: f64) -> Vec<u8> {
    let inside = sentences().filter(|(_, time, _)| (from..to).contains(time));
    inside.flat_map(|(_, _, line)| format!("{line}\r\n").into_bytes()).collect()
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_run_whose_links_wait_for_bytes() {
    for signal in ["-INT", "-TERM"] {
        // nobody listens at this port, and nothing is written to standard input
        let desk = Desk::new("[link.stdin]\n[link.tcp]\naddress = \"127.0.0.1:1\"\n");
        let mut live = desk.live(&[]);
        let input = live.stdin.take().unwrap();
        desk.wait_for("it runs", |_| true);
        let begin = Instant::now();
        send(signal, &live);
        let output = live.wait_with_output().unwrap();
        assert!(begin.elapsed() < Duration::from_secs(5), "{signal}: {:?}", begin.elapsed());
        assert!(output.status.success(), "{output:?}");
        assert!(desk.path("live/run.mcap").is_file(), "its log is whole");
        drop(input);
    }
}

#[cfg(unix)]
#[test]
fn the_service_manager_learns_that_the_run_is_ready_and_alive() {
    let desk = Desk::new(STDIN);
    let path = desk.path("notify");
    let manager = std::os::unix::net::UnixDatagram::bind(&path).unwrap();
    manager.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let mut live = desk.live_with(&[], &[("NOTIFY_SOCKET", path.as_path())]);
    let mut message = [0; 64];
    for _ in 0..2 {
        let length = manager.recv(&mut message).unwrap();
        assert_eq!(&message[..length], b"READY=1\nWATCHDOG=1");
    }
    live.kill().unwrap();
    live.wait().unwrap();
}

#[cfg(unix)]
#[test]
fn a_run_that_was_killed_goes_on_from_its_checkpoint_with_a_larger_sigma() {
    let desk = Desk::new(STDIN);
    let mut live = desk.live(&["--checkpoint", "100 ms", "--speed", "inf"]);
    let mut input = live.stdin.take().unwrap();
    input.write_all(&part(0.0, 20.0)).unwrap();
    input.flush().unwrap();
    desk.wait_for("it has taken 20 s", |s| s["time_s"].as_f64().is_some_and(|t| t > 19.9));
    // a checkpoint of this state
    let at = std::time::SystemTime::now();
    let path = desk.path("live/live.checkpoint");
    let begin = Instant::now();
    while std::fs::metadata(&path).and_then(|m| m.modified()).is_ok_and(|changed| changed < at)
        || !path.is_file()
    {
        assert!(begin.elapsed() < Duration::from_secs(60), "no checkpoint");
        std::thread::sleep(Duration::from_millis(20));
    }
    live.kill().unwrap();
    live.wait().unwrap();

    // for 10 s nobody measured the motion; nothing but the IMU is there at first
    let imu = sentences().filter(|(sensor, time, _)| {
        ["imu", "reference"].contains(sensor) && (30.0..30.5).contains(time)
    });
    let imu: String = imu.map(|(_, _, line)| format!("{line}\r\n")).collect();
    let resumed = desk.pass(imu.as_bytes(), &["--resume", "--speed", "inf"]);
    assert!(warnings(&resumed).contains("without a sample: the process coasted"), "{resumed}");
    let whole = Desk::new(STDIN);
    let before = whole.pass(&part(0.0, 20.0), &["--speed", "inf"]);
    let north = |result: &Value, key: &str| {
        result["states"]["ins.position"][key][0].as_f64().unwrap_or_else(|| panic!("{result}"))
    };
    let (small, large) = (north(&before, "sigma"), north(&resumed, "sigma"));
    assert!(large > 1.5 * small, "{small} m, {large} m");
    assert!(north(&resumed, "error").abs() < 5.0 * large);
    // the checkpoint has what was found out: the prior of the scenario, not the first estimate, is the start
    let biases = determined(&whole);
    assert!(biases.iter().any(|bias| bias.1 == "determined"), "{biases:?}");
    assert_eq!(determined(&desk), biases);
}

/// The verdict on each bias of the accelerometers in the last state of a run.
fn determined(desk: &Desk) -> Vec<(String, String)> {
    let state = std::fs::read(desk.path("live/live.json")).unwrap();
    let state: Value = serde_json::from_slice(&state).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let all = state["states"].as_array().unwrap().iter();
    let biases = all.filter(|s| s["title"].as_str().unwrap().contains("accel_bias"));
    biases.map(|s| (text(&s["title"]), text(&s["verdict"]))).collect()
}

#[test]
fn a_checkpoint_of_another_vehicle_and_a_damaged_one_are_refused_by_name() {
    let desk = Desk::new(STDIN);
    std::fs::create_dir(desk.path("live")).unwrap();
    std::fs::write(desk.path("live/live.checkpoint"), b"NAVFUSE\x01 and no more").unwrap();
    let live = desk.live(&["--resume"]);
    let output = live.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("live.checkpoint"), "{text}");
    assert!(text.contains("run without --resume"), "{text}");
}

#[test]
fn a_file_of_somebody_else_stays_and_the_run_goes_on() {
    let desk = Desk::new(STDIN);
    std::fs::create_dir(desk.path("live")).unwrap();
    for name in ["live.json", "live.checkpoint"] {
        std::fs::write(desk.path("live").join(name), "theirs").unwrap();
    }
    let result = desk.pass(&part(0.0, 5.0), &["--speed", "inf", "--checkpoint", "0 s"]);
    assert!(result["duration_s"].as_f64().is_some_and(|s| s > 2.0), "{result}");
    for name in ["live.json", "live.checkpoint"] {
        assert_eq!(std::fs::read_to_string(desk.path("live").join(name)).unwrap(), "theirs");
    }
}

#[test]
fn a_scenario_without_links_is_refused_with_the_types_that_there_are() {
    let desk = Desk::new("");
    let live = desk.live(&[]);
    let output = live.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        text.contains(
            "no link to the sensors: add one of [link.ros2], [link.serial], [link.stdin]"
        ),
        "{text}"
    );
    let status = navfuse(&["status", &desk.path("live").display().to_string()]);
    assert!(!status.status.success() && stdout(&status).is_empty());
}

#[test]
fn a_log_that_begins_new_files_replays_as_one_to_the_same_bits() {
    let whole = sentences().flat_map(|(_, _, line)| format!("{line}\r\n").into_bytes());
    let whole: Vec<u8> = whole.collect();
    let desk = Desk::new(STDIN);
    let by_age = desk.pass(&whole, &["--speed", "inf", "--set", "sink.mcap.rotate_every=15 s"]);
    assert_eq!(by_age["states"], dive().states);
    let first = desk.path("live/run.mcap");
    let last = desk.path("live/run-0003.mcap");
    assert!(first.is_file() && last.is_file() && !desk.path("live/run-0004.mcap").exists());
    let replay = |log: &std::path::Path| {
        let log = log.display().to_string();
        let replay = navfuse(&["replay", &log, "--no-output", "--format", "json"]);
        result(replay)
    };
    assert_eq!(replay(&first)["states"], by_age["states"]);
    let by_length = Desk::new(STDIN);
    let sized = by_length.pass(
        &whole,
        &[
            "--speed",
            "inf",
            "--set",
            "sink.mcap.rotate_mb=1",
            "--set",
            "sink.mcap.compression=none",
        ],
    );
    assert!(by_length.path("live/run-0002.mcap").is_file());
    assert_eq!(replay(&by_length.path("live/run.mcap"))["states"], sized["states"]);
    // a new run keeps all files of the earlier one together
    desk.pass(&part(0.0, 5.0), &["--speed", "inf"]);
    let earlier = std::fs::read_dir(desk.path("live/earlier")).unwrap().next().unwrap().unwrap();
    assert!(earlier.path().join("run-0003.mcap").is_file() && !last.exists());
    assert_eq!(replay(&earlier.path().join("run.mcap"))["states"], by_age["states"]);
}

#[test]
fn a_log_goes_on_in_a_new_file_every_six_hours_unless_the_scenario_says_when() {
    let note = "note: the log goes on in new files: sink.mcap.rotate_every=\"6 h\"";
    for (settings, noted) in [
        (&[][..], true),
        (&["--set", "sink.mcap.rotate_mb=9"], false),
        (&["--set", "sink.mcap.enabled=false"], false),
    ] {
        let desk = Desk::new(STDIN);
        let live = desk.live(&[&["--speed", "inf"], settings].concat());
        let text = stderr(&live.wait_with_output().unwrap());
        assert_eq!(text.contains(note), noted, "{settings:?}: {text}");
    }
}

#[cfg(unix)]
#[test]
fn the_signal_hup_begins_a_new_log_file_and_the_run_goes_on() {
    let desk = Desk::new(STDIN);
    let mut live = desk.live(&["--speed", "inf"]);
    let mut input = live.stdin.take().unwrap();
    input.write_all(&part(0.0, 20.0)).unwrap();
    desk.wait_for("it has taken 20 s", |s| s["time_s"].as_f64().is_some_and(|t| t > 19.9));
    send("-HUP", &live);
    // the log changes its file with the records after the signal, which arrives at some time
    let mut at = 20.0;
    while !desk.path("live/run.mcap").is_file() {
        assert!(at < 40.0, "no whole log");
        input.write_all(&part(at, at + 0.25)).unwrap();
        at += 0.25;
        std::thread::sleep(Duration::from_millis(100));
    }
    input.write_all(&part(at, 41.0)).unwrap();
    drop(input);
    let result = result(live.wait_with_output().unwrap());
    assert_eq!(result["states"], dive().states);
    assert!(desk.path("live/run-0002.mcap").is_file());
}

#[cfg(unix)]
#[test]
fn the_service_manager_accepts_the_unit_of_the_page() {
    let page = include_str!("../../../docs/src/how-to/live.md");
    let unit = page.split("```ini\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let unit = unit.replace("/usr/local/bin/navfuse", env!("CARGO_BIN_EXE_navfuse"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("navfuse.service");
    std::fs::write(&path, unit).unwrap();
    match std::process::Command::new("systemd-analyze").arg("verify").arg(&path).output() {
        Err(why) => skip(Need::Unix, &format!("systemd-analyze: {why}")),
        Ok(output) => {
            let text = stderr(&output);
            // it also looks at the units of this computer
            let about = text.lines().find(|line| line.contains("navfuse.service"));
            assert!(output.status.success() && about.is_none(), "{text}");
        }
    }
}
