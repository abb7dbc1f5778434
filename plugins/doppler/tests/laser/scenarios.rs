//! The scenarios of the laser are consistent.

use navfuse_campaign::{Campaign, Folder, Options, Verdict, execute};
use navfuse_core::document::Document;
use std::sync::atomic::AtomicBool;

/// 20 runs, all initial errors and truths drawn.
fn verdict(file: &str, settings: &[&str]) -> Verdict {
    let registry = crate::common::registry();
    let path = format!("{}/../../scenarios/{file}", env!("CARGO_MANIFEST_DIR"));
    let mut document = Document::from_file(path).unwrap_or_else(|e| panic!("{e}"));
    settings.iter().for_each(|s| document.set(s).unwrap_or_else(|e| panic!("{e}")));
    let options = Options { runs: 20, ..Options::default() };
    let plan = Campaign::new(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
    let mut folder = Folder::create(None, &plan, None).expect("no folder");
    let stop = AtomicBool::new(false);
    let done =
        execute(&plan, &registry, &document, (None, 2), &stop, |_| {}, |record| folder.add(record));
    let results =
        folder.finish(done.unwrap_or_else(|e| panic!("{e}"))).expect("nothing is written");
    let report = results.map(|r| r.report).expect("the whole campaign");
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
