//! Bags that `rosbags` wrote, in every storage and packing, give the samples that its messages
//! stand for. Without Python or the package index, the tests are skipped.

use crate::{Read, Rows, read};
use navfuse_testing::python::{output, rosbags};
use std::path::Path;
use std::process::Command;

const SENSORS: &str = r#"
[sensor.gnss]
horizontal_noise = "1 m"
vertical_noise = "1 m"
velocity_noise = "1 m/s"
[sensor.dvl]
noise = "1 cm/s"
[sensor.a50]
type = "dvl"
noise = "1 cm/s"
[sensor.nucleus]
type = "dvl"
noise = "1 cm/s"
[sensor.body]
type = "dvl"
noise = "1 cm/s"
[sensor.reference]
[sensor.pose]
type = "reference"
[sensor.motion]
type = "relative-pose"
translation_noise = "1 cm"
rotation_noise = "1 deg"
[sensor.turned]
type = "relative-pose"
translation_noise = "1 cm"
rotation_noise = "1 deg"
[sensor.depth]
noise = "1 cm"
[sensor.compass]
type = "magnetic-heading"
noise = "1 deg"
[sensor.echo]
type = "depth"
noise = "1 cm"
[sensor.wheel]
type = "odometer"
noise = "1 cm/s"
lateral_noise = "1 cm/s"
vertical_noise = "1 cm/s"
"#;

const KEYS: &str = r#"
sensors.imu = { topic = "/imu" }
sensors.gnss = { topic = "/fix", more = ["/vel"] }
sensors.dvl = { topic = "/dvl" }
sensors.a50 = { topic = "/a50" }
sensors.nucleus = { topic = "/nucleus" }
sensors.body = { topic = "/body" }
sensors.reference = { topic = "/odom", datum = { latitude = "54 deg", longitude = "10 deg", height = "5 m" } }
sensors.pose = { topic = "/pose", datum = { latitude = "54 deg", longitude = "10 deg", height = "5 m" } }
sensors.motion = { topic = "/odom" }
sensors.turned = { topic = "/pose", rotation = ["0 deg", "0 deg", "90 deg"] }
sensors.depth = { topic = "/pressure" }
sensors.compass = { topic = "/mag" }
sensors.echo = { channels.depth = { topic = "/range", field = "range" } }
"#;

const WHEEL: &str = r#"
[source.ros2.sensors.wheel]
topic = "/wheel"
channels.speed = { field = "parts[2].ticks", unit = "cm/s", scale = -1 }
channels.lateral = { field = "parts[1].speeds[1]" }
channels.vertical = { field = "counts[1]", offset = 1.0 }
"#;

/// Compares samples: times to the nanosecond, values to 1e-12 of a radian, metre or their like. The
/// formulas of the script differ from ours by rounding alone.
fn agree(found: &Read, expected: &Rows, skipped: &[&str], bag: &str) {
    for (sensor, rows) in expected.iter().filter(|(s, _)| !skipped.contains(&s.as_str())) {
        let own = &found.samples[sensor];
        assert_eq!(own.len(), rows.len(), "{bag}: {sensor}: {}", found.warning());
        for ((time, values), (at, wanted)) in own.iter().zip(rows) {
            assert_eq!(time, at, "{bag}: {sensor}");
            let names: Vec<_> = values.keys().collect();
            assert_eq!(names, wanted.keys().collect::<Vec<_>>(), "{bag}: {sensor}: {time}");
            for (name, value) in values {
                let error = (value - wanted[name]).abs();
                assert!(error <= 1e-12 * wanted[name].abs().max(1.0), "{bag}: {sensor}.{name}");
            }
        }
    }
    assert!(found.order.is_sorted_by_key(|(time, _)| *time), "{bag}");
}

#[test]
fn bags_of_another_program_give_the_samples_of_its_messages() {
    let Some(python) = rosbags(env!("CARGO_TARGET_TMPDIR")).python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ros2/bags.py");
    let printed = output(Command::new(&python).arg(script).arg(folder.path()));
    let printed = printed.unwrap_or_else(|e| panic!("{e}"));
    let json = std::fs::read_to_string(folder.path().join("expected.json")).unwrap();
    let expected: Rows = serde_json::from_str(&json).unwrap();
    let bags: Vec<&str> = printed.split_whitespace().collect();
    assert_eq!(bags.len(), 18, "{printed}");
    for bag in bags {
        let plain = bag == "sqlite-plain";
        let wheel = if plain { "" } else { WHEEL };
        let found = read(folder.path(), SENSORS, &format!("path = {bag:?}\n{KEYS}{wheel}"))
            .unwrap_or_else(|e| panic!("{bag}: {e}"));
        agree(&found, &expected, if plain { &["wheel"] } else { &[] }, bag);
        let warning = found.warning();
        for words in [
            "/fix: 5 messages without a fix",
            "/a50: 7 messages whose velocity is invalid",
            "/dvl: 4 messages over the bottom or through the water, as `track` excludes",
        ] {
            assert!(warning.contains(words), "{bag}: {warning}");
        }
        assert!(!warning.contains("damaged") && !warning.contains("cut"), "{bag}: {warning}");
    }
    crate::import::frames_of_the_bag(&folder.path().join("mcap-9"));
    // a type without a definition is an error with its name
    let error = read(folder.path(), SENSORS, &format!("path = \"sqlite-plain\"\n{KEYS}{WHEEL}"));
    let error = error.unwrap_err();
    assert!(error.contains("the definition of wheel_msgs/Wheel is missing"), "{error}");
    // the time of receiving instead of the stamp
    let keys = "path = \"mcap-9\"\nstamp = \"receive\"\nsensors.depth = { topic = \"/pressure\" }";
    let found = read(folder.path(), SENSORS, keys).unwrap();
    let first = expected["depth"][0].0 + 5_000_000;
    assert_eq!(found.samples["depth"][0].0, first);
}
