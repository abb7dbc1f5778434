//! Pseudoranges: the equation against the light time in inertial axes, and consistency of receivers with
//! few and many satellites, and with satellites that multipath spoils.
#![allow(missing_docs)]

use navfuse_core::nalgebra::{Rotation3, Vector3};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_testing::ModelBench;
use navfuse_testing::judge::judged;
use navfuse_testing::registry;

const RECEIVER: &str = include_str!("pseudoranges.toml");

/// 17 states, so the mean NEES of 30 runs has a sigma of sqrt(2 / (30 * 17)) = 0.063, and the mean
/// NIS of n observations one of sqrt(2 / n); 3.3 sigma.
#[test]
fn pseudoranges_of_4_to_40_satellites_are_consistent_with_a_clock_that_wanders() {
    for (satellites, least, most) in [(13, 3.0, 6.0), (32, 8.0, 14.0), (148, 36.0, 44.0)] {
        let setting = format!("sensor.pseudoranges.simulation.satellites={satellites}");
        let (mut nees, mut nis, mut count) = (0.0, 0.0, 0);
        for seed in 1..=30 {
            let settings = [setting.clone(), format!("seed={seed}")];
            let (finished, judge) = judged(&registry(), RECEIVER, &settings);
            assert!(finished.error.is_none(), "seed {seed}: {:?}", finished.error);
            assert_eq!((judge.freedom, judge.refused), (17, 0), "seed {seed}");
            nees += judge.nees / (30.0 * 17.0);
            nis += judge.nis.iter().map(|(_, nis)| nis).sum::<f64>();
            count += judge.nis.len();
        }
        let (nis, each) = (nis / f64::from(count as u32), f64::from(count as u32) / (30.0 * 61.0));
        println!("{satellites} satellites: {each:.1} in view, ANEES {nees:.3}, ANIS {nis:.4}");
        assert!((least..most).contains(&each), "{each}");
        assert!((nees - 1.0).abs() < 0.21, "{nees}");
        assert!((nis - 1.0).abs() < 3.3 * (2.0 / f64::from(count as u32)).sqrt(), "{nis}");
    }
}

/// A satellite with an error of 100 sigma is gated, and the others of its time are used.
#[test]
fn each_pseudorange_passes_its_gate_or_fails_it_alone() {
    let text = RECEIVER
        .replace("gate = \"off\"", "gate = 0.9999")
        .replace("satellites = 32", "satellites = 32, outliers = \"10 %\", outlier_size = 100");
    let (finished, judge) = judged(&registry(), &text, &[]);
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let share = judge.refused as f64 / judge.nis.len() as f64;
    // about 600 observations: the share has a sigma of sqrt(0.1 * 0.9 / 600) = 0.012
    assert!((share - 0.1).abs() < 0.04, "{share}");
    assert!(judge.nees < 45.0, "chi-square of 17, once in 4000: {}", judge.nees);
}

/// Multipath: one observation in twenty is off by 20 sigma, and each is gated on its own. Before the first four
/// satellites the clock is known to 30 m alone, so that an error of 20 m among these passes any gate: one run
/// in six, of which most are found out by the next satellites. 30 runs; at the end the band is that of the
/// test above.
#[test]
fn one_outlier_in_twenty_leaves_the_receiver_consistent_after_the_first_seconds() {
    let text = RECEIVER
        .replace("gate = \"off\"\n", "")
        .replace("satellites = 32", "satellites = 32, outliers = \"5 %\"");
    let nees = |stop: &str| -> Vec<f64> {
        let of = |seed| {
            let settings = [format!("estimator.stop={stop}"), format!("seed={seed}")];
            let (finished, judge) = judged(&registry(), &text, &settings);
            assert!(finished.error.is_none(), "seed {seed}: {:?}", finished.error);
            assert_eq!(judge.freedom, 17, "seed {seed}");
            judge.nees / 17.0
        };
        (1..=30).map(of).collect()
    };
    let [early, late] = ["3 s", "60 s"].map(nees);
    // a chi-square of 17 is above 43 once in 2000
    let caught = early.iter().filter(|nees| **nees > 43.0 / 17.0).count();
    let mean = late.iter().sum::<f64>() / 30.0;
    println!("{caught} of 30 off at 3 s; ANEES at 60 s {mean:.3}");
    assert!(caught <= 3, "{early:?}");
    assert!((mean - 1.0).abs() < 0.21, "{late:?}");
}

/// The signal is under way for some 75 ms, in which the Earth turns by 5e-6 rad: in axes that do not turn,
/// the satellite is where the axes of the Earth at the reception see it turned back. The correction of the
/// first order leaves `(5e-6)^2` of the radius of the Earth, 0.2 mm.
#[test]
fn a_pseudorange_is_the_light_time_in_axes_that_do_not_turn() {
    let (rate, light) = (7.292_115e-5, 299_792_458.0);
    let place = Geodetic { latitude: 0.75, longitude: 0.3, height: 120.0 };
    let blocks: [(&str, &[f64]); 3] = [
        ("ins.position", &[place.latitude, place.longitude, place.height]),
        ("ins.attitude", &[0.0, 0.0, 0.0]),
        ("receiver-clock.offset", &[75.0]),
    ];
    let arm = ["sensor.pseudoranges.lever_arm=['0 m', '0 m', '-3 m']"];
    let bench = ModelBench::new(RECEIVER, &arm, "pseudoranges", &blocks);
    let antenna = Geodetic { height: place.height + 3.0, ..place }.earth_fixed();
    let mut largest: f64 = 0.0;
    for azimuth in [0.0, 1.57, 3.1, 4.7_f64] {
        // 50 deg away on the sphere of the orbits
        let (north, east) = (0.87 * azimuth.cos(), 0.87 * azimuth.sin());
        let satellite = place.along(north, east).earth_fixed().normalize() * 26_560e3;
        let mut range = (satellite - antenna).norm();
        for _ in 0..5 {
            let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), -rate * range / light);
            range = (turned * satellite - antenna).norm();
        }
        let sample = ModelBench::sample(&[0.0, satellite.x, satellite.y, satellite.z]);
        let mut predicted = [0.0];
        bench.model.predict(&bench.at(&sample), &mut predicted);
        assert!((predicted[0] - 75.0 - range).abs() < 1e-3, "{} {range}", predicted[0]);
        largest = largest.max((range - (satellite - antenna).norm()).abs());
    }
    assert!(largest > 10.0, "the turn of the Earth counts: {largest}");
}

/// At the zenith the variances add; at 30 deg the second sigma is twice as large.
#[test]
fn the_noise_of_the_atmosphere_grows_with_one_over_the_sine_of_the_elevation() {
    let place = Geodetic { latitude: 0.0, longitude: 0.0, height: 0.0 };
    let keys = ["sensor.pseudoranges.noise=0.3 m", "sensor.pseudoranges.elevation_noise=0.4 m"];
    let position: [(&str, &[f64]); 1] = [("ins.position", &[0.0, 0.0, 0.0])];
    let bench = ModelBench::new(RECEIVER, &keys, "pseudoranges", &position);
    let variance = |up: f64, east: f64| {
        let at = place.earth_fixed() + Vector3::new(up, east, 0.0) * 2e7;
        bench.variances(&ModelBench::sample(&[2e7, at.x, at.y, at.z]))[0]
    };
    assert!((variance(1.0, 0.0) - 0.25).abs() < 1e-9);
    assert!((variance(0.5, 0.75_f64.sqrt()) - (0.09 + 0.64)).abs() < 1e-9);
}
