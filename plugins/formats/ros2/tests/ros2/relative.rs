//! Poses of a bag as relative poses.

use crate::read;
use crate::recorder::{Imu, Raw, odometry, raw, usual};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use navfuse_testing::recording::{self, Values};

const SENSOR: &str = r#"
[sensor.camera]
type = "relative-pose"
translation_noise = "1 cm"
rotation_noise = "0.5 deg"
"#;
const KEYS: &str = "path = \"bag.mcap\"\nsensors.camera = { topic = \"/odom\" }\n";
const NAMES: [&str; 6] = ["move_x", "move_y", "move_z", "turn_x", "turn_y", "turn_z"];

fn halves(values: &Values) -> [Vector3<f64>; 2] {
    [0, 3].map(|from| Vector3::from_fn(|k, _| values[NAMES[from + k]]))
}

/// The relative poses of a simulation: time in ns, translation and rotation vector.
fn simulated() -> Vec<(i64, [Vector3<f64>; 2])> {
    let text = format!(
        "{}{SENSOR}simulation = {{ rate = \"5 Hz\" }}\n\
         [source.simulation]\nstart = {{ latitude = \"32 deg\", longitude = \"34 deg\" }}\n\
         segments = [{{ type = \"surge\", duration = \"10 s\", speed = \"2 m/s\" }},\n\
         {{ type = \"turn\", duration = \"20 s\", angle = \"270 deg\", bank = \"8 deg\" }}]\n",
        recording::INERTIAL
            .replace("[sensor.imu]", "[sensor.imu]\nsimulation = { rate = \"50 Hz\" }")
    );
    let folder = tempfile::tempdir().unwrap();
    let reading = recording::read(&navfuse_testing::registry(), folder.path(), &text).unwrap();
    let rows = reading.samples.iter().enumerate().flat_map(|(k, _)| reading.rows(k));
    let rows = rows.filter(|(_, sensor, _)| *sensor == "camera");
    rows.map(|(sample, _, values)| (sample.time.nanos(), halves(&values))).collect()
}

/// The odometry of relative poses, as a program of ROS would publish it: the pose of a body forward,
/// left, up in a world that begins anywhere.
fn published(motions: &[(i64, [Vector3<f64>; 2])]) -> Vec<Raw> {
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let mut position = Vector3::new(3.0, -4.0, 5.0);
    let mut attitude = UnitQuaternion::from_euler_angles(0.3, -0.2, 2.0);
    let start = usual(1)[0].stamp;
    let mut messages = Vec::new();
    for (k, (time, [moved, turned])) in motions.iter().enumerate() {
        if k > 0 {
            position += attitude * (flip * moved);
            attitude *= UnitQuaternion::from_scaled_axis(flip * turned);
        }
        let quaternion = [attitude.i, attitude.j, attitude.k, attitude.w];
        messages.push(odometry(start + time, position.into(), quaternion));
    }
    messages
}

fn write(folder: &std::path::Path, messages: &[Raw]) {
    let imu: Vec<Imu> = usual(3);
    let mut all: Vec<Raw> = imu.iter().map(Raw::from).chain(messages.to_vec()).collect();
    all.sort_by_key(|m| m.received);
    let bytes = raw(&all, Some(mcap::Compression::Zstd), Some(4096));
    std::fs::write(folder.join("bag.mcap"), bytes).unwrap();
}

/// Rounding of 150 products of quaternions and of positions of 50 m stays below 1e-12.
#[test]
fn simulated_relative_poses_return_from_the_odometry_of_a_bag() {
    let motions = simulated();
    assert!(motions.len() > 140, "{}", motions.len());
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &published(&motions));
    let found = read(folder.path(), SENSOR, KEYS).unwrap();
    // the first pose has no motion
    assert_eq!((found.count("camera"), found.warning.as_deref()), (motions.len() - 1, None));
    for ((_, values), (_, expected)) in found.samples["camera"].iter().zip(&motions[1..]) {
        for (own, expected) in halves(values).iter().zip(expected) {
            assert!((own - expected).norm() < 1e-12, "{own} {expected}");
        }
    }
    // the vehicle moved and turned
    let far = motions.iter().map(|(_, [moved, _])| moved.x).sum::<f64>();
    let turned = motions.iter().map(|(_, [_, turned])| turned.z).sum::<f64>();
    assert!(far > 30.0 && turned > 4.0, "{far} {turned}");
}

#[test]
fn a_pose_that_is_left_out_makes_the_next_motion_longer() {
    let motions = simulated();
    let folder = tempfile::tempdir().unwrap();
    let mut messages = published(&motions);
    let zero = odometry(messages[20].received - 1_000_000, [0.0; 3], [0.0; 4]);
    messages[20] = zero;
    write(folder.path(), &messages);
    let found = read(folder.path(), SENSOR, KEYS).unwrap();
    assert_eq!(found.count("camera"), motions.len() - 2);
    let words = "/odom: 1 message without a number for the sensor";
    assert!(found.warning().contains(words), "{}", found.warning());
    // the sample before is that of pose 19, the next one spans 20 and 21
    let [[before, turned], [moved, _]] = [20, 21].map(|k| motions[k].1);
    let whole = before + UnitQuaternion::from_scaled_axis(turned) * moved;
    let [own, _] = halves(&found.samples["camera"][19].1);
    assert!((own - whole).norm() < 1e-12, "{own} {whole}");
}

#[test]
fn two_topics_for_one_sensor_of_relative_poses_are_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = published(&simulated());
    for message in messages.iter_mut().step_by(2) {
        message.topic = "/other";
    }
    write(folder.path(), &messages);
    let keys = KEYS.replace("\"/odom\"", "\"/odom\", more = [\"/other\"]");
    let error = read(folder.path(), SENSOR, &keys).unwrap_err();
    for words in ["sensors.camera.more", "no motion in common", "a sensor of its own"] {
        assert!(error.contains(words), "{error}");
    }
}
