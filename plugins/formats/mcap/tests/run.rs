//! Runs of a scenario: recorded, and replayed from their log.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::{Logged, number, read};
use navfuse_core::document::Document;
use navfuse_core::nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use navfuse_mcap::read_scenario;
use serde_json::Value;
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

/// The frames of a message: parent, child, and the pose of the child in its parent.
fn frames(message: &Logged) -> Vec<(String, String, Isometry3<f64>)> {
    let name = |value: &Value| value.as_str().unwrap()[2..].to_owned();
    let transforms = message.fields["transforms"].as_array().unwrap();
    let frames = transforms.iter().map(|t| {
        let of = |part: &str, axes: &str| -> Vec<f64> {
            axes.chars().map(|axis| number(&t["transform"][part][axis.to_string()])).collect()
        };
        let q = of("rotation", "wxyz");
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
        let place = Translation3::from(Vector3::from_vec(of("translation", "xyz")));
        let pose = Isometry3::from_parts(place, rotation);
        (name(&t["header"]["frame_id"]), name(&t["child_frame_id"]), pose)
    });
    frames.collect()
}

/// The pose of a frame in the map, along the chain of its parents.
fn in_map(frames: &[(String, String, Isometry3<f64>)], name: &str) -> Isometry3<f64> {
    if name == "map" {
        return Isometry3::identity();
    }
    let found: Vec<_> = frames.iter().filter(|(_, child, _)| child == name).collect();
    assert_eq!(found.len(), 1, "{name} has one parent: {found:?}");
    in_map(frames, &found[0].0) * found[0].2
}

#[test]
fn the_frames_of_a_log_compose_to_the_places_and_axes_of_the_sensors() {
    let folder = tempfile::tempdir().unwrap();
    let angles = "[\"2 deg\", \"10 deg\", \"30 deg\"]";
    let settings = [
        format!(
            "sensor.dvl.misalignment={{ initial = {angles}, truth = {angles}, sigma = \"1 mdeg\" }}"
        ),
        "sensor.depth.lever_arm=[\"0.3 m\", \"-0.4 m\", \"1.2 m\"]".to_owned(),
    ];
    run(SCENARIO, &settings, folder.path());
    let log = read(&folder.path().join("run.mcap"));
    let fixed: Vec<_> = log.iter().filter(|m| m.topic == "/tf_static").collect();
    assert_eq!(fixed.len(), 1);
    let fixed = frames(fixed[0]);
    let names: Vec<&str> = fixed.iter().map(|f| f.1.as_str()).collect();
    assert_eq!(names, ["ned", "base_link", "imu", "depth", "reference"]);

    let field = |m: &Logged, key: &str, k: usize| number(&m.fields[key][k]);
    let at = |m: &Logged, topic: &str| {
        log.iter().find(|o| o.topic == topic && o.log_time == m.log_time).cloned()
    };
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for sample in log.iter().filter(|m| m.topic == "/sensor/dvl") {
        let Some(tf) = at(sample, "/tf") else { continue };
        let frames = [fixed.clone(), frames(&tf)].concat();
        // the depth sensor beside the body, by the angles of the state
        let attitude = at(&tf, "/state/ins/attitude").unwrap();
        let [roll, pitch, yaw] = [0, 1, 2].map(|k| field(&attitude, "estimate", k).to_radians());
        let down =
            -0.3 * pitch.sin() - 0.4 * roll.sin() * pitch.cos() + 1.2 * roll.cos() * pitch.cos();
        let [body, port] =
            ["base_link", "depth"].map(|name| in_map(&frames, name).translation.vector);
        // rounding of lengths of 30 m
        assert!((body.z - port.z - down).abs() < 1e-13, "{}", body.z - port.z - down);
        // forward, left and up of the vehicle, which is level to 0.1 deg
        let ros = in_map(&frames, "base_link").rotation;
        assert!((ros * Vector3::x() - Vector3::new(yaw.sin(), yaw.cos(), 0.0)).norm() < 2e-3);
        assert!((ros * Vector3::z() - Vector3::z()).norm() < 2e-3);
        // the velocity that the DVL reads in its axes is that of the truth in the map
        let reference = at(sample, "/sensor/reference").unwrap();
        let truth = [4, 3, 5].map(|k| field(&reference, "values", k));
        let scale = field(&at(&tf, "/state/dvl/scale").unwrap(), "estimate", 0);
        let read = Vector3::from([0, 1, 2].map(|k| field(sample, "values", k) / scale));
        sum += in_map(&frames, "dvl").rotation * read - Vector3::new(truth[0], truth[1], -truth[2]);
        count += 1.0;
    }
    assert!(count > 40.0, "{count}");
    // 5 sigma of the mean of 3 axes with a noise of 2 cm/s, and 0.1 deg of 2 m/s
    let mean = sum / count;
    assert!(mean.amax() < 5.0 * 0.02 / f64::sqrt(count) + 0.0035, "{mean}");
}

