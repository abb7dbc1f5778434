//! The coarse alignment, sample by sample, and the velocity that it takes from a sensor.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

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
    let sensed = Sensed { imu: imu(&json!({})), driver: 0, velocity: None };
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
