//! The smoother on whole compositions, and `navfuse smooth`.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::{navfuse, scenario, snapir, stderr, stdout};
use navfuse_core::document::Document;
use navfuse_core::nalgebra::{DMatrix, DVector};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::Layout;
use navfuse_testing::rts::{Estimate, Records};
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use std::sync::atomic::AtomicBool;

/// Steps, estimates and smoothed estimates of a shipped scenario.
fn records(name: &str, settings: &[&str]) -> Records {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(scenario(name)).unwrap_or_else(|e| panic!("{e}"));
    let mut settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    settings.push("estimator.smooth=true".to_owned());
    let scenario = Scenario::new(&registry, document, &settings).unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("records".into(), Box::<Records>::default()));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    finished.take_sink().expect("the sink is there")
}

/// The covariance of the error about the smoothed estimate, from that about the filter's.
fn about_the_smoothed(
    layout: &Layout,
    p: &DMatrix<f64>,
    moved: &DVector<f64>,
    from: &Estimate,
    to: &Estimate,
) -> DMatrix<f64> {
    let n = layout.tangent;
    let mut delta = moved.as_slice().to_vec();
    // the reset takes the change of the velocity itself
    let velocity = layout.find("ins.velocity").expect("an INS");
    for (row, at) in velocity.tangent_range().zip(velocity.range()) {
        delta[row] = to.state.values[at] - from.state.values[at];
    }
    let mut reset = vec![0.0; n * n];
    (0..n).for_each(|i| reset[i * n + i] = 1.0);
    layout.reset_rows(&delta, &mut reset, n);
    let reset = DMatrix::from_row_slice(n, n, &reset);
    &reset * p * reset.transpose()
}

/// Largest difference of the smoothed estimates from those of the textbook, in sigma, and of their
/// covariances, relative to the variances.
fn differences(records: &Records, textbook: Vec<(DVector<f64>, DMatrix<f64>)>) -> (f64, f64) {
    let layout = &records.layout;
    let n = layout.tangent;
    let known = vec![true; layout.blocks.len()];
    assert!(records.filtered.len() >= 40 && records.filtered.len() == records.smoothed.len());
    let (mut worst, mut spread) = (0.0_f64, 0.0_f64);
    let pairs = records.filtered.iter().zip(&records.smoothed).zip(textbook);
    for ((filtered, smoothed), (moved, p)) in pairs {
        let mut change = vec![0.0; n];
        layout.error(&smoothed.state, &filtered.state, &known, &mut change);
        let expected = about_the_smoothed(layout, &p, &moved, filtered, smoothed);
        for i in 0..n {
            worst = worst.max((change[i] - moved[i]).abs() / p[(i, i)].sqrt());
            for j in 0..n {
                let scale = (expected[(i, i)] * expected[(j, j)]).sqrt();
                let difference = smoothed.covariance[(i, j)] - expected[(i, j)];
                spread = spread.max(difference.abs() / scale);
            }
        }
    }
    println!("largest difference {worst:.1e} sigma, of the covariance {spread:.1e}");
    (worst, spread)
}

/// 40 s of an INS that calibrates its DVL, whose lag is a state: attitudes, resets, time offsets.
const CALIBRATES: [&str; 6] = [
    "estimator.stop=\"100 s\"",
    "sensor.imu.simulation.rate=\"20 Hz\"",
    "sensor.reference.simulation.rate=\"1 Hz\"",
    "estimator.output_rate=\"1 Hz\"",
    "sensor.dvl.time_offset={ sigma = \"100 ms\", truth = \"50 ms\" }",
    "process.ins.attitude={ sigma = \"3 deg\" }",
];

#[test]
fn a_smoothed_ins_is_that_of_rauch_tung_and_striebel() {
    let records = records("quickstart", &CALIBRATES);
    let (worst, spread) = differences(&records, records.rts());
    // the textbook inverts a covariance at every step, and has most of the rounding
    assert!(worst < 1e-6 && spread < 1e-6, "{worst} {spread}");
}

#[test]
fn an_ins_that_is_smoothed_with_a_lag_is_that_of_the_samples_within_the_lag() {
    let records = records("quickstart", &[&CALIBRATES[..], &["estimator.lag=\"5 s\""]].concat());
    let times: Vec<f64> = records.filtered.iter().map(|e| e.state.time.seconds()).collect();
    let complete = |t: &f64| {
        let ahead = times.iter().position(|later| later - t > 5.0 - 1e-6);
        ahead.map_or(records.steps.len(), |k| records.filtered[k].after)
    };
    let ends: Vec<usize> = times.iter().map(complete).collect();
    let given: Vec<usize> = records.smoothed.iter().map(|e| e.after).collect();
    assert_eq!(given, ends, "each is given while the run goes on, as soon as it is complete");
    let (worst, spread) = differences(&records, records.rts_until(&ends));
    assert!(worst < 1e-6 && spread < 1e-6, "{worst} {spread}");
}

