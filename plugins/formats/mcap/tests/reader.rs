//! The reader of what a log tells, against a reader that goes by the definitions in the log alone.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::{fixture, floats, read};
use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::{
    Derived, Event, InputRejection, Level, Outcome, Record, Rejection, UpdateRecord,
};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::Sink;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_mcap::{Compression, Entry, LogReader};
use serde_json::{Value, json};
use std::path::Path;

/// A text as it stands in [`common::Logged`].
fn text(text: &str) -> Value {
    json!(format!("s:{text}"))
}

fn texts(all: &[&str]) -> Value {
    all.iter().map(|t| text(t)).collect()
}

/// Name, type and purpose of a sensor.
type Known = (String, String, Purpose);

/// Messages that the reader returns, in the form of [`common::Logged`] as far as both have it.
fn told(path: &Path) -> (Vec<Value>, Vec<Known>, Option<String>) {
    let mut log = LogReader::open(path).unwrap();
    let (mut messages, mut sensors) = (Vec::new(), Vec::new());
    let mut take = |entry: Entry<'_>| {
        let told = match entry {
            Entry::Sensor(s) => {
                return sensors.push((
                    s.name.to_owned(),
                    s.kind.unwrap().to_owned(),
                    s.purpose.unwrap(),
                ));
            }
            Entry::Sample(x, channels) => {
                json!([x.time.nanos(), text(&sensors[x.sensor.0].0), texts(&channels)])
            }
            Entry::Block(b) | Entry::Filtered(b) => json!([
                b.time.nanos(),
                text(b.name),
                texts(&b.components),
                text(b.unit),
                floats(&b.estimate),
                floats(&b.sigma),
                floats(&b.error)
            ]),
            Entry::Innovation(i) => json!([
                i.time.nanos(),
                text(i.sensor),
                text(i.outcome),
                texts(&i.channels),
                floats(&[i.nis, i.threshold]),
                floats(&i.innovation),
                floats(&i.sigma)
            ]),
            Entry::Rejection(r) => json!([r.time.nanos(), text(r.sensor), text(r.reason)]),
            Entry::Event(e) => json!([e.time.nanos(), text(&e.about), text(&e.text)]),
            Entry::Finding(f) => json!([
                f.time.nanos(),
                text(&f.about),
                text(f.severity.name()),
                text(f.basis.name()),
                text(&f.text),
                text(&f.remedy)
            ]),
            Entry::Derived(d) => {
                let names = |names: &[String]| names.iter().map(|n| text(n)).collect::<Value>();
                let (rows, columns) = (names(&d.rows), names(&d.columns));
                json!([d.time.nanos(), text(&d.name), rows, columns, floats(&d.values)])
            }
            Entry::Verdict(_) => return, // a metadata record, no message
        };
        messages.push(told);
    };
    while log.next(&mut take).unwrap() {}
    (messages, sensors, log.warning())
}

/// The same from the definitions.
fn written(path: &Path) -> Vec<Value> {
    let mut messages = Vec::new();
    for message in read(path) {
        let f = &message.fields;
        let stamp = if f["header"].is_object() { &f["header"]["stamp"] } else { &f["stamp"] };
        let time = || {
            json!(
                stamp["sec"].as_i64().unwrap() * 1_000_000_000 + stamp["nanosec"].as_i64().unwrap()
            )
        };
        let told = match message.schema.as_str() {
            "navfuse_msgs/msg/BlockState" => {
                json!([
                    time(),
                    f["name"],
                    f["components"],
                    f["unit"],
                    f["estimate"],
                    f["sigma"],
                    f["error"]
                ])
            }
            "navfuse_msgs/msg/Innovation" => json!([
                time(),
                f["header"]["frame_id"],
                f["outcome"],
                f["channels"],
                [f["nis"], f["threshold"]],
                f["innovation"],
                f["sigma"]
            ]),
            "navfuse_msgs/msg/Rejection" => {
                json!([time(), f["header"]["frame_id"], f["reason"]])
            }
            "navfuse_msgs/msg/Finding" => json!([
                time(),
                f["header"]["frame_id"],
                f["severity"],
                f["basis"],
                f["text"],
                f["remedy"]
            ]),
            "navfuse_msgs/msg/Derived" => {
                json!([time(), f["header"]["frame_id"], f["rows"], f["columns"], f["values"]])
            }
            "rcl_interfaces/msg/Log" => json!([time(), f["name"], f["msg"]]),
            "navfuse_msgs/msg/Sample" | "sensor_msgs/msg/Imu" => {
                let imu = [
                    "gyro_x_radps",
                    "gyro_y_radps",
                    "gyro_z_radps",
                    "accel_x_mps2",
                    "accel_y_mps2",
                    "accel_z_mps2",
                ];
                let channels =
                    if f["channels"].is_array() { f["channels"].clone() } else { texts(&imu) };
                json!([time(), text(message.topic.strip_prefix("/sensor/").unwrap()), channels])
            }
            _ => continue,
        };
        messages.push(told);
    }
    messages
}

