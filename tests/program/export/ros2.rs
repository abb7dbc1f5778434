//! The bag of ROS 2 holds the estimates of the table in CSV, in the axes of REP 103: our own source
//! for bags reads them back, and `rosbags` does.

use crate::common::{navfuse, root, stderr};
use crate::export::{Run, csv, run};
use navfuse_testing::python::{output, rosbags};
use navfuse_testing::recording::{self, INERTIAL, Values};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// UTC of the run's zero.
const ORIGIN: &str = "2026-06-01T08:00:00Z";

/// The sensors whose samples the bag gives: odometry and fix.
const SENSORS: &str = r#"
[sensor.odometry]
type = "reference"
[sensor.fix]
type = "gnss"
horizontal_noise = "1 m"
vertical_noise = "1 m"
"#;

/// A sample: time in ns, and values by channel.
type Row = (i64, Values);

/// Reads the bag by the source for bags; the datum is that of its coordinates.
fn read(bag: &Path, [latitude, longitude, height]: [f64; 3]) -> BTreeMap<String, Vec<Row>> {
    let datum = format!(
        "{{ latitude = \"{latitude:e} deg\", longitude = \"{longitude:e} deg\", \
         height = \"{height:e} m\" }}"
    );
    let text = format!(
        "{INERTIAL}{SENSORS}[source.ros2]\npath = {:?}\ntime = {{ origin = \"{ORIGIN}\" }}\n\
         sensors.odometry = {{ topic = \"/odometry\", datum = {datum} }}\n\
         sensors.fix = {{ topic = \"/fix\" }}\n",
        bag.display().to_string()
    );
    let registry = navfuse::standard_plugins();
    let reading =
        recording::read(&registry, Path::new("."), &text).unwrap_or_else(|e| panic!("{e}"));
    let mut samples = BTreeMap::<String, Vec<Row>>::new();
    for (sample, sensor, values) in reading.rows(0) {
        samples.entry(sensor.to_owned()).or_default().push((sample.time.nanos(), values));
    }
    assert_eq!(reading.warnings, [None]);
    samples
}

fn bag(run: &Run) -> std::path::PathBuf {
    let bag = run.export("ros2", &["--origin", ORIGIN]);
    assert_eq!(bag, run.log.with_extension("ros2"), "beside the log");
    bag
}

#[test]
fn our_own_source_reads_the_estimates_back_from_the_bag() {
    let run = run();
    let (header, rows) = csv(&run.export("csv", &[]));
    let column = |name: &str| header.iter().position(|h| h == name).expect(name);
    let place = ["latitude_deg", "longitude_deg", "height_m"]
        .map(|name| column(&format!("ins.position.{name}")));
    let samples = read(&bag(&run), place.map(|k| rows[0][k]));
    let of_fix: Vec<&str> = samples["fix"][0].1.keys().map(String::as_str).collect();
    assert_eq!(of_fix, ["h_acc", "height", "lat", "lon", "v_acc"]);
    // a rounding of an angle of 1 rad is 1e-16 rad; the bag turns and moves by a few operations
    let columns = [
        ("lat", "position.latitude_deg", 1e-14),
        ("lon", "position.longitude_deg", 1e-14),
        // differences of heights of some metres
        ("height", "position.height_m", 1e-12),
        ("vel_n", "velocity.north_mps", 1e-14),
        ("vel_e", "velocity.east_mps", 1e-14),
        ("vel_d", "velocity.down_mps", 1e-14),
        ("roll", "attitude.roll_deg", 1e-14),
        ("pitch", "attitude.pitch_deg", 1e-14),
        ("yaw", "attitude.yaw_deg", 1e-14),
    ];
    for (sensor, own) in &samples {
        assert_eq!(own.len(), rows.len(), "{sensor}");
        for ((time, values), row) in own.iter().zip(&rows) {
            assert_eq!(*time, (row[0] * 1e9).round() as i64, "{sensor}");
            for (channel, name, bound) in columns {
                if sensor == "fix" && !of_fix.contains(&channel) {
                    continue;
                }
                let wanted = row[column(&format!("ins.{name}"))];
                let wanted = if name.ends_with("_deg") { wanted.to_radians() } else { wanted };
                let error = (values[channel] - wanted).abs();
                assert!(error <= bound, "{sensor}.{channel} at {time}: {error:e}");
            }
        }
    }
    let sigma = |row: &[f64], axis| row[column(&format!("ins.position.{axis}_sigma_m"))];
    for ((_, values), row) in samples["fix"].iter().zip(&rows) {
        let horizontal = (0.5 * (sigma(row, "north").powi(2) + sigma(row, "east").powi(2))).sqrt();
        let errors = [values["h_acc"] - horizontal, values["v_acc"] - sigma(row, "down")];
        assert!(errors.iter().all(|e| e.abs() < 1e-12 * horizontal), "{errors:?}");
    }
}

#[test]
fn rosbags_reads_odometry_fix_and_transform_of_every_epoch() {
    let Some(python) = rosbags(env!("CARGO_TARGET_TMPDIR")).python() else { return };
    let run = run();
    let (table, bag) = (run.export("csv", &[]), bag(&run));
    let script = root().join("tests/program/export/ros2.py");
    let printed = output(Command::new(&python).arg(script).args([&bag, &table]));
    let printed = printed.unwrap_or_else(|e| panic!("{e}"));
    let agrees = printed.lines().filter(|l| l.ends_with("agrees")).count();
    assert_eq!(agrees, 4, "{printed}");
}

#[test]
fn a_bag_that_cannot_be_written_is_an_error_with_its_path() {
    let run = run();
    let log = run.log.display().to_string();
    let file = run.log.with_file_name("a_file");
    std::fs::write(&file, "in the place of the folder").expect("a file");
    let output = navfuse(&["export", &log, "--to", "ros2", "--out", &file.display().to_string()]);
    let said = stderr(&output);
    assert!(!output.status.success() && said.contains("a_file: cannot be written"), "{said}");
    // the stamps of ROS end in 2038
    let output = navfuse(&["export", &log, "--to", "ros2", "--origin", "2040-01-01T00:00:00Z"]);
    let said = stderr(&output);
    assert!(!output.status.success() && said.contains("does not fit a ROS time stamp"), "{said}");
    assert!(!run.log.with_extension("ros2").join("metadata.yaml").exists());
}
