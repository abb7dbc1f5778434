//! The scenario land-odometer as it is in the repository: its drift, and what it finds of the
//! odometer.
#![allow(clippy::expect_used, clippy::panic, missing_docs, reason = "a test fails by panicking")]

use navfuse_campaign::{Options, report};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_testing::{document, registry};
use std::sync::atomic::AtomicBool;

#[test]
fn scale_angles_and_lever_arm_converge_and_the_position_drifts_by_less_than_a_tenth_of_a_percent() {
    let registry = registry();
    let scenario = Scenario::new(&registry, document("land-odometer.toml"), &[])
        .unwrap_or_else(|e| panic!("{e}"));
    let assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let row = |name: &str| {
        let rows = &finished.summary.rows;
        let row = rows.iter().find(|r| r.name == name).unwrap_or_else(|| panic!("no state {name}"));
        let error = row.error.clone().unwrap_or_else(|| panic!("{name} has no truth"));
        println!("{name}: error {error:.5?}, sigma {:.5?}", row.sigma);
        for (e, s) in error.iter().zip(&row.sigma) {
            assert!((e / s).abs() < 4.0, "{name}: {e} of sigma {s}");
        }
        (error, row.sigma.clone())
    };
    let (error, sigma) = row("ins.position");
    let share = 1e-3 * finished.summary.distance_m;
    assert!(share > 17.0, "17 km");
    assert!(
        error[0].hypot(error[1]) < share && sigma[0].hypot(sigma[1]) < share,
        "{error:?} {sigma:?}"
    );
    // a hundredth of the priors of 2 % and 2 deg, a tenth of 0.3 m; how low the wheel is only a
    // change of slope tells
    assert!(row("odometer.scale").1[0] < 2e-4);
    assert!(row("odometer.pitch").1[0] < 0.02 && row("odometer.yaw").1[0] < 0.02);
    let (_, arm) = row("odometer.lever_arm");
    assert!(arm[0] < 0.03 && arm[1] < 0.03 && arm[2] < 0.2, "{arm:?}");
    row("ins.attitude");
}

#[test]
fn twenty_runs_are_consistent() {
    let (registry, document) = (registry(), document("land-odometer.toml"));
    let options = Options { runs: 20, every: Some(20.0), ..Options::default() };
    let report = report(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
    let verdict = report.points[0].verdict.as_ref().expect("runs have a verdict");
    assert!(verdict.consistent, "{verdict:#?}");
}
