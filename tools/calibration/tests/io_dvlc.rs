//! IO-DVLC over many runs of Pan & Wu: the figures of docs/src/explanation/calibration.md.
//!
//! `NAVFUSE_RUNS=200 cargo test -p navfuse-calibration --test io_dvlc -- --nocapture` prints them.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod common;

use common::{data, seeds};
use navfuse_calibration::{CalibrationData, Estimate, Method};
use navfuse_segments::{Kind, Segment};

/// Mean and standard deviation of the error of k (ppm), roll, pitch and yaw (deg), and the mean of
/// `e' P^-1 e`.
struct Spread {
    mean: [f64; 4],
    sd: [f64; 4],
    nees: f64,
}

const UNIT: [f64; 4] =
    [1e6, 180.0 / std::f64::consts::PI, 180.0 / std::f64::consts::PI, 180.0 / std::f64::consts::PI];

fn runs() -> u64 {
    std::env::var("NAVFUSE_RUNS").ok().and_then(|n| n.parse().ok()).unwrap_or(24)
}

/// Replaces the segments by those of the paper's Table 1.
fn of_table_1(mut data: CalibrationData) -> CalibrationData {
    let segment = |kind, from, to| Segment { kind, from, to };
    data.segments = vec![
        segment(Kind::Static, 0.0, 600.0),
        segment(Kind::TypeI, 600.0, 660.0),
        segment(Kind::TypeI, 660.0, 720.0),
    ];
    data
}

fn one(method: Method, settings: &[&str]) -> (Estimate, [f64; 4]) {
    let data = data("pan-wu-3d", &[settings, &["estimator.stop=720 s"]].concat());
    let data = if method == Method::IoDvlcPrinted { of_table_1(data) } else { data };
    let estimate = method.estimate(&data).unwrap_or_else(|e| panic!("{e}"));
    let error = estimate.error(&data.velocity().unwrap().truth.unwrap());
    (estimate, error)
}

fn campaign(method: Method) -> Spread {
    let results = seeds(runs(), |seed| one(method, &[&format!("seed={seed}")]));
    let n = results.len() as f64;
    let mean = std::array::from_fn(|i| results.iter().map(|r| r.1[i] * UNIT[i]).sum::<f64>() / n);
    let sd = std::array::from_fn(|i| {
        (results.iter().map(|r| (r.1[i] * UNIT[i] - mean[i]).powi(2)).sum::<f64>() / (n - 1.0))
            .sqrt()
    });
    let nees = results.iter().map(|(e, error)| nees(e, error)).sum::<f64>() / n;
    println!(
        "{} {n} runs, k ppm, roll, pitch, yaw deg: mean {mean:.3?} sd {sd:.3?} NEES {nees:.2}",
        method.name()
    );
    Spread { mean, sd, nees }
}

/// Returns the NEES of k, roll, pitch and yaw. For angles this small the rotation vector is their
/// difference, with the sign of `C_d^b`.
fn nees(e: &Estimate, error: &[f64; 4]) -> f64 {
    let Some(p) = e.covariance else { return f64::NAN };
    // the true rotation is exp(δ) times the estimate; δ is minus the error of the angles, which
    // nalgebra defines about body axes
    let delta = nalgebra::Vector4::new(-error[0], -error[1], -error[2], -error[3]);
    delta.dot(&(p.try_inverse().unwrap() * delta))
}

/// Without noise, the error is that of the method. The term that the paper drops, 2 w_ie x v, is a
/// lateral velocity of 2 w_ie s after a distance of s: 1 to 2 cm/s at 5 m/s and at 1 m/s.
#[test]
fn without_noise_the_improved_estimate_is_the_truth_and_the_printed_one_is_not() {
    let quiet = ["sensor.imu.simulation.noise=0", "sensor.dvl.simulation.noise=0"];
    let (_, improved) = one(Method::IoDvlc, &quiet);
    let (_, printed) = one(Method::IoDvlcPrinted, &quiet);
    let shown = |e: [f64; 4]| std::array::from_fn::<f64, 4, _>(|i| e[i] * UNIT[i]);
    let (improved, printed) = (shown(improved), shown(printed));
    println!("bias, k ppm, roll, pitch, yaw deg: improved {improved:.4?}, printed {printed:.4?}");
    // required: 0.05 deg; the transport rate, gravity's change with depth and the sample times
    // contribute less than a fifth
    assert!(
        improved[1..].iter().all(|a| a.abs() < 0.01) && improved[0].abs() < 50.0,
        "{improved:?}"
    );
    assert!(printed[1..].iter().any(|a| a.abs() > 0.05), "the dropped term is seen: {printed:?}");
}

/// The bound on the mean is the required 0.05 deg plus three standard errors. A standard deviation
/// of n runs has a relative error of 1/sqrt(2 n); its bound is two of them above the figures of the
/// averaged and corrected observer at 5 m/s, 1 m/s and 10 Hz (826 ppm, roll 0.24, pitch 0.046, yaw
/// 0.053 deg). The mean of e' P^-1 e of 4 components and n runs is 4 with sigma sqrt(8 / n), which
/// it leaves by 3.3 sigma once in a thousand times.
#[test]
fn the_improved_estimate_is_unbiased_and_its_covariance_is_consistent() {
    let s = campaign(Method::IoDvlc);
    let n = runs() as f64;
    for i in 1..4 {
        assert!(
            s.mean[i].abs() < 0.05 + 3.0 * s.sd[i] / n.sqrt(),
            "component {i}: {:?} {:?}",
            s.mean,
            s.sd
        );
    }
    for (sd, known) in s.sd.into_iter().zip([826.0, 0.24, 0.046, 0.053]) {
        assert!(sd < known * (1.0 + 2.0 / (2.0 * n).sqrt()), "{sd} of {known}: {:?}", s.sd);
    }
    assert!((s.nees - 4.0).abs() < 3.3 * (8.0 / n).sqrt(), "mean NEES {} of 4", s.nees);
}

/// As printed, the anchor f(t_s) is one sample at 100 Hz with noise of 100 ug, which is 0.059 m/s
/// after 60 s. An independent program found standard deviations of 11200 ppm, roll 2.8, pitch 0.65,
/// yaw 0.66 deg at 5 m/s, 1 m/s and 10 Hz; 45 % are three standard errors of a standard deviation
/// of 24 runs.
#[test]
fn the_printed_estimate_is_as_scattered_as_its_anchors() {
    let s = campaign(Method::IoDvlcPrinted);
    for (i, known) in [11_200.0, 2.8, 0.65, 0.66].into_iter().enumerate() {
        assert!(
            (s.sd[i] / known - 1.0).abs() < 0.45,
            "component {i}: sd {:?}, known {known}",
            s.sd
        );
    }
}
