//! The equations of a relative pose against those of its documentation, and what a sample means.
#![allow(clippy::expect_used, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::nalgebra::{Rotation3, Vector3};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::load_quaternion;
use navfuse_core::units::time::Time;
use navfuse_testing::ModelBench;
use std::f64::consts::PI;

const SCENARIO: &str = r#"
    name = "odometry"

    [process.ins]
    attitude = { sigma = "1 deg" }
    velocity = { sigma = "1 m/s" }
    position = { sigma = "1 m" }
    gyro_bias = { sigma = "0.1 deg/h" }
    accel_bias = { sigma = "50 ug" }

    [sensor.imu]
    gyro_noise = "0.1 deg/h/sqrt(Hz)"
    accel_noise = "20 ug/sqrt(Hz)"
    simulation = { rate = "50 Hz" }

    [sensor.odometry]
    type = "relative-pose"
    translation_noise = ["1 cm", "2 cm", "5 cm"]
    rotation_noise = ["1 mrad", "3 mrad", "4 mrad"]
    scale = { sigma = "10 %" }
    misalignment = { sigma = "2 deg" }
    lever_arm = { sigma = "20 cm" }

    [sensor.reference]
    simulation = { rate = "1 Hz" }

    [source.simulation]
    start = { speed = "10 m/s" }
    segments = [{ type = "cruise", duration = "1 s" }]
"#;

const ATTITUDE: [f64; 3] = [0.2, -0.1, 2.0];
const BEFORE: [f64; 3] = [-0.1, 0.05, 1.2];
const MOUNTING: [f64; 3] = [0.3, -0.4, 0.9];
const ARM: [f64; 3] = [-1.5, 0.4, 0.6];
const SCALE: f64 = 1.25;
const MOVED: [f64; 3] = [3.0, -2.0, 0.5];

fn bench(settings: &[&str]) -> ModelBench {
    let before = Geodetic { latitude: 0.5, longitude: 1.0, height: 30.0 };
    let now = before.displaced(&Vector3::from(MOVED));
    let blocks: [(&str, &[f64]); 7] = [
        ("ins.attitude", &ATTITUDE),
        ("ins.position", &[now.latitude, now.longitude, now.height]),
        ("odometry.past_attitude", &BEFORE),
        ("odometry.past_position", &[before.latitude, before.longitude, before.height]),
        ("odometry.scale", &[SCALE]),
        ("odometry.misalignment", &MOUNTING),
        ("odometry.lever_arm", &ARM),
    ];
    ModelBench::new(SCENARIO, settings, "odometry", &blocks)
}

/// From a frame that is turned by roll, pitch and yaw to the one in which these are given.
fn rotation([roll, pitch, yaw]: [f64; 3]) -> Rotation3<f64> {
    let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    about(Vector3::z_axis(), yaw) * about(Vector3::y_axis(), pitch) * about(Vector3::x_axis(), roll)
}

/// The sensor is at `p + C_b^n l`, and sees the way from its past place in its past axes. The Earth
/// falls away by 3.6^2 / 2R = 1e-6 m over the way.
#[test]
fn the_sensor_sees_its_own_motion_in_its_past_axes() {
    let bench = bench(&[]);
    let found = bench.predict();
    let block = bench.composition.layout.find("odometry.misalignment").expect("a mounting");
    let c_b_s = load_quaternion(&bench.state.values[block.range()]).to_rotation_matrix();
    let turned = c_b_s.rotation_to(&rotation(MOUNTING)).angle();
    let transposed = c_b_s.inverse().rotation_to(&rotation(MOUNTING)).angle();
    assert!(turned.min(transposed) < 1e-12, "roll, pitch and yaw of the mounting");
    let arm = Vector3::from(ARM);
    let way = Vector3::from(MOVED) + rotation(ATTITUDE) * arm - rotation(BEFORE) * arm;
    let past = c_b_s * rotation(BEFORE).inverse();
    let translation = past * way * SCALE;
    let turn = (past * rotation(ATTITUDE) * c_b_s.inverse()).scaled_axis();
    let off = (Vector3::new(found[0], found[1], found[2]) - translation).norm();
    assert!(found.len() == 6 && off < 2e-6, "{found:?}, not {translation}");
    let off = (Vector3::new(found[3], found[4], found[5]) - turn).norm();
    assert!(off < 1e-12, "{found:?}, not {turn}");
}

#[test]
fn the_jacobian_is_the_derivative() {
    let error = bench(&[]).jacobian_error();
    assert!(error < 1e-6, "{error}");
}

#[test]
fn the_noise_is_the_square_of_the_stated_sigma() {
    let variances = bench(&[]).variances(&ModelBench::sample(&[0.0; 6]));
    let sigma: [f64; 6] = [1e-2, 2e-2, 5e-2, 1e-3, 3e-3, 4e-3];
    assert_eq!(variances.len(), 6);
    for (variance, sigma) in variances.iter().zip(sigma) {
        assert!((variance / (sigma * sigma) - 1.0).abs() < 1e-12, "{variances:?}");
    }
}

#[test]
fn a_sample_is_a_keyframe_unless_its_channel_is_zero() {
    let model = bench(&[]).model;
    let mut sample = ModelBench::sample(&[0.0; 6]);
    assert!(model.keyframe(&sample), "a recording without the channel");
    sample.set(6, 1.0);
    assert!(model.keyframe(&sample));
    sample.set(6, 0.0);
    assert!(!model.keyframe(&sample));
}

/// With a keyframe every second, it is the first sample from a full second on.
#[test]
fn a_simulated_keyframe_is_the_first_sample_of_its_interval() {
    let bench = bench(&["sensor.odometry.simulated_keyframes=\"1 s\""]);
    let keyframe = |from: f64, to: f64| {
        let [from, to] = [from, to].map(|t| Time::from_seconds(t).expect("a time"));
        bench.simulate(from, to).get(6)
    };
    assert_eq!(keyframe(0.75, 1.0), Some(1.0));
    assert_eq!(keyframe(0.9, 1.1), Some(1.0));
    assert_eq!(keyframe(0.5, 0.75), Some(0.0));
    assert_eq!(keyframe(1.0, 1.25), Some(0.0));
    let sample = bench.simulate(Time::default(), Time::default());
    let predicted = bench.predict();
    assert_eq!(sample.array::<6>(0).map(|found| found.to_vec()), Some(predicted));
}

#[test]
fn every_channel_has_its_unit_and_a_rotation_is_within_half_a_turn() {
    let bench = bench(&[]);
    let id = bench.composition.sensor("odometry").expect("the sensor is there");
    let sensor = &bench.composition.sensors[id];
    let columns: Vec<String> = sensor.info.channels.iter().map(|c| c.column()).collect();
    let moved = ["move_x_m", "move_y_m", "move_z_m"];
    let turned = ["turn_x_rad", "turn_y_rad", "turn_z_rad"];
    assert_eq!(columns[..6], [moved, turned].concat());
    assert_eq!(sensor.info.channel(6), "keyframe");
    let limits = sensor.limits.iter().map(|(channel, limit)| (*channel, limit.low, limit.high));
    assert_eq!(limits.collect::<Vec<_>>(), [(3, -PI, PI), (4, -PI, PI), (5, -PI, PI)]);
}
