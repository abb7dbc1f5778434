//! The equation of the non-holonomic constraint against the rotations of its documentation.
#![allow(missing_docs, reason = "test")]

use navfuse_core::nalgebra::{Rotation3, Vector3};
use navfuse_testing::ModelBench;

const SCENARIO: &str = r#"
    name = "constraint"

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

    [sensor.wheels]
    type = "non-holonomic"
    lateral_noise = "2 cm/s"
    vertical_noise = "3 cm/s"
    side_slip = { sigma = "1 deg", correlation_time = "2 s" }
    suspension = { sigma = "1 deg", correlation_time = "2 s" }
    pitch = { sigma = "1 deg" }
    yaw = { sigma = "1 deg" }
    lever_arm = { sigma = "1 m" }

    [sensor.reference]
    simulation = { rate = "10 Hz" }

    [source.simulation]
    start = { speed = "10 m/s" }
    segments = [{ type = "cruise", duration = "1 s" }]
"#;

const ATTITUDE: [f64; 3] = [0.2, -0.1, 2.0];
const VELOCITY: [f64; 3] = [3.0, -12.0, 0.5];
const ARM: [f64; 3] = [-1.5, 0.4, 0.6];
/// Rate of the IMU, rad/s.
const RATE: [f64; 3] = [0.1, -0.2, 0.3];

fn bench(velocity: [f64; 3], [pitch, suspension, yaw, slip]: [f64; 4]) -> ModelBench {
    let blocks: [(&str, &[f64]); 7] = [
        ("ins.attitude", &ATTITUDE),
        ("ins.velocity", &velocity),
        ("wheels.pitch", &[pitch]),
        ("wheels.suspension", &[suspension]),
        ("wheels.yaw", &[yaw]),
        ("wheels.side_slip", &[slip]),
        ("wheels.lever_arm", &ARM),
    ];
    let mut bench = ModelBench::new(SCENARIO, &[], "wheels", &blocks);
    bench.state.signals[..3].copy_from_slice(&RATE);
    bench
}

/// `v = R_y(pitch + e) R_z(yaw + s) (C_n^b v^n + w x l)`, with coordinate transformations, which are
/// the transposes of the rotations of a vector. The rate of the Earth moves the lever arm by less
/// than 0.2 mm/s.
#[test]
fn the_constraint_is_the_motion_of_the_axle_across_its_axis() {
    let angles = [0.03, 0.02, -0.05, 0.01];
    let found = bench(VELOCITY, angles).predict();
    let c_b_n = Rotation3::from_euler_angles(ATTITUDE[0], ATTITUDE[1], ATTITUDE[2]);
    let at_arm =
        c_b_n.inverse() * Vector3::from(VELOCITY) + Vector3::from(RATE).cross(&Vector3::from(ARM));
    let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), -(angles[0] + angles[1]))
        * Rotation3::from_axis_angle(&Vector3::z_axis(), -(angles[2] + angles[3]));
    let expected = turned * at_arm;
    let off = (found[0] - expected.y).abs().max((found[1] - expected.z).abs());
    assert!(found.len() == 2 && off < 2e-4, "{found:?}, not {expected}");
}

#[test]
fn a_vehicle_that_rolls_along_its_axis_fulfils_it() {
    let (pitch, yaw) = (0.05, -0.04);
    let c_v_b = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
    let c_b_n = Rotation3::from_euler_angles(ATTITUDE[0], ATTITUDE[1], ATTITUDE[2]);
    let v_b = c_v_b * Vector3::new(15.0, 0.0, 0.0) - Vector3::from(RATE).cross(&Vector3::from(ARM));
    // suspension and side slip add to the mounting
    let found = bench((c_b_n * v_b).into(), [0.02, 0.03, -0.05, 0.01]).predict();
    assert!(found.iter().all(|v| v.abs() < 2e-4), "{found:?}");
}

#[test]
fn the_jacobian_is_the_derivative() {
    let error = bench(VELOCITY, [0.03, 0.02, -0.05, 0.01]).jacobian_error();
    assert!(error < 1e-7, "{error}");
}

#[test]
fn the_noise_is_the_square_of_the_stated_sigma() {
    let bench = bench(VELOCITY, [0.0; 4]);
    let variances = bench.variances(&ModelBench::sample(&[0.0, 0.0]));
    assert!((variances[0] / 4e-4 - 1.0).abs() < 1e-12, "2 cm/s, {variances:?}");
    assert!((variances[1] / 9e-4 - 1.0).abs() < 1e-12, "3 cm/s, {variances:?}");
}

/// The model of a standstill with settings, of a vehicle that moves.
fn standstill(settings: &str) -> ModelBench {
    let text = format!("{SCENARIO}\n[sensor.zero-velocity]\n{settings}\n");
    let blocks: [(&str, &[f64]); 3] = [
        ("ins.attitude", &ATTITUDE),
        ("ins.velocity", &VELOCITY),
        ("ins.gyro_bias", &[0.01, 0.02, 0.03]),
    ];
    let mut bench = ModelBench::new(&text, &[], "zero-velocity", &blocks);
    bench.state.signals[..3].copy_from_slice(&RATE);
    bench
}

/// At a standstill velocity and angular rate are zero, each with its own noise. The Earth turns by
/// 7.3e-5 rad/s.
#[test]
fn a_standstill_is_zero_velocity_and_on_request_zero_rotation() {
    let alone = standstill("noise = \"2 cm/s\"");
    assert_eq!(alone.predict(), VELOCITY);
    let both = standstill("noise = \"2 cm/s\"\nrotation_noise = \"3 mrad/s\"");
    let found = both.predict();
    assert_eq!(found[..3], VELOCITY);
    for (axis, rate) in [0.09, -0.22, 0.27].into_iter().enumerate() {
        assert!((found[3 + axis] - rate).abs() < 7.4e-5, "{found:?}");
    }
    let squares = |bench: &ModelBench, sigma: &[f64]| {
        let variances = bench.variances(&ModelBench::sample(&vec![0.0; sigma.len()]));
        assert_eq!(variances.len(), sigma.len());
        let off = |(v, s): (&f64, &f64)| (v / (s * s) - 1.0).abs();
        assert!(variances.iter().zip(sigma).map(off).all(|off| off < 1e-12), "{variances:?}");
    };
    squares(&alone, &[0.02; 3]);
    squares(&both, &[0.02, 0.02, 0.02, 3e-3, 3e-3, 3e-3]);
    assert!(both.jacobian_error() < 1e-7);
}

#[test]
fn a_window_of_more_than_ten_seconds_is_refused() {
    let compose = |window: &str| {
        let text = format!("{SCENARIO}\n[sensor.zero-velocity]\n");
        let setting = format!("sensor.zero-velocity.window={window}");
        navfuse_testing::scenario(&text, &[&setting], |s| {
            s.compose().map_err(|e| e.to_string()).err()
        })
    };
    assert_eq!(compose("10 s"), None);
    assert!(compose("10.1 s").is_some_and(|text| text.contains("at most 10 s")));
}
