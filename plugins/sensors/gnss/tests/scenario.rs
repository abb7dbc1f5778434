//! The scenario surface-dive as it is in the repository: what is known of the position before, in
//! and after the dive.
#![allow(clippy::expect_used, clippy::panic, missing_docs, reason = "a test fails by panicking")]

use navfuse_campaign::{Options, report};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_testing::{document, registry};
use std::sync::atomic::AtomicBool;

/// Root mean square over runs of the horizontal error (m), and of its sigma, of a run until `stop`.
fn horizontal(stop: &str) -> (f64, f64) {
    let registry = registry();
    let runs = 1..=6;
    let (mut error, mut sigma) = (0.0, 0.0);
    for seed in runs.clone() {
        let settings =
            [format!("seed={seed}"), format!("estimator.stop={stop}"), "estimator.draw=all".into()];
        let scenario = Scenario::new(&registry, document("surface-dive.toml"), &settings)
            .unwrap_or_else(|e| panic!("{e}"));
        let assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
        let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
        assert!(finished.error.is_none(), "{:?}", finished.error);
        let row =
            finished.summary.rows.iter().find(|r| r.name == "ins.position").expect("a position");
        error += row.error.as_ref().expect("a reference")[..2].iter().map(|e| e * e).sum::<f64>();
        sigma += row.sigma[..2].iter().map(|s| s * s).sum::<f64>();
    }
    let n = runs.count() as f64;
    let found = ((error / n).sqrt(), (sigma / n).sqrt());
    println!("{stop}: horizontal error {:.2} m, sigma {:.2} m", found.0, found.1);
    found
}

#[test]
fn the_error_grows_in_the_dive_and_is_that_of_gnss_before_and_after() {
    let [before, deep, after] = ["319 s", "1079 s", "1199 s"].map(horizontal);
    // The bias, 1 m on each axis with a correlation time of 10 min, is all but the whole error
    // where there is GNSS: 1.4 m.
    assert!(before.1 < 1.5 && after.1 < 1.5, "{before:?} {after:?}");
    // 1.5 km of dive, with a heading that goes with gyros of 3 deg/h
    assert!(deep.1 > 2.0 * before.1, "{deep:?}");
    // Six runs of two axes, 12 squares: chi-square is below 32.9 with probability 0.999.
    for (error, sigma) in [before, deep, after] {
        assert!((error / sigma).powi(2) < 32.9 / 12.0, "{error} {sigma}");
    }
}

#[test]
fn twenty_runs_are_consistent() {
    let (registry, document) = (registry(), document("surface-dive.toml"));
    let options = Options { runs: 20, every: Some(20.0), ..Options::default() };
    let report = report(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
    let verdict = report.points[0].verdict.as_ref().expect("runs have a verdict");
    assert!(verdict.consistent, "{verdict:#?}");
}
