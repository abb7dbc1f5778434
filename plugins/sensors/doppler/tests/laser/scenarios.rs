//! The scenarios of the laser are consistent.

use navfuse_campaign::{Options, PointVerdict, report};
use navfuse_core::document::Document;

/// 20 runs, all initial errors and truths drawn.
fn verdict(file: &str, settings: &[&str]) -> PointVerdict {
    let registry = crate::common::registry();
    let path = format!("{}/../../../scenarios/{file}", env!("CARGO_MANIFEST_DIR"));
    let mut document = Document::from_file(path).unwrap_or_else(|e| panic!("{e}"));
    settings.iter().for_each(|s| document.set(s).unwrap_or_else(|e| panic!("{e}")));
    let options = Options { runs: 20, ..Options::default() };
    let report = report(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
    report.points.into_iter().next().expect("one point").verdict.expect("runs have a verdict")
}

#[test]
fn the_aircraft_is_consistent() {
    let verdict = verdict("laser-airborne.toml", &[]);
    assert!(verdict.consistent, "{verdict:#?}");
}

#[test]
fn the_car_is_consistent() {
    let verdict = verdict("laser-land.toml", &[]);
    assert!(verdict.consistent, "{verdict:#?}");
}

/// What it cannot see stays in the covariance.
#[test]
fn the_car_with_one_beam_is_consistent() {
    let verdict = verdict("laser-land.toml", &["sensor.laser-doppler.beams=[[1, 0, 1]]"]);
    assert!(verdict.consistent, "{verdict:#?}");
}