/// Horizontal errors against the reference between two times, m.
fn errors(layout: &Layout, estimates: &[Estimate], from: f64, to: f64) -> Vec<f64> {
    let position = layout.find("ins.position").expect("an INS");
    let inside = estimates.iter().filter(|e| (from..=to).contains(&e.state.time.seconds()));
    inside
        .filter_map(|e| {
            let truth = &e.truth.as_ref()?.values[position.range()];
            let mut error = [0.0; 3];
            (position.operations.local)(truth, &e.state.values[position.range()], &mut error);
            Some(error[0].hypot(error[1]))
        })
        .collect()
}

/// Four dives with the DVL cut out for 50 s. The reference shares the sensors and is trusted to 1
/// to 3 m, more than this IMU drifts in 50 s. The smoothed track must still be nearer to it on
/// average.
#[test]
fn a_smoothed_dive_bridges_an_outage_of_the_dvl() {
    let Some(folder) = snapir() else { return };
    let (mut filter, mut smoother) = (0.0, 0.0);
    for dive in ["T01", "T06", "T10", "T12"] {
        let directory = folder.join(dive).canonicalize().expect("a dive");
        let directory = format!("source.csv.directory={}", directory.display());
        let records =
            records("snapir", &[&directory, "sensor.dvl.exclude=[[\"200 s\", \"250 s\"]]"]);
        let of = |estimates: &[Estimate]| {
            let outage = errors(&records.layout, estimates, 200.0, 250.0);
            let largest = outage.iter().fold(0.0_f64, |most, e| most.max(*e));
            (*outage.last().expect("the reference is there"), largest)
        };
        let (filtered, smoothed) = (of(&records.filtered), of(&records.smoothed));
        println!(
            "{dive}: error at the end of the outage and largest: filter {filtered:.2?} m, \
             smoothed {smoothed:.2?} m"
        );
        filter += filtered.1 / 4.0;
        smoother += smoothed.1 / 4.0;
    }
    println!("mean of the largest errors {filter:.2} m, smoothed {smoother:.2} m");
    assert!(smoother < filter, "{filter} {smoother}");
}

fn smooth(of: &Path, out: &Path, more: &[&str]) -> Output {
    let of = of.to_str().expect("a path");
    let out = out.to_str().expect("a path");
    navfuse(&[&["smooth", of, "--format=json", "--out", out], more].concat())
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", stderr(output));
    serde_json::from_str(&stdout(output)).expect("standard output is one JSON object")
}

#[test]
fn the_log_of_a_smoothed_run_smooths_again_to_the_same_result() {
    let folder = tempfile::tempdir().expect("a folder");
    let (first, again) = (folder.path().join("first"), folder.path().join("again"));
    let set = ["--set", "estimator.stop=100 s"];
    let one = json(&smooth(&scenario("quickstart"), &first, &set));
    let rms = |value: &Value, key: &str| value[key]["rms"].as_f64().expect("a reference");
    let (smoothed, filtered) =
        (rms(&one, "horizontal_error_m"), rms(&one, "filtered_horizontal_error_m"));
    assert!(smoothed > 0.0 && smoothed != filtered, "{smoothed} {filtered}");
    let two = json(&smooth(&first.join("run.mcap"), &again, &[]));
    assert_eq!(one["horizontal_error_m"], two["horizontal_error_m"]);
    assert_eq!(one["states"], two["states"]);
    assert!(first.join("run.mcap").is_file() && again.join("run.mcap").is_file());
}

#[test]
fn a_log_that_was_cut_off_is_smoothed_up_to_there_and_what_is_none_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("whole");
    json(&smooth(&scenario("quickstart"), &out, &["--set", "estimator.stop=100 s"]));
    let bytes = std::fs::read(out.join("run.mcap")).expect("a log");
    let cut = folder.path().join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).expect("the test can write");
    let output = smooth(&cut, &folder.path().join("cut"), &[]);
    assert!(stderr(&output).contains("cut off"), "{}", stderr(&output));
    let short = json(&output);
    let duration = short["duration_s"].as_f64().expect("a duration");
    assert!(duration > 5.0 && duration < 40.0, "{duration}");
    // a run that never starts leaves an error, and no estimates
    let output = smooth(
        &scenario("quickstart"),
        &folder.path().join("never"),
        &["--set", "estimator.start=1 h"],
    );
    assert!(!output.status.success());
    assert!(stderr(&output).contains("never started"), "{}", stderr(&output));
}
