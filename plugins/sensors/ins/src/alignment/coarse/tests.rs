//! The coarse alignment, sample by sample, and the velocity that it takes from a sensor.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use super::*;
use crate::testing::{Bench, imu};
use navfuse_core::model::sensor::Role;
use navfuse_core::units::sample::SensorId;
use serde_json::json;

/// A vehicle at rest, whose samples cover 5 and 15 ms in turn, rocks by 15 urad: back in the short
/// ones as far as forth in the long ones. The means over time are those at rest.
fn at_rest(coarse: &str) -> (CoarseAlignment, CoarseSolution, UnitQuaternion<f64>) {
    let bench = Bench::new(&[]);
    let (layout, state) = (&*bench.composition.layout, bench.state());
    let keys = json!({
        "method": "static", "coarse": coarse, "duration": "60 s", "coarse_duration": "20 s",
    });
    let settings = AlignmentSettings::new(&serde_json::from_value(keys).unwrap(), (0.0, 0.0));
    let settings = settings.unwrap().unwrap();
    let sensed = Sensed {
        navigation: bench.navigation,
        imu: imu(&json!({})),
        driver: 0,
        velocity: None,
        gnss: None,
    };
    let mut search = CoarseAlignment::new(layout, &state, bench.navigation);
    let attitude = UnitQuaternion::from_euler_angles(0.1, -0.2, 1.0);
    let earth = LocalEarth::at(45_f64.to_radians(), 100.0);
    let rate = attitude.inverse() * earth.earth_rate();
    let force = attitude.inverse() * Vector3::new(0.0, 0.0, -earth.gravity);
    let mut nanos = 0;
    for k in 0.. {
        let (interval, rock) = if k % 2 == 0 { (5_000_000, -3e-3) } else { (15_000_000, 1e-3) };
        nanos += interval;
        let w = rate + Vector3::new(rock, rock, rock);
        let channels = [w.x, w.y, w.z, force.x, force.y, force.z];
        let sample = Sample::new(Time::from_nanos(nanos), SensorId(0), &channels);
        if search.take(layout, &sensed, &settings, &sample).unwrap() {
            break;
        }
    }
    let found = search.find(&sensed, &settings).unwrap();
    (search, found, attitude)
}

/// Sums of 2000 samples round by 2000 * 1e-16 of 3e-3 rad/s 20 ms, less than 1e-14 rad of the Earth
/// rate's 1e-3 rad.
#[test]
fn the_means_are_over_time_where_samples_come_unevenly() {
    let (_, found, attitude) = at_rest("analytic");
    let error = found.c_b_n.angle_to(&attitude);
    assert!(error < 1e-10 && found.velocity == Vector3::zeros(), "{error}");
}

#[test]
fn at_rest_there_is_an_instant_every_second() {
    let (search, found, attitude) = at_rest("optimisation");
    let times: Vec<f64> = search.instants.iter().map(|i| i.time).collect();
    assert_eq!(times, (0..=20).map(f64::from).collect::<Vec<_>>());
    // a rocking by 15 urad in turn, of the 1.5e-3 rad by which gravity turns in 20 s
    assert!(found.c_b_n.angle_to(&attitude) < 2e-2);
}

/// The velocity that a sample of [`Bench`]'s speeds gives, with these sigmas of the channels.
fn velocity(sigma: [f64; 4], channels: &[f64]) -> Option<Vector3<f64>> {
    let bench = Bench::new(&[&format!("sensor.speeds.sigma={sigma:?}")]);
    let composition = &bench.composition;
    let speeds = composition.sensor("speeds").unwrap();
    let Role::Measurement(model) = &composition.sensors[speeds].role else { return None };
    let sample = Sample::new(Time::default(), SensorId(speeds), channels);
    let state = bench.state();
    body_velocity(&composition.layout, model.as_ref(), &state, &sample, bench.navigation)
}

