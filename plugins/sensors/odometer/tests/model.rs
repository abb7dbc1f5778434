//! The equation of an odometer against Wu's rotations, and what motion tells of which state.
#![allow(clippy::expect_used, clippy::panic, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::nalgebra::{Rotation3, Vector3};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::covariance::Update;
use navfuse_testing::ModelBench;
use std::sync::atomic::AtomicBool;

/// A tactical IMU, of whose velocity nothing is known at the start but what the odometer says.
const SCENARIO: &str = r#"
    name = "motion"
    seed = 1

    [process.ins]
    attitude = { sigma = ["0.02 deg", "0.02 deg", "0.1 deg"] }
    velocity = { sigma = "1 m/s" }
    position = { sigma = "1 m" }
    gyro_bias = { sigma = "0.1 deg/h" }
    accel_bias = { sigma = "50 ug" }

    [sensor.imu]
    gyro_noise = "0.1 deg/h/sqrt(Hz)"
    accel_noise = "20 ug/sqrt(Hz)"
    simulation = { rate = "50 Hz" }

    [sensor.odometer]
    noise = "2 cm/s"
    lateral_noise = "2 cm/s"
    vertical_noise = "2 cm/s"
    scale = { sigma = "5 %" }
    pitch = { sigma = "2 deg" }
    yaw = { sigma = "2 deg" }
    lever_arm = { sigma = "1 m" }
    simulation = { rate = "10 Hz" }

    [sensor.reference]
    simulation = { rate = "10 Hz" }

    [source.simulation]
    start = { speed = "10 m/s" }
    segments = [{ type = "cruise", duration = "1 s" }]
"#;

fn scenario<T>(settings: &[&str], f: impl FnOnce(&Scenario<'_>) -> T) -> T {
    navfuse_testing::scenario(SCENARIO, settings, f)
}

const PITCH: f64 = 0.03;
const YAW: f64 = -0.05;
const SCALE: f64 = 1.02;
const ARM: [f64; 3] = [-1.5, 0.4, 0.6];

/// In motion, with values that are not zero.
fn bench() -> ModelBench {
    let blocks: [(&str, &[f64]); 6] = [
        ("ins.attitude", &[0.2, -0.1, 2.0]),
        ("ins.velocity", &[3.0, -12.0, 0.5]),
        ("odometer.scale", &[SCALE]),
        ("odometer.pitch", &[PITCH]),
        ("odometer.yaw", &[YAW]),
        ("odometer.lever_arm", &ARM),
    ];
    let mut bench = ModelBench::new(SCENARIO, &[], "odometer", &blocks);
    bench.state.signals[..3].copy_from_slice(&[0.1, -0.2, 0.3]);
    bench
}

#[test]
fn a_vehicle_that_only_rolls_along_its_axis_shows_its_speed_and_two_zeros() {
    let mut bench = bench();
    // C_b^v = R_y(pitch) R_z(yaw) transforms coordinates: its transpose turns the vehicle's axis
    // into the body
    let c_v_b = Rotation3::from_axis_angle(&Vector3::z_axis(), YAW)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), PITCH);
    let c_b_n = Rotation3::from_euler_angles(0.2, -0.1, 2.0);
    // position is at the equator; gyro bias is zero
    let earth = Vector3::new(navfuse_ins::earth::EARTH_RATE, 0.0, 0.0);
    let latitude = bench.composition.layout.find("ins.position").expect("a position").offset;
    bench.state.values[latitude] = 0.0;
    let rate = Vector3::new(0.1, -0.2, 0.3) - c_b_n.inverse() * earth;
    let v_b = c_v_b * Vector3::new(15.0, 0.0, 0.0) - rate.cross(&Vector3::from(ARM));
    let velocity = bench.composition.layout.find("ins.velocity").expect("a velocity").range();
    bench.state.values[velocity].copy_from_slice((c_b_n * v_b).as_slice());
    let h = bench.predict();
    assert!(
        (h[0] - SCALE * 15.0).abs() < 1e-13 && h[1].abs() < 1e-13 && h[2].abs() < 1e-13,
        "{h:?}"
    );
}

#[test]
fn the_jacobian_is_the_derivative() {
    let bench = bench();
    let error = bench.jacobian_error();
    assert!(error < 1e-8, "{error}");
}

#[test]
fn a_recording_of_the_speed_alone_implies_the_constraint() {
    let bench = bench();
    let innovations = |given: &[f64]| {
        let mut given = ModelBench::sample(given);
        bench.model.complete(&mut given);
        let mut update = Update::with_capacity(bench.composition.layout.tangent, 16);
        bench.model.linearise(&bench.at(&given), &mut update);
        update.innovation
    };
    assert_eq!(innovations(&[15.0]), innovations(&[15.0, 0.0, 0.0]));
    assert_eq!(innovations(&[15.0]).len(), 3);
    assert_ne!(innovations(&[15.0, 0.1, 0.2]), innovations(&[15.0]), "what is given stays");
    assert_eq!(innovations(&[]).len(), 0, "no speed, no measurement");
}

