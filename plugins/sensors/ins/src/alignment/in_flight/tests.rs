//! Flights that the mechanisation itself makes from increments, so that the fixes fit them exactly.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::*;
use crate::alignment::CoarseMethod;
use crate::alignment::optimisation::fit;
use crate::mechanisation::{Increments, Mechanisation, NavState};
use crate::testing::Uniform;
use navfuse_core::units::sample::SensorId;
use navfuse_core::units::time::Time;

/// Position of the antenna from the IMU, m.
const ARM: Vector3<f64> = Vector3::new(-1.0, 0.5, -2.0);
const CHANNELS: Channels = Channels { position: 0, velocity: Some(3) };
/// Steps of the IMU a second, and of them a fix.
const RATE: usize = 50;
const EACH: usize = 10;

fn channels(place: &Geodetic<f64>, velocity: &Vector3<f64>) -> [f64; MAX_CHANNELS] {
    let mut all = [0.0; MAX_CHANNELS];
    all[..3].copy_from_slice(&[place.latitude, place.longitude, place.height]);
    all[3..6].copy_from_slice(velocity.as_slice());
    all
}

/// The fixes of a flight at 60 m/s that turns and sways, and the state at its beginning.
fn flight(seed: u64, duration: usize, formula: Formula) -> (Track, NavState) {
    let mut random = Uniform::new(seed);
    let at = Geodetic { latitude: random.within(1.2), longitude: 3.0, height: 1500.0 };
    let (roll, pitch, yaw) = (random.within(0.3), random.within(0.3), random.within(3.1));
    let c_b_n = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let start = NavState { c_b_n, velocity: c_b_n * Vector3::x() * 60.0, position: at };
    let (mut nav, mut track) = (start, Track::default());
    let (mut mechanisation, mut integral) = (Mechanisation::default(), Integral::default());
    let dt = 1.0 / RATE as f64;
    for k in 1..=duration * RATE {
        let time = k as f64 * dt;
        let earth = LocalEarth::at(nav.position.latitude, nav.position.height);
        let (w_ie, w_en) = (earth.earth_rate(), earth.transport_rate(&nav.velocity));
        let turn = Vector3::new(0.02 * (1.1 * time).cos(), 0.02 * (0.8 * time).sin(), 0.02);
        // with this specific force the velocity stays constant in body axes while they turn
        let to_body = nav.c_b_n.inverse();
        let pull = (w_ie * 2.0 + w_en).cross(&nav.velocity) - Vector3::z() * earth.gravity;
        let (w, f) = (
            turn + to_body * (w_ie + w_en),
            turn.cross(&(to_body * nav.velocity)) + to_body * pull,
        );
        let increments = Increments { dtheta: w * dt, dvel: f * dt, dt };
        nav = mechanisation.step(&nav, &increments).unwrap().0;
        integral.advance(&increments);
        if k % EACH == 0 {
            let swing = w.cross(&ARM);
            let place = nav.position.displaced(&(nav.c_b_n * ARM));
            let velocity = nav.velocity + nav.c_b_n * swing;
            let sample = Sample::new(Time::MIN, SensorId(0), &channels(&place, &velocity));
            let still = channels(&at.displaced(&ARM), &swing);
            let received = Received { time, sample: &sample, integral: &integral, still, at };
            track.take(CHANNELS, formula, &received);
        }
    }
    (track, start)
}

/// Between the samples of the IMU, rates and positions are means: the second order of the sway in 20
/// ms, 1e-4 m/s in the velocity of the antenna. In 120 s the Earth turns gravity by `g W cos L t^2 / 2`
/// of 1.8 m/s or more, so the heading is good to 1e-4 rad.
#[test]
fn both_formulas_find_the_attitude_in_the_air() {
    for seed in 0..20 {
        for formula in [Formula::Velocity, Formula::Position] {
            for method in [CoarseMethod::Optimisation, CoarseMethod::VelocityLoci] {
                let (track, start) = flight(seed, 120, formula);
                let found = fit(&track.pairs(formula), method).unwrap();
                let error = found.angle_to(&start.c_b_n).to_degrees();
                assert!(error < 0.02, "{seed} {formula:?} {method:?}: {error} deg");
                let velocity = track.beginning(formula, &found) - start.velocity;
                assert!(velocity.norm() < 0.1, "{seed} {formula:?}: {velocity}");
            }
        }
    }
}

#[test]
fn a_sample_without_what_the_formula_needs_gives_no_fix() {
    let integral = Integral::default();
    let at = Geodetic { latitude: 0.5, longitude: 0.1, height: 10.0 };
    let full = channels(&at, &Vector3::zeros());
    let taken = |formula: Formula, values: &[f64]| {
        let mut track = Track::default();
        for time in [1.0, 1.0, 2.0] {
            let sample = Sample::new(Time::MIN, SensorId(0), values);
            let received = Received { time, sample: &sample, integral: &integral, still: full, at };
            track.take(CHANNELS, formula, &received);
        }
        track.count()
    };
    assert_eq!(taken(Formula::Velocity, &full[..6]), 3);
    assert_eq!(taken(Formula::Velocity, &full[..5]), 0);
    assert_eq!(taken(Formula::Position, &full[..2]), 3);
    assert_eq!(taken(Formula::Position, &full[..1]), 0);
}