/// A channel with a sigma of 1 m/s is wrong by as much, beside good ones of 1 mm/s. It moves the
/// velocity by the variance of the others over its own: 1e-6, times 7 at most for an axis that the
/// diagonal and the two other axes give (`5 + 2` of the squares of the inverse).
#[test]
fn a_channel_counts_by_its_noise() {
    let v = Vector3::new(3.0, -1.0, 0.5);
    let diagonal = v.sum() / 3_f64.sqrt();
    for wrong in 0..4 {
        let (mut sigma, mut channels) = ([1e-3; 4], [v.x, v.y, v.z, diagonal]);
        sigma[wrong] = 1.0;
        channels[wrong] += 1.0;
        let found = velocity(sigma, &channels).unwrap();
        assert!((found - v).norm() < 7e-6, "{wrong}: {found}");
    }
}

/// With a sigma a thousand times that of the others, a component counts as not measured.
#[test]
fn a_velocity_needs_all_three_components() {
    assert!(velocity([1.0; 4], &[3.0, -1.0]).is_none());
    assert!(velocity([1.0, 1.0, 1000.0, 1.0], &[3.0, -1.0, 0.5]).is_none());
    let found = velocity([1.0, 1.0, 999.0, 1.0], &[3.0, -1.0, 0.5]).unwrap();
    assert!((found - Vector3::new(3.0, -1.0, 0.5)).norm() < 1e-12, "{found}");
}

fn settings(keys: serde_json::Value, bias: (f64, f64)) -> AlignmentSettings {
    AlignmentSettings::new(&serde_json::from_value(keys).unwrap(), bias).unwrap().unwrap()
}

/// What makes a velocity at rest: noise (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)) and bias (rad/s, m/s^2) of
/// gyros and accelerometers, and sway (m/s).
#[derive(Clone, Copy, Default)]
struct Causes {
    noise: [f64; 2],
    bias: [f64; 2],
    sway: f64,
}

/// The beginning of an alignment at rest.
const BEGIN: f64 = 1_000.0;

/// An alignment over 20 s at rest and level, with an apparent velocity 10 s after the beginning:
/// down, so that no attitude explains it.
fn with_velocity(causes: Causes, velocity: f64) -> Result<CoarseSolution, AlignmentError> {
    let bench = Bench::new(&[]);
    let (layout, mut state) = (&*bench.composition.layout, bench.state());
    state.time = Time::from_seconds(BEGIN).unwrap();
    let Causes { noise, bias, sway } = causes;
    let keys = json!({
        "method": "static", "duration": "60 s", "coarse_duration": "20 s",
        "rest_velocity": format!("{:e} m/s", sway.max(1e-9)),
    });
    let settings = settings(keys, (bias[0], bias[1]));
    let imu = imu(&json!({
        "gyro_noise": format!("{:e} rad/s/sqrt(Hz)", noise[0].max(1e-12)),
        "accel_noise": format!("{:e} m/s^2/sqrt(Hz)", noise[1].max(1e-12)),
    }));
    let sensed =
        Sensed { navigation: bench.navigation, imu, driver: 0, velocity: None, gnss: None };
    let mut search = CoarseAlignment::new(layout, &state, bench.navigation);
    let earth = LocalEarth::at(45_f64.to_radians(), 100.0);
    let w = earth.earth_rate();
    for k in 1..=20 {
        let time = Time::from_seconds(BEGIN + f64::from(k)).unwrap();
        let sample = Sample::new(time, SensorId(0), &[w.x, w.y, w.z, 0.0, 0.0, -earth.gravity]);
        let enough = search.take(layout, &sensed, &settings, &sample).unwrap();
        assert_eq!(enough, k == 20);
    }
    search.instants[10].dvel.z += velocity;
    search.find(&sensed, &settings)
}

/// Variance of the velocity that the causes make until `t`: a rate of turn at `s` tilts gravity for
/// the rest of the time, and so gives `g (t - s)` of velocity; an acceleration gives 1. A bias sums
/// up, noise in squares; sway is in both ends of the interval.
fn variance(causes: Causes, gravity: f64, t: f64) -> f64 {
    let Causes { noise, bias, sway } = causes;
    let ds = t / 1_000.0;
    let (mut drift, mut spread) = ([0.0; 2], 0.0);
    for s in (0..1_000).map(|k| (f64::from(k) + 0.5) * ds) {
        for (k, effect) in [gravity * (t - s), 1.0].into_iter().enumerate() {
            drift[k] += bias[k] * effect * ds;
            spread += (noise[k] * effect).powi(2) * ds;
        }
    }
    drift[0].powi(2) + drift[1].powi(2) + spread + 2.0 * sway * sway
}

