//! Every method on data for which it is exact, and the messages of methods that lack data.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod common;

use common::{data, read};
use navfuse_calibration::{AttitudeSource, CalibrationData, Estimate, Method};

/// No noise, no biases, and a known attitude, as the methods for an AHRS assume.
const EXACT: [&str; 8] = [
    "estimator.draw=start",
    "sensor.imu.simulation.noise=0",
    "sensor.dvl.simulation.noise=0",
    "sensor.gnss.simulation.noise=0",
    "sensor.depth.simulation.noise=0",
    "sensor.gnss.bias={}",
    "process.ins.gyro_bias={ sigma = \"0.05 deg/h\", truth = \"0 deg/h\" }",
    "process.ins.accel_bias={ sigma = \"100 ug\", truth = \"0 ug\" }",
];

fn exact(more: &[&str]) -> CalibrationData {
    let recording = read("calibration", &[&EXACT, more].concat());
    CalibrationData::new(recording, AttitudeSource::Reference).unwrap_or_else(|e| panic!("{e}"))
}

/// Error of k (ppm), roll, pitch, yaw (deg).
fn error(data: &CalibrationData, method: Method) -> (Estimate, [f64; 4]) {
    let estimate = method.estimate(data).unwrap_or_else(|e| panic!("{}: {e}", method.name()));
    let e = estimate.error(&data.velocity().unwrap().truth.unwrap());
    let deg = |i: usize| e[i].to_degrees();
    let e = [1e6 * e[0], deg(1), deg(2), deg(3)];
    println!(
        "{}: k {:.0} ppm, roll {:.4} pitch {:.4} yaw {:.4} deg {:?}",
        method.name(),
        e[0],
        e[1],
        e[2],
        e[3],
        estimate.determined
    );
    (estimate, e)
}

/// Remaining errors: straight lines interpolate the DVL's 5 Hz, and GNSS velocities are compared
/// with means over 1 s, which in a turn of 6 deg/s are short by (w T)^2 / 24 = 500 ppm, 100 over
/// the whole run. Troni & Whitcomb leave out the Earth's rate: 2 w_ie x v is 0.36 mm/s^2 of a
/// root-mean-square acceleration of 0.15 m/s^2, 2.4 mrad.
#[test]
fn each_method_finds_the_truth_where_its_assumptions_hold() {
    let data = exact(&[]);
    for (method, k, angle) in [
        (Method::IoDvlc, 10.0, 0.001),
        (Method::Kinsey2007, 300.0, 0.02),
        (Method::Tang, 500.0, 0.03),
        (Method::Troni, 1000.0, 0.14),
    ] {
        let (estimate, e) = error(&data, method);
        assert!(
            estimate.determined.iter().all(|d| *d),
            "{}: {:?}",
            method.name(),
            estimate.determined
        );
        assert!(
            e[0].abs() < k && e[1..].iter().all(|a| a.abs() < angle),
            "{}: {e:?}",
            method.name()
        );
    }
}

/// The observer forgets its initial value with the time constant of its gain and of the spread of
/// the velocity's direction. It finds the angles perpendicular to the course; roll needs sway.
#[test]
fn the_observer_on_so3_finds_pitch_and_yaw_and_has_no_scale_factor() {
    let data = exact(&[]);
    let (estimate, e) = error(&data, Method::Kinsey2006);
    assert!(!estimate.determined[0] && estimate.sigma().is_none());
    assert!(e[2].abs() < 0.05 && e[3].abs() < 0.05, "{e:?}");
}

/// Joyce's two unknowns are exact if there are no others.
#[test]
fn scale_factor_and_yaw_alone_are_found_by_joyce() {
    let yaw = "sensor.dvl.misalignment={ sigma = \"2 deg\", truth = [\"0 deg\", \"0 deg\", \"1.2 deg\"] }";
    let data = exact(&[yaw]);
    let (estimate, e) = error(&data, Method::Joyce);
    assert_eq!(estimate.determined, [true, false, false, true]);
    assert!(e[0].abs() < 500.0 && e[3].abs() < 0.03, "{e:?}");
}

/// The change of gravity with the attitude, 8 deg of bank, is 1.4 m/s^2, ten times the acceleration
/// that the DVL measures. Without other errors its remainder is ten times the error of the method
/// with gravity.
#[test]
fn without_gravity_troni_is_wrong() {
    let data = exact(&[]);
    let (_, with) = error(&data, Method::Troni);
    let (_, without) = error(&data, Method::TroniPrinted);
    assert!(
        without[0].abs() > 1000.0 && without[0].abs() > 5.0 * with[0].abs(),
        "{with:?} {without:?}"
    );
}