/// All texts in a JSON value under one of these keys.
fn texts<'v>(value: &'v Value, keys: &[&str], out: &mut Vec<&'v str>) {
    match value {
        Value::Object(fields) => fields.iter().for_each(|(key, value)| match value {
            Value::String(text) if keys.contains(&key.as_str()) => out.push(text),
            other => texts(other, keys, out),
        }),
        Value::Array(values) => values.iter().for_each(|v| texts(v, keys, out)),
        _ => {}
    }
}

#[test]
fn the_layout_for_foxglove_shows_topics_fields_and_frames_of_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let misaligned = "sensor.dvl.misalignment={ sigma = \"0.1 deg\" }".to_owned();
    run(SCENARIO, &[misaligned], folder.path());
    let layout = std::fs::read_to_string(folder.path().join("run.foxglove.json")).unwrap();
    let layout: Value = serde_json::from_str(&layout).unwrap();
    let log = read(&folder.path().join("run.mcap"));
    let mut paths = Vec::new();
    texts(&layout["configById"], &["value", "followTopic", "topicToRender"], &mut paths);
    assert!(paths.len() > 30, "{paths:?}");
    for topic in ["/health/imu", "/health/dvl", "/health/depth"] {
        assert!(paths.iter().any(|path| *path == format!("{topic}.health")), "{paths:?}");
        let healths = log.iter().filter(|m| m.topic == topic);
        let words: Vec<_> = healths.map(|m| m.fields["health"].as_str().unwrap_or("")).collect();
        assert!(words.last().is_some_and(|word| word.ends_with("used")), "{topic}: {words:?}");
    }
    for path in paths {
        let (topic, field) = path.split_once('.').unwrap_or((path, ""));
        // `.error[1].@mul(3)` is a field, an index and a function
        let mut parts = field.split('.').filter(|p| !p.is_empty() && !p.starts_with('@'));
        let (name, index) = match parts.next() {
            None => ("header", None),
            Some(part) => match part.trim_end_matches(']').split_once('[') {
                Some((name, index)) => (name, Some(index.parse::<usize>().unwrap())),
                None => (part, None),
            },
        };
        assert_eq!(parts.next(), None, "{path}");
        let of_topic: Vec<_> = log.iter().filter(|m| m.topic == topic).collect();
        assert!(!of_topic.is_empty(), "no {topic}");
        let has = |m: &&Logged| match (&m.fields[name], index) {
            (Value::Array(values), Some(index)) => values.get(index).is_some(),
            (value, _) => name == "header" || !value.is_null(),
        };
        assert!(of_topic.iter().any(has), "no {path}");
    }
    let topics = layout["configById"]["3D!track"]["topics"].as_object().unwrap();
    assert!(topics.contains_key("/estimate/path") && topics.contains_key("/estimate/markers"));
    let missing = topics.keys().find(|topic| log.iter().all(|m| m.topic != **topic));
    assert_eq!(missing, None);
    let mut shown = Vec::new();
    texts(&layout["configById"], &["followTf", "frameId"], &mut shown);
    let tf = log.iter().filter(|m| m.topic == "/tf_static" || m.topic == "/tf");
    let known: Vec<_> = tf.flat_map(frames).flat_map(|(a, b, _)| [a, b]).collect();
    assert!(shown.len() == 2 && shown.iter().all(|f| known.iter().any(|k| k == f)), "{shown:?}");
    // every panel of the arrangement is configured
    let mut panels = Vec::new();
    texts(&layout["layout"], &["first", "second"], &mut panels);
    assert_eq!(panels.len(), layout["configById"].as_object().unwrap().len());
    assert!(panels.iter().all(|p| layout["configById"].get(*p).is_some()), "{panels:?}");
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