/// Motion is a velocity beyond six sigma, of its own time and, as the attitude passes it on in
/// proportion to time, of the end.
#[test]
fn a_velocity_beyond_six_sigma_of_its_causes_is_motion() {
    let alone = [
        Causes { noise: [1e-4, 0.0], ..Causes::default() },
        Causes { noise: [0.0, 3e-3], ..Causes::default() },
        Causes { bias: [1e-5, 0.0], ..Causes::default() },
        Causes { bias: [0.0, 1e-3], ..Causes::default() },
        Causes { sway: 0.01, ..Causes::default() },
    ];
    let together = Causes { noise: [1e-4, 6e-3], bias: [2e-5, 2e-3], sway: 0.014 };
    let gravity = LocalEarth::at(45_f64.to_radians(), 100.0).gravity;
    for causes in alone.into_iter().chain([together]) {
        let [then, end] = [10.0, 20.0].map(|t| variance(causes, gravity, t));
        let limit = 6.0 * (then + end / 4.0).sqrt();
        for sign in [1.0, -1.0] {
            assert!(with_velocity(causes, 0.99 * sign * limit).is_ok(), "{limit}");
        }
        let Err(AlignmentError::NotAtRest { error, at, duration, begin }) =
            with_velocity(causes, 1.01 * limit)
        else {
            panic!("{limit} m/s is motion")
        };
        assert!((error / limit - 1.01).abs() < 1e-3, "{error} m/s, limit {limit} m/s");
        assert_eq!((at.seconds(), begin.seconds(), duration), (BEGIN + 10.0, BEGIN, 60.0));
    }
}

/// A vehicle in motion with samples of the IMU twice a second, which turns about its vertical axis
/// by 0.2 rad/s and rises with 0.5 m/s^2, with biases; and speeds in between and with them.
fn moving(
    sensor: &str,
    settings: &AlignmentSettings,
    end: i64,
) -> (Bench, Sensed, CoarseAlignment) {
    let bench = Bench::with(sensor, &["process.ins.attitude.sigma=20 deg"]);
    let composition = &bench.composition;
    let (layout, mut state) = (&*composition.layout, bench.state());
    state.time = Time::from_seconds(BEGIN).unwrap();
    state.set(layout, bench.navigation.gyro_bias.unwrap(), &Vector3::new(0.0, 0.0, 0.1));
    state.set(layout, bench.navigation.accel_bias.unwrap(), &Vector3::new(0.0, 0.0, 0.25));
    let name = if sensor.is_empty() { "speeds" } else { "mounted" };
    let [driver, speeds] = ["imu", name].map(|name| composition.sensor(name).unwrap());
    let Role::Measurement(model) = &composition.sensors[speeds].role else { panic!("it measures") };
    let velocity = Some((speeds, model.clone()));
    let sensed =
        Sensed { navigation: bench.navigation, imu: imu(&json!({})), driver, velocity, gnss: None };
    let mut search = CoarseAlignment::new(layout, &state, bench.navigation);
    let mut take = |eighths: i64, sensor: usize, channels: &[f64]| {
        let time = state.time + Span::from_nanos(eighths * 125_000_000);
        let sample = Sample::new(time, SensorId(sensor), channels);
        search.take(layout, &sensed, settings, &sample).unwrap()
    };
    let speed = |eighths: i64| [eighths as f64, 2.0, -1.0];
    for k in (4..=end).step_by(4) {
        // the second speed comes with the sample of the IMU, but before it
        take(k - 3, speeds, &speed(k - 3));
        take(k, speeds, &speed(k));
        take(k, speeds + driver + 1, &[1.0; 6]);
        let enough = take(k, driver, &[0.0, 0.0, 0.3, 0.0, 0.0, 0.75]);
        assert_eq!(enough, k >= 160, "{k}");
        take(k, driver, &[9.0; 6]);
    }
    (bench, sensed, search)
}

fn in_motion() -> AlignmentSettings {
    settings(json!({ "method": "in-motion", "duration": "20 s", "max_gap": "2 s" }), (0.0, 0.0))
}