/// The Cramer-Rao bound: the smallest sigma that any filter can end with, of scale, pitch (deg),
/// yaw (deg) and lever arm (m), after segments of a minute.
fn limit(speed: &str, segments: &str) -> [f64; 6] {
    let segments = format!("source.simulation.segments=[{segments}]");
    let settings = [segments.as_str(), &format!("source.simulation.start={{ speed = '{speed}' }}")];
    let assembly = scenario(&settings, |s| s.assemble_at_truth().unwrap_or_else(|e| panic!("{e}")));
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let of = |name: &str| {
        let rows = &finished.summary.rows;
        rows.iter()
            .find(|r| r.name == name)
            .unwrap_or_else(|| panic!("no state {name}"))
            .sigma
            .clone()
    };
    let arm = of("odometer.lever_arm");
    let limit = [
        of("odometer.scale")[0],
        of("odometer.pitch")[0],
        of("odometer.yaw")[0],
        arm[0],
        arm[1],
        arm[2],
    ];
    println!("{segments}: {limit:.4?}");
    limit
}

const PRIOR: [f64; 6] = [0.05, 2.0, 2.0, 1.0, 1.0, 1.0];

/// Wu et al. (2009): at rest nothing is seen, and at constant velocity no more; acceleration tells
/// scale and both angles, turns the lever arm across their axis. What is not seen keeps its prior,
/// to 0.1 %; the bounds on what is seen are a third above the limit that this scenario reached when
/// it was written.
#[test]
fn acceleration_tells_scale_and_mounting_and_turning_tells_the_lever_arm() {
    let kept = |limit: [f64; 6], which: &[usize]| {
        which.iter().for_each(|&k| assert!(limit[k] > 0.999 * PRIOR[k], "{k}: {limit:?}"));
    };
    let found = |limit: [f64; 6], which: &[(usize, f64)]| {
        which.iter().for_each(|&(k, bound)| assert!(limit[k] < bound, "{k}: {limit:?}"));
    };
    kept(limit("0 m/s", "{ type = 'static', duration = '60 s' }"), &[0, 1, 2, 3, 4, 5]);

    // 1 m/s known of 10 m/s is 10 % and 5.73 deg: with the priors 1 / sqrt(1/5^2 + 1/10^2) = 4.47
    // %, 1.89 deg. That gravity and the Earth's rotation turn with the place is worth a little
    // more.
    let cruise = limit("10 m/s", "{ type = 'cruise', duration = '60 s' }");
    assert!(cruise[0] > 0.044 && cruise[1] > 1.85 && cruise[2] > 1.85, "{cruise:?}");
    kept(cruise, &[3, 4, 5]);

    let pulse = limit("10 m/s", "{ type = 'pulse', duration = '60 s', speed_change = '10 m/s' }");
    found(pulse, &[(0, 0.0004), (1, 0.018), (2, 0.022)]);
    kept(pulse, &[3, 4, 5]);

    // about the vertical: the velocity turns in the plane, and stays as it was across it
    let turn = limit("10 m/s", "{ type = 'turn', duration = '60 s', angle = '180 deg' }");
    found(turn, &[(0, 0.0017), (2, 0.1), (3, 0.12), (4, 0.12)]);
    kept(turn, &[5]);
    assert!(turn[1] > 1.85, "{turn:?}");

    // about the axle
    let slope = limit("10 m/s", "{ type = 'slope', duration = '60 s', angle = '5 deg' }");
    found(slope, &[(0, 0.0036), (1, 0.25), (3, 0.43), (5, 0.43)]);
    kept(slope, &[4]);
}

/// A log of two axes, 1 deg to the right, with a scale factor of 2 % and a zero of 3 cm/s.
const LOG: &str = r#"
    [process.water]
    type = "water-current"
    current = { sigma = "20 cm/s" }

    [sensor.log]
    type = "speed-log"
    noise = "2 cm/s"
    current = "water"
    lateral = true
    scale = { initial = 1.02, sigma = "2 %" }
    bias = { initial = "3 cm/s", sigma = "2 cm/s" }
    yaw = { initial = "1 deg", sigma = "1 deg" }
    lever_arm = { sigma = "20 cm" }
"#;

/// A vehicle that heads east at 2 m/s over the ground, in a current of 0.5 m/s to the south-west, moves
/// through the water at 2.353553 m/s to the east and 0.353553 m/s to the north, which is its left.
#[test]
fn a_speed_log_shows_the_motion_through_the_water() {
    let blocks: [(&str, &[f64]); 3] = [
        ("ins.attitude", &[0.0, 0.0, std::f64::consts::FRAC_PI_2]),
        ("ins.velocity", &[0.0, 2.0, 0.0]),
        ("water.current", &[-0.353_553, -0.353_553, 0.0]),
    ];
    let bench = ModelBench::new(&format!("{SCENARIO}{LOG}"), &[], "log", &blocks);
    let (sin, cos) = 1_f64.to_radians().sin_cos();
    let (forward, right) = (2.353_553, -0.353_553);
    let expected = [forward * cos + right * sin, right * cos - forward * sin];
    let found = bench.predict();
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - (1.02 * expected + 0.03)).abs() < 1e-9, "{found:?}");
    }
    let error = bench.jacobian_error();
    assert!(error < 1e-6, "{error}");
}
