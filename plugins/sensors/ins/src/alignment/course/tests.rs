//! The search, fix by fix, and what a fix counts.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
use super::*;
use crate::testing::{Bench, imu};
use navfuse_core::units::sample::SensorId;
use navfuse_core::units::time::Span;
use serde_json::json;

const HEADING: f64 = 0.7;

/// Attitude (roll, pitch, yaw) of a level car that accelerates by 1 m/s^2 on a straight road;
/// every sample of the IMU, the first of them at the start, comes `times` times.
fn found(times: usize) -> (f64, f64, f64) {
    let bench = Bench::new(&[]);
    let (layout, mut state) = (&*bench.composition.layout, bench.state());
    let settings = CourseSettings::new(&AlignmentConfig::default(), (0.0, 0.0));
    let imu = ("imu".to_owned(), imu(&json!({})));
    let mut search = CourseAlignment::new(settings, imu, bench.navigation, true);
    search.sensed = Some(Sensed { driver: 0, gnss: 1, position: 0, velocity: Some(3) });
    let position = Geodetic { latitude: 0.8, longitude: 0.1, height: 50.0 };
    let gravity = LocalEarth::at(position.latitude, position.height).gravity;
    for k in 0..=1_000 {
        let time = Time::from_nanos(k * 20_000_000);
        let driving = Sample::new(time, SensorId(0), &[0.0, 0.0, 0.0, 1.0, 0.0, -gravity]);
        for _ in 0..times {
            search.search(layout, &mut state, &driving).unwrap();
        }
        if k % 50 == 0 {
            let (t, (sin, cos)) = (time.seconds(), HEADING.sin_cos());
            let Geodetic { latitude, longitude, height } = position;
            let channels = [latitude, longitude, height, t * cos, t * sin, 0.0];
            let fix = Sample::new(time, SensorId(1), &channels);
            if search.search(layout, &mut state, &fix).unwrap() == Progress::Found {
                break;
            }
        }
    }
    assert!(search.report().is_some());
    state.get(layout, bench.navigation.attitude).euler_angles()
}

/// The rounding of the eigenvector is 1e-16 over the gap of the eigenvalues, far below 1e-6.
#[test]
fn a_sample_that_comes_twice_counts_once() {
    let (roll, pitch, yaw) = found(1);
    assert!(roll.abs().max(pitch.abs()).max((yaw - HEADING).abs()) < 1e-6, "{roll} {pitch}");
    assert_eq!(found(2), (roll, pitch, yaw));
}

/// Two receivers, of which the second has a name, and the IMU after one of them.
const RECEIVERS: &str = "[sensor.antenna]\ntype = \"fixes\"\n[sensor.fixes]\n";

fn search_with(bench: &Bench, keys: &serde_json::Value, bias: (f64, f64)) -> CourseAlignment {
    let config = serde_json::from_value(keys.clone()).unwrap();
    let imu = ("imu".to_owned(), imu(&json!({})));
    CourseAlignment::new(CourseSettings::new(&config, bias), imu, bench.navigation, true)
}

#[test]
fn a_receiver_with_position_and_velocity_is_found_or_named() {
    let bench = Bench::with(RECEIVERS, &[]);
    let sensors = &bench.composition.sensors;
    let index = |name: &str| bench.composition.sensor(name).unwrap();
    let mut names = ["antenna", "fixes"];
    names.sort_by_key(|name| index(name));
    for (wanted, expected) in
        [(None, names[0]), (Some(names[0]), names[0]), (Some(names[1]), names[1])]
    {
        let mut search = search_with(&bench, &json!({ "velocity": wanted }), (0.0, 0.0));
        search.connect(sensors).unwrap();
        let Sensed { driver, gnss, position, velocity } = search.sensed.unwrap();
        assert_eq!((driver, gnss), (index("imu"), index(expected)), "{wanted:?}");
        assert_eq!((position, velocity), (3, Some(0)));
        assert!(search.model.is_some());
    }
    for wanted in ["speeds", "imu", "none"] {
        let mut search = search_with(&bench, &json!({ "velocity": wanted }), (0.0, 0.0));
        assert!(search.connect(sensors).is_err(), "{wanted}");
    }
}