#[test]
fn a_velocity_between_two_samples_has_the_integrals_of_its_time() {
    let (bench, _, search) = moving("", &in_motion(), 16);
    assert_eq!(search.instants.len(), 8);
    for (instant, eighths) in search.instants.iter().zip([1, 4, 5, 8, 9, 12, 13, 16]) {
        let t = f64::from(eighths) / 8.0;
        assert_eq!(instant.time, t);
        let turned =
            instant.c_b_b0.angle_to(&UnitQuaternion::from_scaled_axis(Vector3::z() * 0.2 * t));
        let gained = instant.dvel - Vector3::z() * 0.5 * t;
        // rounding of a few steps
        assert!(turned < 1e-15 && gained.norm() < 1e-15, "{t} s: {turned} {gained}");
        let speed = Vector3::new(f64::from(eighths), 2.0, -1.0);
        assert!((instant.velocity - speed).norm() < 1e-12, "{}", instant.velocity);
    }
    let off = (search.sums.0 - Vector3::z() * 0.4).norm() + (search.sums.1 - Vector3::z()).norm();
    assert!(off < 1e-15 && search.elapsed() == 2.0, "{:?}", search.sums);
    let layout = &*bench.composition.layout;
    let solution = CoarseSolution {
        c_b_n: UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
        velocity: Vector3::new(1.0, 2.0, 3.0),
    };
    let mut state = bench.state();
    solution.set(layout, &bench.navigation, &mut state);
    let attitude = state.get(layout, bench.navigation.attitude);
    assert!(attitude.angle_to(&solution.c_b_n.into()) < 1e-15);
    assert_eq!(state.get(layout, bench.navigation.velocity), solution.velocity);
}

#[test]
fn an_alignment_in_motion_needs_ten_velocities() {
    let settings = in_motion();
    let (_, sensed, mut search) = moving("", &settings, 20);
    assert!(search.instants.len() == 10 && search.find(&sensed, &settings).is_ok());
    search.instants.pop();
    let error = search.find(&sensed, &settings).unwrap_err();
    let few = AlignmentError::TooFewVelocities { count: 9, duration: 20.0, least: 10 };
    assert_eq!(error, few);
}

/// The last velocity comes 2.5 s after the beginning, the longest gap is 2 s.
#[test]
fn a_gap_in_the_velocities_is_reported_from_its_beginning_on() {
    let settings = in_motion();
    let (_, sensed, mut search) = moving("", &settings, 20);
    assert!(search.gap(4.5, &settings).is_ok());
    search.last = search.begin + Span::from_seconds(4.75).unwrap();
    let from = search.begin + Span::from_seconds(2.5).unwrap();
    let gap = AlignmentError::VelocityGap { gap: 2.25, from, duration: 20.0 };
    assert_eq!(search.find(&sensed, &settings).unwrap_err(), gap);
    search.instants.clear();
    assert!(search.gap(2.0, &settings).is_ok());
    let gap = AlignmentError::VelocityGap { gap: 2.25, from: search.begin, duration: 20.0 };
    assert_eq!(search.gap(2.25, &settings).unwrap_err(), gap);
}

/// The attitude and a rotation that the sensor does not read are uncertain by 20 deg and more.
#[test]
fn an_uncertain_mounting_of_the_velocity_sensor_is_doubted_beyond_one_degree() {
    let doubt = |sigma: f64, considered: bool| {
        let sensor = format!("[sensor.mounted]\nsigma = {sigma:?}\nconsidered = {considered}\n");
        let (bench, sensed, search) = moving(&sensor, &in_motion(), 4);
        search.unverified(&bench.composition.layout, &sensed)
    };
    assert_eq!(doubt(1.0, false), None);
    assert_eq!(doubt(5.0, true), None);
    for sigma in [1.02, 5.0] {
        let (evidence, remedy) = doubt(sigma, false).unwrap();
        let start = format!("mounted.mounting has a prior sigma of {sigma:.1} deg");
        assert!(evidence.starts_with(&start), "{evidence}");
        assert!(remedy.contains("sensor.mounted.mounting.initial"), "{remedy}");
    }
}
