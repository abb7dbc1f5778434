//! Runs of a scenario: recorded, and replayed from their log.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::{Logged, number, read};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::runner::Finished;
use navfuse_core::run::scenario::Scenario;
use navfuse_mcap::read_scenario;
use std::path::Path;
use std::sync::atomic::AtomicBool;

const SCENARIO: &str = r#"
name = "short dive"
seed = 3

[estimator]
start = "1 s"
draw = "start"

[process.ins]
attitude = { sigma = ["0.01 deg", "0.01 deg", "0.1 deg"] }
velocity = { sigma = "5 mm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "0.01 deg/h", truth = "0.01 deg/h" }
accel_bias = { sigma = "50 ug", truth = "50 ug" }

[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "100 Hz" }

[sensor.dvl]
noise = "2 cm/s"
scale = { initial = 0.8, sigma = 0.2, truth = 0.9998 }
simulation = { rate = "5 Hz", dropout = 0.1 }

[sensor.depth]
noise = "5 cm"
simulation = { rate = "2 Hz", offset = "-0.45 s" }

[sensor.reference]
simulation = { rate = "10 Hz" }

[source.simulation.start]
latitude = "30 deg"
height = "0 m"
heading = "10 deg"

[[source.simulation.segments]]
type = "static"
duration = "5 s"

[[source.simulation.segments]]
type = "surge"
duration = "15 s"
speed = "2 m/s"
"#;

fn run(scenario: &str, settings: &[String], output: &Path) -> Finished {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_simulation::SimulationPlugin)
        .add(&navfuse_mcap::McapPlugin);
    let document = Document::parse("short.toml", scenario).unwrap();
    let scenario = Scenario::new(&registry, document, settings).unwrap();
    let assembly = scenario.assemble(Some(output)).unwrap_or_else(|e| panic!("{e}"));
    runner::run(assembly, &AtomicBool::new(false), |_| ())
}

fn source(log: &Path) -> String {
    format!("source={{ mcap = {{ path = {:?} }} }}", log.display().to_string())
}

/// What a log holds but for its first events, which are about the source.
fn told(path: &Path) -> Vec<Logged> {
    read(path).into_iter().filter(|m| m.topic != "/log").collect()
}

#[test]
fn a_replay_from_the_log_alone_tells_the_same_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    [&first, &second].into_iter().for_each(|f| std::fs::create_dir(f).unwrap());
    let recorded = run(SCENARIO, &[], &first);
    assert!(recorded.error.is_none(), "{:?}", recorded.error);
    let log = first.join("run.mcap");
    assert_eq!(recorded.recorded[0].place, log.display().to_string());
    let info = read_scenario(&log).unwrap();
    assert_eq!((info.name.as_str(), info.log_time_offset), ("short dive", 1_000_000_000));
    let replayed = run(&info.scenario, &[source(&log)], &second);
    assert!(replayed.error.is_none(), "{:?}", replayed.error);
    assert_eq!(recorded.summary.states, replayed.summary.states);
    assert_eq!(recorded.summary.samples, replayed.summary.samples);
    let told = [&log, &second.join("run.mcap")].map(|path| told(path));
    assert!(told[0] == told[1], "the logs differ");
    assert!(told[0].len() > 5000);
}

#[test]
fn every_error_state_of_the_run_is_in_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let finished = run(SCENARIO, &[], folder.path());
    let log = read(&folder.path().join("run.mcap"));
    for row in &finished.summary.rows {
        let topic = format!("/state/{}", row.name.replace('.', "/"));
        let last = log.iter().rfind(|m| m.topic == topic).unwrap_or_else(|| panic!("{topic}"));
        for (field, values) in [("estimate", &row.estimate), ("sigma", &row.sigma)] {
            let logged: Vec<f64> =
                last.fields[field].as_array().unwrap().iter().map(number).collect();
            assert_eq!(&logged, values, "{topic} {field}");
        }
    }
    let count = |topic: &str| log.iter().filter(|m| m.topic == topic).count();
    assert_eq!(count("/tf"), count("/state/ins/position"));
    assert_eq!(count("/tf"), count("/estimate/odometry"));
    assert!(count("/innovation/dvl") > 50 && count("/innovation/depth") > 30);
    assert_eq!(count("/sensor/depth"), count("/sensor/depth/pressure"));
    assert_eq!(count("/sensor/reference"), count("/reference/reference/fix"));
}

#[test]
fn a_replay_of_a_log_that_was_cut_off_goes_to_the_cut_and_warns() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    [&first, &second].into_iter().for_each(|f| std::fs::create_dir(f).unwrap());
    run(SCENARIO, &["sink.mcap.compression=none".into()], &first);
    let log = first.join("run.mcap");
    let length = std::fs::metadata(&log).unwrap().len();
    std::fs::OpenOptions::new().write(true).open(&log).unwrap().set_len(length / 2).unwrap();
    let scenario = read_scenario(&log).unwrap().scenario;
    let replayed = run(&scenario, &[source(&log)], &second);
    assert!(replayed.error.is_none(), "{:?}", replayed.error);
    let warning = format!("cut off at byte {} after t = ", length / 2);
    assert!(replayed.events.iter().any(|e| e.text.contains(&warning)), "{:?}", replayed.events);
    assert!(replayed.summary.duration_s > 5.0);
}

#[test]
fn a_log_of_a_run_with_increments_comes_back_too() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    [&first, &second].into_iter().for_each(|f| std::fs::create_dir(f).unwrap());
    let increments = "sensor.imu.output=increments".to_owned();
    let recorded = run(SCENARIO, std::slice::from_ref(&increments), &first);
    let log = first.join("run.mcap");
    assert!(
        read(&log)
            .iter()
            .any(|m| m.topic == "/sensor/imu" && m.schema == "navfuse_msgs/msg/Sample")
    );
    let replayed = run(SCENARIO, &[source(&log), increments], &second);
    assert_eq!(recorded.summary.states, replayed.summary.states);
}