/// After 20 s the accelerometers are off by 1 m/s through their bias, by `g w t^2 / 2` through
/// that of the gyros, and a fix by 0.1 m/s. A vehicle that stands, level, measures a velocity of
/// 3 m/s down that is not there. One that drives backward is 2 off its direction, which counts
/// as a slip of 0.2. Neither is explained by another attitude.
#[test]
fn a_fix_counts_by_what_it_is_known_to() {
    let bench = Bench::new(&[]);
    let (gyro, accel) = (1e-3, 0.05);
    let mut search = search_with(&bench, &json!({ "min_speed": "2 m/s" }), (gyro, accel));
    let position = Geodetic { latitude: 0.8, longitude: 0.1, height: 50.0 };
    let gravity = LocalEarth::at(position.latitude, position.height).gravity;
    let mut fix = |t: f64, velocity: Vector3<f64>, dvel: Vector3<f64>| {
        search.integral.dvel = Vector3::new(7.0, -5.0, 3.0) + dvel;
        search.integral.c_b_b0 =
            nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::PI);
        let sample = Sample::new(Time::from_seconds(100.0 + t).unwrap(), SensorId(1), &[]);
        let place = (sample.time, position);
        search.fix(Fix::measured(place, velocity, &search.integral));
    };
    let start = Vector3::new(1.0, 0.0, 0.0);
    fix(0.0, start, Vector3::zeros());
    fix(20.0, start, Vector3::z() * (-20.0 * gravity - 3.0));
    fix(0.0, start * 6.0, start * 5.0);
    assert_eq!(search.moving, 1);
    let fit = search.pairs[0].solve().unwrap();
    assert!(fit.rotation.angle() < 1e-6, "{}", fit.rotation.angle());
    let variance = (accel * 20.0).powi(2) + (gravity * gyro * 200.0).powi(2) + 0.01;
    let expected = 9.0 / variance + (2.0 / 0.2_f64).powi(2);
    // the eigenvalue rounds by 1e-16 of the largest, 4 (200 / 2)^2
    assert!((fit.residual - expected).abs() < 1e-9, "{} {expected}", fit.residual);
}

/// A car that turns by 0.1 rad/s while it accelerates from 3 m/s by 0.5 m/s^2, with biases, whose
/// fixes begin after a second. The force within an interval of 20 ms is its mean to 1e-6.
#[test]
fn a_car_that_drives_along_a_bend_is_aligned() {
    let bench = Bench::with(RECEIVERS, &[]);
    let (layout, mut state) = (&*bench.composition.layout, bench.state());
    let n = bench.navigation;
    let (gyro, accel) = (Vector3::new(0.02, -0.03, 0.05), Vector3::new(0.3, -0.2, 0.4));
    state.set(layout, n.gyro_bias.unwrap(), &gyro);
    state.set(layout, n.accel_bias.unwrap(), &accel);
    state.time = Time::from_seconds(50.0).unwrap();
    let begin = state.time;
    let mut search = search_with(&bench, &json!({ "duration": "10 s" }), (0.0, 0.0));
    search.connect(&bench.composition.sensors).unwrap();
    let Sensed { driver, gnss, .. } = search.sensed.unwrap();
    let place = Geodetic { latitude: 0.8, longitude: 0.1, height: 50.0 };
    let gravity = LocalEarth::at(place.latitude, place.height).gravity;
    let filter = |state: &State, search: &CourseAlignment| {
        let covariance = navfuse_core::state::covariance::Covariance::zero(layout.tangent);
        let now = FilterView { layout, state, covariance: &covariance, gated: None };
        search.unfinished(&now)
    };
    assert!(filter(&state, &search).is_none(), "before the first sample");
    let mut found = None;
    for k in 1..=1_000_i64 {
        let time = begin + Span::from_nanos(k * 20_000_000);
        let middle = (k as f64 - 0.5) * 0.02;
        let f = Vector3::new(0.5, (3.0 + 0.5 * middle) * 0.1, -gravity) + accel;
        let w = Vector3::new(0.0, 0.0, 0.1) + gyro;
        let driving = Sample::new(time, SensorId(driver), &[w.x, w.y, w.z, f.x, f.y, f.z]);
        assert_eq!(search.search(layout, &mut state, &driving).unwrap(), Progress::Searching);
        if k % 50 == 0 {
            let t = time.since(begin);
            let (sin, cos) = (HEADING + 0.1 * t).sin_cos();
            let speed = 3.0 + 0.5 * t;
            let Geodetic { latitude, longitude, height } = place;
            let channels = [speed * cos, speed * sin, 0.0, latitude, longitude, height];
            let fix = Sample::new(time, SensorId(gnss), &channels);
            assert!(filter(&state, &search).is_some(), "{t} s");
            if search.search(layout, &mut state, &fix).unwrap() == Progress::Found {
                found = Some(t);
                break;
            }
            // another receiver counts for nothing
            let other = Sample::new(time, SensorId(driver + gnss + 1), &channels.map(|x| -x));
            search.search(layout, &mut state, &other).unwrap();
        }
    }
    assert_eq!(found, Some(10.0));
    assert!(filter(&state, &search).is_none(), "it has ended");
    let (roll, pitch, yaw) = state.get(layout, n.attitude).euler_angles();
    assert!(roll.abs().max(pitch.abs()).max((yaw - HEADING).abs()) < 1e-4, "{roll} {pitch} {yaw}");
    let velocity = state.get(layout, n.velocity);
    let first = Vector3::new((HEADING + 0.1).cos(), (HEADING + 0.1).sin(), 0.0) * 3.5;
    assert!((velocity - first).norm() < 1e-12, "{velocity}");
}