#[test]
fn the_reader_tells_every_message_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sink = fixture::create(&path, Compression::Zstd);
    let (time, values) = (Time::from_nanos(-1_500_000_000), [1.0, f64::NAN, -3.0, 4.0, 5.0, 6.0]);
    for sensor in [0, 1, 3, 2] {
        let count = fixture::sensors()[sensor].channels.len();
        sink.take(&Record::Sample(&Sample::new(time, SensorId(sensor), &values[..count]))).unwrap();
    }
    let outcomes = [Outcome::Accepted, Outcome::Gated, Outcome::Rejected(Rejection::NotFinite(1))];
    for (outcome, threshold) in outcomes.into_iter().zip([f64::INFINITY, 11.3, 9.0]) {
        sink.take(&Record::Update(&UpdateRecord {
            time,
            sensor: SensorId(1),
            outcome,
            nis: 4.5,
            threshold,
            present: 0b101,
            innovation: &[0.1, -0.2],
            covariance: &[0.04, 0.0, 0.0, 0.09],
        }))
        .unwrap();
    }
    let event = Event { time, level: Level::Warning, about: "dvl".into(), text: "lost".into() };
    sink.take(&Record::Event(&event)).unwrap();
    let rejection = InputRejection { time, sensor: SensorId(0), reason: Rejection::NotFinite(1) };
    sink.take(&Record::InputRejection(&rejection)).unwrap();
    let finding = Finding {
        time,
        about: "dvl".into(),
        severity: Severity::DoNotUse,
        basis: Basis::Explanation,
        text: "the scale is wrong".into(),
        remedy: "calibrate it".into(),
    };
    sink.take(&Record::Finding(&finding)).unwrap();
    let derived = Derived {
        time,
        name: "information".into(),
        unit: "".into(),
        rows: ["roll", "pitch"].map(str::to_owned).into(),
        columns: ["dvl", "depth", "gnss"].map(str::to_owned).into(),
        values: vec![0.5, 0.25, 0.25, 1.0, 0.0, 0.0],
    };
    sink.take(&Record::Derived(&derived)).unwrap();
    sink.finish().unwrap();
    let (told, sensors, warning) = told(&path);
    assert_eq!(told, written(&path));
    // a finding is a warning of the log too
    assert_eq!((told.len(), warning), (12, None));
    let [.., rejected, logged, found, _] = &told[..] else { panic!("{told:?}") };
    assert_eq!(rejected[2], text("gyro_y_radps is not finite"));
    assert_eq!(logged[2], text("the scale is wrong; calibrate it"));
    assert_eq!(found[2], text("do_not_use"));
    let kinds = [Purpose::Input, Purpose::Measurement, Purpose::Measurement, Purpose::Reference];
    let expected =
        fixture::sensors().into_iter().zip(kinds).map(|(s, purpose)| (s.name, s.kind, purpose));
    assert_eq!(sensors, expected.collect::<Vec<_>>());
}

#[test]
fn a_log_that_was_cut_off_is_read_up_to_the_cut_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sink = fixture::create(&path, Compression::None);
    let count = 50_000;
    for k in 0..count {
        sink.take(&Record::Sample(&Sample::new(
            Time::from_nanos(k * 1_000_000),
            SensorId(2),
            &[0.5],
        )))
        .unwrap();
    }
    sink.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let (told, _, warning) = told(&path);
    assert!(!told.is_empty() && told.len() < count as usize, "{} samples", told.len());
    assert!(warning.unwrap().contains("cut off at byte"));
}
