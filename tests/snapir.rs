//! Recorded runs of an AUV at sea; skipped without the recordings.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::{run_without_sinks, scenario, snapir};
use navfuse_core::run::summary::Summary;

const RUNS: [&str; 4] = ["T01", "T06", "T10", "T12"];

fn runs() -> Option<Vec<Summary>> {
    let folder = snapir()?;
    let run = |name: &str| {
        let setting = format!(
            "source.csv.directory={}",
            folder.join(name).canonicalize().expect("a run").display()
        );
        let finished = run_without_sinks(&scenario("snapir"), &[setting]);
        assert!(finished.error.is_none(), "{name}: {:?}", finished.error);
        finished.summary
    };
    Some(RUNS.into_iter().map(run).collect())
}

/// Dead reckoning with the uncalibrated DVL ends 3.29, 2.11, 2.20 and 2.53 m off; an independent
/// EKF 2.1 m on average, 3.3 m at worst. The bounds allow 10 % more.
#[test]
fn the_track_ends_as_near_the_reference_as_an_independent_filters() {
    let Some(summaries) = runs() else { return };
    let errors: Vec<f64> = summaries
        .iter()
        .map(|s| s.horizontal_error_m.expect("the recording has a reference").last)
        .collect();
    println!("final horizontal errors {errors:.2?} m");
    assert!(errors.iter().sum::<f64>() / 4.0 < 2.3, "{errors:?}");
    assert!(errors.iter().all(|e| *e < 3.6), "{errors:?}");
}

/// The noise in the scenario is that of the data if the mean NIS of three channels is 3; one noise
/// for four dives gives 2 to 4.
#[test]
fn the_innovations_confirm_the_noise_in_the_scenario() {
    let Some(summaries) = runs() else { return };
    for (name, summary) in RUNS.iter().zip(&summaries) {
        let nis = summary.samples["dvl"]["mean_nis"].as_f64().expect("the DVL was used");
        assert!((2.0..4.0).contains(&nis), "{name}: mean NIS {nis}");
        assert!(summary.samples["dvl"]["accepted"].as_u64() > Some(390), "{name}");
    }
}

/// The instrument is the same in all four dives. A dive that determines the scale factor and the
/// yaw misalignment to better than half of their priors agrees with the mean of the others within 4
/// sigma. The reference is no truth, so the dives are compared with each other.
#[test]
fn dives_that_determine_the_dvl_agree() {
    let Some(summaries) = runs() else { return };
    for (state, component, prior) in [("dvl.scale", 0, 0.002), ("dvl.misalignment", 2, 0.3)] {
        let known: Vec<(f64, f64)> = (summaries.iter())
            .map(|s| s.rows.iter().find(|r| r.name == state).expect("it is estimated"))
            .map(|r| (r.estimate[component], r.sigma[component]))
            .filter(|(_, sigma)| *sigma < 0.5 * prior)
            .collect();
        assert!(known.len() >= 3, "{state}: {known:?}");
        let mean = known.iter().map(|t| t.0).sum::<f64>() / known.len() as f64;
        for (estimate, sigma) in &known {
            assert!((estimate - mean).abs() < 4.0 * sigma, "{state}: {known:?}");
        }
    }
}
