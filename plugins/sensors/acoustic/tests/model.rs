//! Equations of acoustic positioning: axes, signs, speed of sound and noise.
#![allow(clippy::expect_used, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::model::sensor::measurement::jacobian_error;
use navfuse_core::nalgebra::Vector3;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use navfuse_testing::ModelBench;
use std::f64::consts::FRAC_PI_2;

const SCENARIO: &str = r#"
    [process.ins]
    attitude = { sigma = "1 deg" }
    velocity = { sigma = "1 m/s" }
    position = { sigma = "1 m" }
    gyro_bias = { sigma = "0.1 deg/h" }
    accel_bias = { sigma = "50 ug" }

    [process.water]
    type = "sound-speed"
    ratio = { sigma = "0.2 %" }

    [sensor.imu]
    gyro_noise = "0.1 deg/h/sqrt(Hz)"
    accel_noise = "20 ug/sqrt(Hz)"
    simulation = { rate = "50 Hz" }

    [sensor.usbl]
    range_noise = "20 cm"
    angle_noise = "0.2 deg"
    polar = true
    misalignment = { sigma = "0.5 deg" }
    transceiver = { initial = ["0 m", "0 m", "5 m"], sigma = "10 cm" }
    lever_arm = { sigma = "20 cm" }
    sound = "water"
    simulation = { rate = "1 Hz", latitude = "57.2 deg", longitude = "60 deg", heading = "90 deg", speed = "1 m/s", swell = "3 deg" }

    [sensor.beacon]
    type = "acoustic-range"
    noise = "30 cm"
    transponder = { latitude = "57 deg", longitude = "60 deg", height = "-100 m" }
    displacement = { sigma = "5 m" }
    lever_arm = { sigma = "20 cm" }
    sound = "water"
    simulation = { rate = "1 Hz", reach = "2 km" }

    [sensor.dock]
    type = "landmark"
    range_noise = "2 cm"
    angle_noise = "1 deg"
    place = { latitude = "57 deg", longitude = "60 deg", height = "-100 m" }
    displacement = { sigma = "1 m" }
    misalignment = { sigma = "1 deg" }
    lever_arm = { initial = ["2 m", "0 m", "0.5 m"], sigma = "5 cm" }
    polar = true
    simulation = { rate = "2 Hz", reach = "30 m", view = "45 deg" }

    [sensor.reference]
    simulation = { rate = "1 Hz" }

    [source.simulation]
    start = { speed = "1 m/s" }
    segments = [{ type = "cruise", duration = "1 s" }]
"#;

/// 57 deg N and 60 deg E.
fn origin() -> Geodetic {
    Geodetic { latitude: 57_f64.to_radians(), longitude: 60_f64.to_radians(), height: 0.0 }
}

/// The vehicle at a place north, east and down of the origin.
fn bench(sensor: &str, ned: [f64; 3]) -> ModelBench {
    let p = origin().displaced(&Vector3::from(ned));
    let position = [p.latitude, p.longitude, p.height];
    ModelBench::new(SCENARIO, &[], sensor, &[("ins.position", &position)])
}

/// A sample of the USBL whose ship is at the origin with that heading.
fn heading(heading: f64) -> Sample {
    let nothing = f64::NAN;
    let here = origin();
    let pose = [here.latitude, here.longitude, 0.0, 0.0, 0.0, heading];
    let mut sample = ModelBench::sample(&[[nothing; 3].as_slice(), &pose].concat());
    (0..3).for_each(|k| sample.clear(k));
    sample
}

fn predicted(bench: &ModelBench, sample: &Sample) -> Vec<f64> {
    let mut h = vec![0.0; bench.model.channels()];
    bench.model.predict(&bench.at(sample), &mut h);
    h
}

/// The Cartesian channels of a sample.
fn place(sample: &Sample) -> Vector3<f64> {
    Vector3::from_fn(|k, _| sample.get(k).expect("the channel is there"))
}

/// A vehicle 100 m to the north, 50 m to the east and 205 m deep; the ship heads east with its
/// transceiver 5 m below: 50 m forward, 100 m to the left, 200 m down. Within 1 km the Earth falls away
/// by 1 mm.
#[test]
fn a_usbl_measures_forward_right_and_down_of_its_transceiver() {
    let mut bench = bench("usbl", [100.0, 50.0, 205.0]);
    let sample = heading(FRAC_PI_2);
    let found = Vector3::from_vec(predicted(&bench, &sample));
    assert!((found - Vector3::new(50.0, -100.0, 200.0)).norm() < 0.01, "{found}");
    bench.set("water.ratio", &[1.01]);
    let longer = Vector3::from_vec(predicted(&bench, &sample));
    assert!((longer - found * 1.01).norm() < 1e-9, "{longer}");
}

