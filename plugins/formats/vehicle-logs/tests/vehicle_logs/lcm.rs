//! Event logs of LCM, with and without the definitions of their types.

use crate::generate::units::{
    LCM_DEPTH as DEPTH, LCM_FIRST as FIRST, lcm as log, lcm_event as event,
};
use crate::read;
use crate::scenario::{near, read as samples};
use navfuse_core::units::time::Time;
use navfuse_vehicle_logs::{Format, LcmTypes, Options};
use std::io::Cursor;

/// The definition of the messages of [`log`], with the fingerprints that `lcm-gen --python` writes for them.
const DEFINITION: &str = "package vehicle;\n\
    struct vector_t { float x, y, z; } // inside another one\n\
    struct imu_t { int64_t utime; vector_t gyro; double accel[3]; int8_t n; byte raw[n]; }\n\
    struct depth_t { const int32_t KIND = 1; int64_t utime; float depth; string unit; }\n";
/// Time of the first message, and the delay of its reception, us.
const DELAY: i64 = 2000;

#[test]
fn without_definitions_a_log_has_channels_and_times() {
    let (rows, topics, damage) = read(Format::Lcm, &log(10));
    let names: Vec<&str> = topics.iter().map(|t| t.name.as_str()).collect();
    assert_eq!((names, rows.len(), damage.bytes()), (vec!["IMU", "DEPTH"], 12, 0));
    assert!(topics.iter().all(|t| t.fields.is_empty()));
}

#[test]
fn definitions_name_the_fields_and_another_type_on_a_channel_is_left_out() {
    let mut log = log(10);
    log.extend(event(99, FIRST, "IMU", &DEPTH.to_be_bytes()));
    let definitions = LcmTypes::parse(&[DEFINITION.to_owned()]).unwrap();
    let options = Options { definitions, ..Options::default() };
    let mut decoder = Format::Lcm.decoder(Cursor::new(log), &options);
    let (mut values, mut rows) = (Vec::new(), Vec::new());
    while let Some(record) = decoder.next(&mut values).unwrap() {
        rows.push((record.topic, values.clone()));
    }
    let fields = &decoder.topics()[0].fields;
    assert_eq!(fields.join(" "), "utime gyro.x gyro.y gyro.z accel[0] accel[1] accel[2] n");
    assert_eq!(rows[0].1[1..], [0.25, -0.5, 0.125, 0.1, -0.2, -9.8, 0.0]);
    assert_eq!(rows.len(), 12);
    let events = decoder.events().unwrap();
    assert!(events.starts_with("1 message that does not fit the type of its channel"), "{events}");
}

#[test]
fn a_log_fills_sensors_by_the_fields_that_the_scenario_names() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("types.lcm");
    std::fs::write(&file, DEFINITION).unwrap();
    let channel = |name: &str, field: &str| format!("channels.{name} = {{ field = \"{field}\" }}");
    let fields = [
        ("gyro_x", "gyro.x"),
        ("gyro_y", "gyro.y"),
        ("gyro_z", "gyro.z"),
        ("accel_x", "accel[0]"),
        ("accel_y", "accel[1]"),
        ("accel_z", "accel[2]"),
    ];
    let channels = fields.map(|(name, field)| channel(name, field)).join(", ");
    let keys = format!(
        "definitions = [{:?}]\nsensors.imu = {{ message = \"IMU\", {channels} }}\n\
         sensors.depth = {{ message = \"DEPTH\", {} }}",
        file.display().to_string(),
        channel("depth", "depth")
    );
    let read = samples(&log(20), &keys).unwrap();
    let [depth, imu] = read.samples.as_slice() else { panic!("two sources") };
    assert_eq!((imu.len(), depth.len()), (20, 4));
    near(&imu[3], &[0.25, -0.5, 0.125, 0.1, -0.2, -9.8], 1e-12);
    near(&depth[1], &[15.0], 1e-12);
    // the time in the message, not that of its reception
    assert_eq!(imu[1].time, Time::from_nanos(1000 * (FIRST + 20_000)));
    let received = samples(&log(20), &format!("stamp = \"received\"\n{keys}")).unwrap();
    assert_eq!(received.samples[1][1].time, Time::from_nanos(1000 * (FIRST + 20_000 + DELAY)));
}
