//! Messages of MAVLink both ways, with pymavlink as the autopilot.

use super::desk::{Desk, datagrams, dive, result, stop, warnings};
use navfuse_testing::absent::{Need, skip};
use navfuse_testing::python::{output, vehicle_logs};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The messages of a type in datagrams, as pymavlink reads them.
fn messages(python: &Path, datagrams: &[Vec<u8>], kind: &str) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("messages");
    std::fs::write(&file, datagrams.concat()).unwrap();
    let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/program/live/mavlink.py");
    let text = output(Command::new(python).arg(script).arg(&file)).unwrap();
    let all: Vec<Value> = serde_json::from_str(&text).unwrap();
    let count = |kind: &str| all.iter().filter(|m| m["mavpackettype"] == kind).count();
    assert_eq!(count("BAD_DATA"), 0, "{text}");
    assert!((30..50).contains(&count("HEARTBEAT")), "one a second: {}", count("HEARTBEAT"));
    assert_eq!(all[0]["sender"].as_array().unwrap().len(), 2);
    all.into_iter().filter(|m| m["mavpackettype"] == kind).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Pairs of an estimate in JSON and a message of the same time.
fn pairs(estimates: &[Vec<u8>], messages: Vec<Value>, time: &str) -> Vec<(Value, Value)> {
    let estimates: Vec<Value> =
        estimates.iter().map(|text| serde_json::from_slice(text).unwrap()).collect();
    let same = |message: &Value| {
        let at = number(&message[time]) * 1e-6;
        estimates.iter().find(|e| (number(&e["time_s"]) - at).abs() < 2e-6).cloned()
    };
    let pairs = messages.into_iter().filter_map(|m| Some((same(&m)?, m))).collect::<Vec<_>>();
    assert!(pairs.len() > 100, "{} of {} messages", pairs.len(), estimates.len());
    pairs
}

#[test]
fn an_autopilot_receives_pose_and_velocity_with_the_sigma_of_the_estimate() {
    let Some(python) = vehicle_logs(env!("CARGO_TARGET_TMPDIR")).python() else { return };
    let datum = "{ latitude = \"43 deg\", longitude = \"5 deg\", height = \"0 m\" }";
    let sinks = [
        "",
        &format!("mavlink = {{ datum = {datum}, system = 7 }}"),
        "mavlink = { autopilot = \"px4\" }",
    ];
    let [json, ardupilot, px4] = datagrams(sinks, "[link.stdin]\n", &dive().sentences);
    for (sink, frame, sender) in [(ardupilot, 20, [7, 197]), (px4, 1, [1, 197])] {
        let messages = messages(&python, &sink, "ODOMETRY");
        let mut variances = [0.0; 2];
        for (estimate, message) in pairs(&json, messages, "time_usec") {
            // ArduPilot ignores any other pair of frames, and PX4 any other estimator
            assert_eq!([&message["frame_id"], &message["child_frame_id"]], [frame, 12]);
            assert_eq!(message["estimator_type"], 3);
            assert_eq!(message["sender"], serde_json::json!(sender));
            let q = [0, 1, 2, 3].map(|k| number(&message["q"][k]));
            let heading = (2.0 * (q[0] * q[3] + q[1] * q[2]))
                .atan2(1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))
                .to_degrees();
            let expected = number(&estimate["roll_pitch_heading_deg"][2]);
            assert!((heading - expected).abs() < 1e-3, "{heading} {expected}");
            // the velocity is along the body: its size and its direction against the heading
            let v = [0, 1, 2].map(|k| number(&estimate["velocity_ned_mps"][k]));
            let forward = v[0] * heading.to_radians().cos() + v[1] * heading.to_radians().sin();
            assert!((number(&message["vx"]) - forward).abs() < 0.02, "{message} {estimate}");
            let sigma = number(&message["pose_covariance"][0]).sqrt();
            let expected = number(&estimate["position_sigma_ned_m"][0]);
            assert!((sigma / expected - 1.0).abs() < 1e-4, "{sigma} {expected}");
            let turn = number(&message["pose_covariance"][20]).sqrt().to_degrees();
            let expected = number(&estimate["attitude_sigma_ned_deg"][2]);
            assert!((turn / expected - 1.0).abs() < 1e-4, "{turn} {expected}");
            // heading and velocity share the error that turns the velocity in north, east, down
            let sum = |v: [f64; 3]| v.iter().sum::<f64>();
            variances[0] += sum([0, 6, 11].map(|k| number(&message["velocity_covariance"][k])));
            variances[1] +=
                sum([0, 1, 2].map(|k| number(&estimate["velocity_sigma_ned_mps"][k]).powi(2)));
            if frame == 20 {
                let north = (number(&estimate["position_deg_deg_m"][0]) - 43.0) * 111_100.0;
                assert!((number(&message["x"]) - north).abs() < 0.01 * north.abs() + 0.1);
            }
        }
        assert!(variances[0] < 0.8 * variances[1], "{variances:?}");
    }
}