/// The bearing is not defined there, and a small error of it is any error.
#[test]
fn a_vehicle_straight_below_the_ship_is_like_any_other() {
    let bench = bench("usbl", [0.0, 0.0, 305.0]);
    let sample = heading(0.3);
    let error = jacobian_error(bench.model.as_ref(), &bench.at(&sample));
    assert!(error < 1e-6, "{error}");
    let mut measured = sample;
    predicted(&bench, &sample).into_iter().enumerate().for_each(|(k, z)| measured.set(k, z));
    let variances = bench.variances(&measured);
    let across = (300.0 * 0.2_f64.to_radians()).powi(2);
    for (found, expected) in variances.iter().zip([across, across, 0.04]) {
        assert!((found / expected - 1.0).abs() < 1e-4, "{variances:?}");
    }
}

/// The ship of its own process, 100 m from the vehicle to the north: a heading that is 1 deg too small
/// turns the place to the left, and a position that is 2 m too far west moves it to the west.
#[test]
fn errors_of_the_ship_move_the_place() {
    let settings = [
        "process.ship.position={sigma=\"1 m\"}",
        "process.ship.attitude={sigma=\"1 deg\"}",
        "sensor.ship-navigation.simulation={rate=\"5 Hz\"}",
        "sensor.usbl={range_noise=\"20 cm\",angle_noise=\"0.2 deg\",ship=\"ship\",simulation={rate=\"1 Hz\"}}",
    ];
    let p = origin().displaced(&Vector3::new(100.0, 0.0, 50.0));
    let position = [p.latitude, p.longitude, p.height];
    let place = [("ins.position", position.as_slice())];
    let mut bench = ModelBench::new(SCENARIO, &settings, "usbl", &place);
    let sample = heading(0.0);
    let found = Vector3::from_vec(predicted(&bench, &sample));
    assert!((found - Vector3::new(100.0, 0.0, 50.0)).norm() < 0.01, "{found}");
    bench.set("ship.position_error", &[0.0, 2.0, 0.0]);
    let found = Vector3::from_vec(predicted(&bench, &sample));
    assert!((found - Vector3::new(100.0, -2.0, 50.0)).norm() < 0.01, "{found}");
    bench.set("ship.position_error", &[0.0; 3]);
    bench.set("ship.attitude_error", &[0.0, 0.0, 1_f64.to_radians()]);
    let found = Vector3::from_vec(predicted(&bench, &sample));
    let (sin, cos) = 1_f64.to_radians().sin_cos();
    assert!((found - Vector3::new(100.0 * cos, -100.0 * sin, 50.0)).norm() < 0.01, "{found}");
    let error = jacobian_error(bench.model.as_ref(), &bench.at(&sample));
    assert!(error < 1e-6, "{error}");
}

/// 500 m, 30 deg to the right, 40 deg below the horizon of the transceiver.
#[test]
fn range_bearing_and_elevation_become_the_cartesian_place() {
    let bench = bench("usbl", [0.0; 3]);
    let mut sample = heading(0.0);
    let polar = [500.0, 30_f64.to_radians(), -40_f64.to_radians()];
    polar.into_iter().enumerate().for_each(|(k, value)| sample.set(9 + k, value));
    bench.model.complete(&mut sample);
    let found = place(&sample);
    assert!((found - Vector3::new(331.71, 191.51, 321.39)).norm() < 0.01, "{found}");
    let simulated = bench.simulate(Time::default(), Time::default());
    let mut polar = simulated;
    (0..3).for_each(|k| polar.clear(k));
    bench.model.complete(&mut polar);
    assert!((place(&polar) - place(&simulated)).norm() < 1e-6, "{polar:?}");
}

/// A sample without the pose of the ship has no place.
#[test]
fn a_usbl_without_its_ship_predicts_nothing() {
    let found = predicted(&bench("usbl", [0.0; 3]), &ModelBench::sample(&[]));
    assert!(found.iter().all(|z| z.is_nan()), "{found:?}");
}

