//! IO-DVLC over many runs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::{data, seeds};
use navfuse_calibration::{Estimate, Method};

struct Spread {
    /// Mean and standard deviation of the error of k, roll, pitch, yaw, in 1 and deg.
    mean: [f64; 4],
    sd: [f64; 4],
    /// Mean square of error over sigma.
    consistency: [f64; 4],
}

fn spread(results: &[(Estimate, [f64; 4])]) -> Spread {
    let n = results.len() as f64;
    let unit = [1.0, 1_f64.to_degrees(), 1_f64.to_degrees(), 1_f64.to_degrees()];
    let mean = std::array::from_fn(|i| results.iter().map(|r| r.1[i] * unit[i]).sum::<f64>() / n);
    let sd = std::array::from_fn(|i| {
        (results.iter().map(|r| (r.1[i] * unit[i] - mean[i]).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
    });
    let consistency = std::array::from_fn(|i| {
        results.iter().map(|r| (r.1[i] / r.0.sigma().map_or(f64::NAN, |s| s[i])).powi(2)).sum::<f64>() / n
    });
    Spread { mean, sd, consistency }
}

fn campaign(method: Method, runs: u64, settings: &[&str]) -> Spread {
    let results = seeds(runs, |seed| {
        let seed = format!("seed={seed}");
        let data = data("pan-wu-3d", &[settings, &["estimator.stop=720 s", &seed]].concat());
        let estimate = method.estimate(&data).unwrap_or_else(|e| panic!("{e}"));
        let error = estimate.error(&data.velocity().unwrap().truth.unwrap());
        (estimate, error)
    });
    let s = spread(&results);
    println!(
        "{} {runs} runs: mean k {:.0} ppm, roll {:.3} pitch {:.3} yaw {:.3} deg; sd k {:.0} ppm, roll {:.3} pitch {:.3} yaw {:.3} deg; NEES {:.2?}",
        method.name(),
        1e6 * s.mean[0],
        s.mean[1],
        s.mean[2],
        s.mean[3],
        1e6 * s.sd[0],
        s.sd[1],
        s.sd[2],
        s.sd[3],
        s.consistency
    );
    let e = &results[0].0;
    println!("{:?} {:?}", e.sigma(), e.notes);
    s
}

fn runs() -> u64 {
    std::env::var("NAVFUSE_RUNS").ok().and_then(|n| n.parse().ok()).unwrap_or(16)
}

#[test]
fn improved() {
    campaign(Method::IoDvlc, runs(), &[]);
}

#[test]
fn printed() {
    campaign(Method::IoDvlcPrinted, runs(), &[]);
}