#[test]
fn an_autopilot_receives_the_motion_between_two_messages() {
    let Some(python) = vehicle_logs(env!("CARGO_TARGET_TMPDIR")).python() else { return };
    let sinks = ["", "mavlink = { message = \"vision-position-delta\" }"];
    let [json, delta] = datagrams(sinks, "[link.stdin]\n", &dive().sentences);
    let messages = messages(&python, &delta, "VISION_POSITION_DELTA");
    for (estimate, message) in pairs(&json, messages, "time_usec") {
        let dt = number(&message["time_delta_usec"]) * 1e-6;
        let moved = [0, 1, 2].map(|k| number(&message["position_delta"][k]) / dt);
        let v = [0, 1, 2].map(|k| number(&estimate["velocity_ned_mps"][k]));
        let speed = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        // the mean of two velocities of a vehicle that gains 0.2 m/s in a second
        assert!((speed(moved) - speed(v)).abs() < 0.03, "{message} {estimate}");
        // the sigma of the velocity is below 0.1 m/s after the first reports of the DVL
        assert!(number(&message["confidence"]) <= 100.0);
    }
}

/// An autopilot at a serial port, both of whose ends `socat` makes: its IMU, receiver and pressure sensor are the
/// samples, and the estimate goes back over the same port.
#[cfg(unix)]
#[test]
fn a_serial_autopilot_gives_its_sensors_and_receives_the_estimate_over_one_port() {
    let Some(python) = vehicle_logs(env!("CARGO_TARGET_TMPDIR")).python() else { return };
    let desk = Desk::new("");
    let [near, far] = ["near", "far"].map(|name| desk.path(name).display().to_string());
    let ends = [&near, &far].map(|path| format!("pty,raw,echo=0,link={path}"));
    let Ok(mut socat) = Command::new("socat").args(&ends).spawn() else {
        return skip(Need::Socat, "a serial line needs it");
    };
    while !(Path::new(&near).exists() && Path::new(&far).exists()) {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let link = format!(
        "[link.autopilot]\ntype = \"serial\"\ndevice = \"{near}\"\nbaud = 921600\n\
         [link.autopilot.unit]\nformat = \"mavlink\"\nsensors.imu = {{ message = \"HIGHRES_IMU\" }}\n\
         sensors.gnss = {{ message = \"GPS_RAW_INT\" }}\n\
         sensors.depth = {{ message = \"SCALED_PRESSURE2\" }}\n\
         [sink.autopilot]\ntype = \"serial\"\ndevice = \"{near}\"\nbaud = 921600\n\
         [sink.autopilot.mavlink]\ndatum = {{ latitude = \"43 deg\", longitude = \"5 deg\", height = \"0 m\" }}\n"
    );
    let scenario = desk.path("desk.toml");
    let vehicle = std::fs::read_to_string(&scenario).unwrap();
    std::fs::write(&scenario, vehicle + &link).unwrap();
    let live = desk.live(&[
        // it would wait for the start that the reference gives
        "--set",
        "sensor.reference.enabled=false",
        "--set",
        "process.ins.attitude.initial=[\"0 deg\", \"0 deg\", \"30 deg\"]",
        "--set",
        "process.ins.velocity.initial=[\"0 m/s\", \"0 m/s\", \"0 m/s\"]",
        "--set",
        "process.ins.position={ latitude = \"43 deg\", longitude = \"5 deg\", height = \"0 m\", sigma = \"5 m\" }",
    ]);
    desk.wait_for("it listens", |_| true);
    let samples = desk.path("samples");
    std::fs::write(&samples, &dive().sentences).unwrap();
    let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/program/live/autopilot.py");
    let text = output(Command::new(python).arg(script).arg(&far).arg(&samples).arg("12"));
    stop(&live);
    let result = result(live.wait_with_output().unwrap());
    socat.kill().unwrap();
    socat.wait().unwrap();
    let text = text.unwrap_or_else(|why| panic!("{why} {}", warnings(&result)));
    let all: Vec<Value> = serde_json::from_str(&text).unwrap();
    let of = |kind: &str| all.iter().filter(|m| m["mavpackettype"] == kind).collect::<Vec<_>>();
    assert_eq!(of("BAD_DATA").len(), 0);
    // 10 a second of 12 s, on a busy computer
    let odometry = of("ODOMETRY");
    assert!(odometry.len() > 50 && of("HEARTBEAT").len() > 5, "{text} {}", warnings(&result));
    // 7 s after it begins to move with 0.2 m/s^2 along a heading of 30 deg
    let last = odometry[odometry.len() - 1];
    let speed = number(&last["vx"]).hypot(number(&last["vy"]));
    assert!((1.0..1.8).contains(&speed), "{last}");
    let used = |sensor: &str| result["samples"][sensor]["accepted"].as_u64().unwrap();
    assert!(used("gnss") > 8 && used("depth") > 30, "{result}");
}