/// 600 m to the north, 450 m to the east and 100 m deep, at the depth of the transponder: 750 m, or
/// 1 s for ping and reply. The ping was sent 2 m nearer or farther, of which the range has the half.
#[test]
fn a_two_way_range_has_the_motion_between_ping_and_reply() {
    let mut bench = bench("beacon", [600.0, 450.0, 100.0]);
    let still = bench.predict()[0];
    // the meridians converge by 1.5e-4 over 600 m
    assert!((still - 750.0).abs() < 0.05, "{still}");
    for (velocity, expected) in [([1.6, 1.2, 0.0], -1.0), ([-1.6, -1.2, 0.0], 1.0)] {
        bench.set("ins.velocity", &velocity);
        let moved = bench.predict()[0] - still;
        // half of the 2 m of 1 s, to 1e-4 of the speed of sound and of the direction
        assert!((moved - expected).abs() < 2e-4, "{velocity:?}: {moved}");
    }
    let error = bench.jacobian_error();
    assert!(error < 1e-6, "{error}");
}

#[test]
fn a_transponder_beyond_its_reach_is_silent() {
    let now = Time::default();
    let simulated = |ned| bench("beacon", ned).simulate(now, now).get(0).is_some();
    assert!(simulated([1900.0, 0.0, 0.0]) && !simulated([2100.0, 0.0, 0.0]));
}

/// The vehicle heads north, 20 m south of the dock, 3 m west of it and 4 m above it; the camera is 2 m
/// forward and 0.5 m down: 18 m forward, 3 m to the right, 3.5 m down. A body that heads 10 deg to the right
/// of the camera has the dock farther to the right of it, and a dock 1 m north of its place is 1 m farther.
#[test]
fn a_landmark_is_forward_right_and_down_of_the_camera() {
    let mut bench = bench("dock", [-20.0, -3.0, 96.0]);
    let found = Vector3::from_vec(bench.predict());
    let expected = Vector3::new(18.0, 3.0, 3.5);
    // 96 m below the ellipsoid, a step of the geodetic coordinates is 1.5e-5 shorter
    assert!((found - expected).norm() < 1e-3, "{found}");
    bench.set("dock.displacement", &[1.0, 0.0, 0.0]);
    let farther = Vector3::from_vec(bench.predict());
    assert!((farther - found - Vector3::x()).norm() < 1e-6, "{farther}");
    bench.set("dock.displacement", &[0.0; 3]);
    bench.set("dock.misalignment", &[0.0, 0.0, 10_f64.to_radians()]);
    let turned = Vector3::from_vec(bench.predict());
    let (sin, cos) = 10_f64.to_radians().sin_cos();
    let right = Vector3::new(18.0 * cos - 3.0 * sin, 3.0 * cos + 18.0 * sin, 3.5);
    assert!((turned - right).norm() < 1e-3, "{turned}");
    let error = bench.jacobian_error();
    assert!(error < 1e-6, "{error}");
}

/// At 10 m, 1 deg is 17.5 cm across the line of sight.
#[test]
fn a_landmark_is_uncertain_across_the_line_of_sight() {
    let bench = bench("dock", [-12.0, 0.0, 99.5]);
    let variances = bench.variances(&ModelBench::sample(&[10.0, 0.0, 0.0]));
    let across = (10.0 * 1_f64.to_radians()).powi(2);
    for (found, expected) in variances.iter().zip([4e-4, across, across]) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{variances:?}");
    }
}

/// The camera is 2 m before the IMU and looks north, to which 45 deg on either side belong.
#[test]
fn a_landmark_is_seen_within_reach_and_view() {
    let now = Time::default();
    let seen = |ned| bench("dock", ned).simulate(now, now);
    let sample = seen([-25.0, 0.0, 99.5]);
    let [x, range] = [0, 3].map(|k| sample.get(k).expect("it is seen"));
    // some noise of 2 cm, and 1 deg of 23 m across
    assert!((x - 23.0).abs() < 0.1 && (range - 23.0).abs() < 0.1, "{sample:?}");
    for out_of_sight in [[-33.0, 0.0, 99.5], [-10.0, 9.0, 99.5], [10.0, 0.0, 99.5]] {
        let sample = seen(out_of_sight);
        assert!((0..6).all(|k| sample.get(k).is_none()), "{out_of_sight:?}: {sample:?}");
    }
}