/// A car accelerates from 3 m/s by 0.5 m/s^2 on a straight road; its fixes begin after 0.4 s. The
/// mean velocity between two positions is exact for a constant acceleration, the trapezoids of
/// 20 ms are off by 1e-5 m/s.
#[test]
fn positions_without_velocity_align_a_car() {
    for vertical in [false, true] {
        let bench = Bench::with(RECEIVERS, &[]);
        let (layout, mut state) = (&*bench.composition.layout, bench.state());
        let mut search = search_with(&bench, &json!({}), (0.0, 0.0));
        let velocity = vertical.then_some(3);
        search.sensed = Some(Sensed { driver: 0, gnss: 1, position: 0, velocity });
        let place = Geodetic { latitude: 0.8, longitude: 0.1, height: 50.0 };
        let gravity = LocalEarth::at(place.latitude, place.height).gravity;
        let (begin, (sin, cos)) = (state.time, HEADING.sin_cos());
        let found = (1..=1_000_i64).find(|k| {
            let time = begin + Span::from_nanos(k * 20_000_000);
            let driving = Sample::new(time, SensorId(0), &[0.0, 0.0, 0.0, 0.5, 0.0, -gravity]);
            search.search(layout, &mut state, &driving).unwrap();
            let t = time.since(begin);
            let (way, speed) = (3.0 * t + 0.25 * t * t, 3.0 + 0.5 * t);
            let at = place.displaced(&Vector3::new(way * cos, way * sin, 0.0));
            let mut fix = Sample::empty(time, SensorId(1));
            let channels = [at.latitude, at.longitude, at.height, speed * cos, speed * sin];
            channels.iter().enumerate().for_each(|(k, value)| fix.set(k, *value));
            k % 20 == 0 && search.search(layout, &mut state, &fix).unwrap() == Progress::Found
        });
        assert!(found.is_some());
        let (roll, pitch, yaw) = state.get(layout, bench.navigation.attitude).euler_angles();
        let off = roll.abs().max(pitch.abs()).max((yaw - HEADING).abs());
        assert!(off < 1e-4, "{roll} {pitch} {yaw}");
        let start = if vertical { 3.2 } else { 3.0 };
        let error = state.get(layout, bench.navigation.velocity)
            - Vector3::new(start * cos, start * sin, 0.0);
        assert!(error.norm() < 1e-3, "{error}");
    }
}

/// Positions of a vehicle at rest that differ by 3.2 m. Without noise this is a way; with a noise of 1.5 m only the tenth
/// second counts, by the error of two positions.
#[test]
fn positions_that_differ_by_their_noise_are_no_motion() {
    for (noise, expected) in [([0.0; 2], 1.0), ([1.5, 2.5], 10.0)] {
        let mut positions = Positions::default();
        let place = Geodetic { latitude: 0.8, longitude: 0.1, height: 50.0 };
        let found = (0..100_i64).find_map(|k| {
            let time = Time::from_nanos(k * 200_000_000);
            let off = if k % 2 == 0 { -1.6 } else { 1.6 };
            let fix =
                positions.take((time, place.displaced(&Vector3::new(off, 0.0, 0.0))), noise)?;
            Some((time.seconds(), fix))
        });
        let (at, fix) = found.unwrap();
        assert!((at - expected).abs() < 0.1, "{noise:?}: {at}");
        let error = (2_f64.sqrt() * noise[0]).max(0.7);
        assert!((fix.sigma[0] - error / at).abs() < 1e-9, "{noise:?}: {}", fix.sigma[0]);
    }
}

/// The vehicle may gain 1 m/s until the first fix; the heading is within the slip.
#[test]
fn the_filter_starts_with_the_uncertainty_of_the_course() {
    let bench = Bench::with(RECEIVERS, &["process.ins.alignment=course"]);
    let layout = &*bench.composition.layout;
    let sigma = |name: &str| layout.find(name).unwrap().spec.sigma.clone();
    assert_eq!(sigma("ins.velocity"), [1.0; 3]);
    assert_eq!(sigma("ins.attitude"), [0.05, 0.05, 0.2]);
    let position = bench.state().get(layout, bench.navigation.position);
    let given = [45_f64.to_radians(), 8_f64.to_radians(), 100.0];
    assert_eq!([position.latitude, position.longitude, position.height], given);
}