fn refused(name: &str, settings: &[&str], method: Method, words: &[&str]) {
    let error = match method.estimate(&data(name, settings)) {
        Err(need) => need.to_string(),
        Ok(e) => panic!("{} must refuse: {e:?}", method.name()),
    };
    for word in words {
        assert!(error.contains(word), "{}: {word:?} is not in: {error}", method.name());
    }
}

#[test]
fn missing_data_is_named_with_the_remedy() {
    let stop = "estimator.stop=720 s";
    for method in [Method::Kinsey2006, Method::Kinsey2007, Method::Joyce, Method::Tang] {
        refused("pan-wu-3d", &[stop], method, &["position fixes", "[sensor.gnss]", "io-dvlc"]);
    }
    for method in [Method::IoDvlc, Method::IoDvlcPrinted, Method::Troni, Method::Joyce] {
        refused("pan-wu-3d", &[stop, "sensor.dvl.enabled=false"], method, &["add [sensor.dvl]"]);
    }
    // at rest, and with a segment that is too short
    refused(
        "pan-wu-3d",
        &["estimator.stop=600 s"],
        Method::IoDvlc,
        &["no segment of Type I", "accelerate"],
    );
    refused(
        "pan-wu-3d",
        &["estimator.stop=608 s"],
        Method::IoDvlc,
        &["no segment of Type I", "10 s or more"],
    );
    refused("pan-wu-3d", &["estimator.stop=600 s"], Method::Troni, &["accelerate"]);
    // a stationary vehicle, and one with fixes for too short a time
    refused("calibration", &["estimator.stop=300 s"], Method::Joyce, &["under way"]);
    let short = "sensor.gnss.simulation.outages=[[\"330 s\", \"1e6 s\"]]";
    let from = "sensor.dvl.simulation.offset=300 s";
    refused(
        "calibration",
        &[short, from, "estimator.stop=500 s"],
        Method::Tang,
        &["overlap for", "surface"],
    );
}

#[test]
fn a_level_run_has_one_direction_and_a_note_on_it() {
    let data = data("pan-wu-2d", &["estimator.stop=760 s"]);
    let estimate = Method::IoDvlc.estimate(&data).unwrap();
    assert!(
        estimate
            .notes
            .iter()
            .any(|n| n.contains("one direction only, [1.00, ") && n.contains("dive")),
        "{:?}",
        estimate.notes
    );
    assert!(
        estimate.determined[0]
            && !estimate.determined[1]
            && estimate.determined[2]
            && estimate.determined[3]
    );
    let printed = Method::IoDvlcPrinted.estimate(&data).unwrap();
    assert_eq!(printed.determined, [true, false, true, true]);
}

#[test]
fn a_log_without_rest_gets_a_note() {
    let data = data("surface-dive", &["estimator.stop=340 s"]);
    let estimate = Method::IoDvlc.estimate(&data).unwrap();
    assert!(estimate.notes.iter().any(|n| n.contains("no time at rest")), "{:?}", estimate.notes);
}

#[test]
fn a_gap_of_the_dvl_inside_a_segment_is_bridged_by_the_imu_or_refused() {
    let gap = ["estimator.stop=720 s", "sensor.dvl.simulation.outages=[[\"630 s\", \"650 s\"]]"];
    refused(
        "pan-wu-3d",
        &gap,
        Method::IoDvlcPrinted,
        &["no samples from 630 s to 650 s", "not used"],
    );
    let data = data("pan-wu-3d", &gap);
    let estimate = Method::IoDvlc.estimate(&data).unwrap();
    assert!(
        estimate.notes.iter().any(|n| n.contains("the IMU bridges the gap")),
        "{:?}",
        estimate.notes
    );
    let (error, sigma) =
        (estimate.error(&data.velocity().unwrap().truth.unwrap()), estimate.sigma().unwrap());
    assert!((0..4).all(|i| error[i].abs() < 4.0 * sigma[i]), "{error:?} {sigma:?}");
}

#[test]
fn water_track_is_no_velocity_over_the_ground() {
    let water = [
        "estimator.stop=400 s",
        "process.water={ type = \"water-current\", current = { sigma = \"0.3 m/s\" } }",
        "sensor.dvl.track=water",
        "sensor.dvl.current=water",
    ];
    refused("calibration", &water, Method::Tang, &["tracks the water", "bottom track"]);
}
