//! The smoother on whole compositions, and `navfuse smooth`.

use crate::common::{navfuse, scenario, snapir, stderr, stdout};
use navfuse_core::document::Document;
use navfuse_core::model::record::{Epoch, Event, Record};
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::nalgebra::DVector;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::{Layout, State};
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
    let (worst, spread) = records.differences(records.rts());
    // the textbook inverts a covariance at every step, and has most of the rounding
    assert!(worst < 1e-6 && spread < 1e-6, "{worst} {spread}");
}

#[test]
fn an_ins_that_is_smoothed_with_a_lag_is_that_of_the_samples_within_the_lag() {
    let settings = [&CALIBRATES[..], &["estimator.lag=\"5 s\""]].concat();
    is_that_of_the_samples_within_5_s(&records("quickstart", &settings));
}

/// The samples of the search are taken once more, one by one: estimates within the alignment are
/// given as soon as they are complete, not all at its end.
#[test]
fn an_alignment_that_is_smoothed_with_a_lag_is_that_of_the_samples_within_the_lag() {
    let settings = [
        "estimator.stop=\"60 s\"",
        "estimator.lag=\"5 s\"",
        "sensor.imu.simulation.rate=\"20 Hz\"",
        "process.ins.alignment.coarse_duration=\"40 s\"",
        "process.ins.alignment.duration=\"50 s\"",
        "process.ins.alignment.heading_gate=\"5 deg\"",
    ];
    is_that_of_the_samples_within_5_s(&records("alignment-static", &settings));
}

fn is_that_of_the_samples_within_5_s(records: &Records) {
    let times: Vec<f64> = records.filtered.iter().map(|e| e.state.time.seconds()).collect();
    let complete = |t: &f64| {
        let ahead = times.iter().position(|later| later - t > 5.0 - 1e-6);
        ahead.map_or(records.steps.len(), |k| records.filtered[k].after)
    };
    let ends: Vec<usize> = times.iter().map(complete).collect();
    let given: Vec<usize> = records.smoothed.iter().map(|e| e.after).collect();
    assert_eq!(given, ends, "each is given while the run goes on, as soon as it is complete");
    let (worst, spread) = records.differences(records.rts_until(&ends));
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

/// Mean over some time of the normalised error squared of the velocity.
fn nees_of_the_velocity(records: &Records, from: f64, to: f64) -> f64 {
    let layout = &records.layout;
    let (known, mut error) = (vec![true; layout.blocks.len()], vec![0.0; layout.tangent]);
    let velocity = layout.find("ins.velocity").expect("an INS").tangent_range();
    let inside = records.smoothed.iter().filter(|e| (from..=to).contains(&e.state.time.seconds()));
    let nees = inside.filter_map(|e| {
        layout.error(e.truth.as_ref()?, &e.state, &known, &mut error);
        let error = DVector::from_column_slice(&error[velocity.clone()]);
        let p = e.covariance.view((velocity.start, velocity.start), (3, 3)).into_owned();
        Some(error.dot(&p.cholesky()?.solve(&error)))
    });
    let nees: Vec<f64> = nees.collect();
    nees.iter().sum::<f64>() / nees.len() as f64
}

/// A DVL that shows 20 % too little speed, turned by 5 deg, late by 50 ms, and a heading that is
/// known to 30 deg: the filter linearises far from the truth for the first minute, and keeps what
/// it concludes there.
const FAR: [&str; 8] = [
    "estimator.stop=\"700 s\"",
    "sensor.imu.simulation.rate=\"20 Hz\"",
    "sensor.reference.simulation.rate=\"1 Hz\"",
    "estimator.output_rate=\"1 Hz\"",
    "sensor.dvl.scale={ sigma = \"20 %\", truth = 0.8 }",
    "sensor.dvl.misalignment={ sigma = \"5 deg\", truth = [\"3 deg\", \"-4 deg\", \"5 deg\"] }",
    "sensor.dvl.time_offset={ sigma = \"100 ms\", truth = \"50 ms\" }",
    "process.ins.attitude={ sigma = [\"0.1 deg\", \"0.1 deg\", \"30 deg\"] }",
];

/// The mean of 3 degrees of freedom over two runs, with the errors of the first minute as one draw
/// each, exceeds 8.4 with a probability of 1 % (chi-square with 6 degrees of freedom, 16.8).
#[test]
fn further_passes_repair_a_run_that_began_far_from_the_truth() {
    let of = |passes: &str| {
        let nees = ["seed=1000000", "seed=1000001"].map(|seed| {
            let records = records("calibration", &[&FAR[..], &[seed, passes]].concat());
            nees_of_the_velocity(&records, 300.0, 360.0)
        });
        println!("{passes}: NEES of the velocity {nees:.2?}");
        0.5 * nees.iter().sum::<f64>()
    };
    let (one, more) = (of("estimator.passes=1"), of("estimator.passes=8"));
    assert!(one > 8.4 && more < 8.4, "{one} {more}");
}

#[test]
fn the_command_reports_the_passes() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |passes: &str| {
        let set = ["--set", "estimator.stop=100 s", "--passes", passes];
        json(&smooth(&scenario("quickstart"), &folder.path().join(passes), &set))
    };
    let passes = of("8")["smoothing"]["passes"].clone();
    assert_eq!(passes["converged"], true, "{passes}");
    let count = passes["count"].as_u64().expect("a number");
    assert!((2..=7).contains(&count), "{passes}");
    let changes: Vec<f64> = serde_json::from_value(passes["changes"].clone()).expect("numbers");
    assert!(changes.len() as u64 == count - 1 && changes.last().is_some_and(|c| *c <= 1e-3));
    // at most as many as given
    if changes[0] > 1e-3 {
        let passes = of("2")["smoothing"]["passes"].clone();
        assert_eq!((&passes["count"], &passes["converged"]), (&2.into(), &false.into()));
        assert!(passes["text"].as_str().is_some_and(|t| t.contains("not converged after 2")));
    }
    assert!(of("1")["smoothing"]["passes"].is_null());
}

#[test]
fn the_log_of_another_version_is_smoothed_with_a_warning_that_names_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole");
    json(&smooth(&scenario("quickstart"), &whole, &["--set", "estimator.stop=65 s"]));
    let log = std::fs::read(whole.join("run.mcap")).expect("a log");
    let own = env!("CARGO_PKG_VERSION").as_bytes();
    let other = vec![b'9'; own.len()];
    let mut changed = log.clone();
    let at: Vec<usize> =
        (0..log.len() - own.len()).filter(|at| log[*at..].starts_with(own)).collect();
    assert!(!at.is_empty());
    at.iter().for_each(|at| changed[*at..][..own.len()].copy_from_slice(&other));
    let path = folder.path().join("other.mcap");
    std::fs::write(&path, &changed).expect("the test can write");
    let output = smooth(&path, &folder.path().join("again"), &[]);
    let (text, other) = (stderr(&output), String::from_utf8_lossy(&other).into_owned());
    assert!(text.contains(&other) && text.contains("another version"), "{text}");
    json(&output);
    assert_eq!(std::fs::read(&path).expect("the log"), changed, "it is as it was");
    let output = smooth(&whole.join("run.mcap"), &folder.path().join("own"), &[]);
    assert!(!stderr(&output).contains("another version"), "{}", stderr(&output));
}

/// Keeps the last estimate and the texts of the events.
#[derive(Default)]
struct Last(Option<(State, Covariance)>, Vec<String>);

impl Sink for Last {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Event(event) => self.event(event),
            Record::Finding(finding) => self.event(&finding.event()),
            _ => Ok(()),
        }
    }
}

impl Last {
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.0 = Some((epoch.state.clone(), epoch.covariance.clone()));
        Ok(())
    }
    fn event(&mut self, event: &Event) -> Result<(), StreamError> {
        self.1.push(event.text.clone());
        Ok(())
    }
}

/// Last estimate of a run, and the texts of its events.
fn last(name: &str, settings: &[&str]) -> (Layout, State, Covariance, Vec<String>) {
    let document = Document::from_file(scenario(name)).unwrap_or_else(|e| panic!("{e}"));
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let registry = navfuse::standard_plugins();
    let scenario = Scenario::new(&registry, document, &settings);
    let scenario = scenario.unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let layout = (*assembly.composition.layout).clone();
    assembly.sinks.push(("last".into(), Box::<Last>::default()));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let Last(estimate, events) = finished.take_sink().expect("the sink is there");
    let (state, covariance) = estimate.expect("an estimate");
    (layout, state, covariance, events)
}

/// The last estimate of a smoothed run has used every sample once, as that of a filter has. A pass
/// ends within 0.001 sigma of its limit, and the filter makes one more. Both end between samples of
/// the DVL, which the filter would linearise at its own estimate.
#[test]
fn a_filter_that_linearises_its_samples_again_ends_where_the_passes_end() {
    let of = |more: &[&str]| last("calibration", &[&FAR[..], &["seed=1000000"], more].concat());
    let stop = "estimator.stop=\"359.96 s\"";
    let (layout, passes, p, _) = of(&[stop, "estimator.passes=12"]);
    let (_, plain, _, _) = of(&[stop]);
    let (_, again, found, events) = of(&[stop, "estimator.relinearise=\"59.9 s\""]);
    let known = vec![true; layout.blocks.len()];
    let mut error = vec![0.0; layout.tangent];
    let mut sigmas = |state: &State| {
        layout.error(&passes, state, &known, &mut error);
        (0..layout.tangent).map(|i| error[i].abs() / p.get(i, i).sqrt()).fold(0.0, f64::max)
    };
    let (near, far) = (sigmas(&again), sigmas(&plain));
    println!("{near:.2e} sigma from the passes, and without them {far:.2}");
    assert_eq!(passes.time, again.time);
    assert!(near < 1e-3 && far > 0.5, "{near} {far}");
    for i in 0..layout.tangent {
        let ratio = found.get(i, i) / p.get(i, i);
        assert!((ratio - 1.0).abs() < 1e-3, "{i}: {ratio}");
    }
    let made = events.iter().filter(|e| e.contains("again: converged after"));
    assert_eq!(made.count(), 1, "{events:?}");
}

/// Nothing in this run observes a rotation of the DVL about the velocity, so its prior of 5 deg
/// stays. A filter that linearises each sample once ends below 4 deg.
#[test]
fn samples_that_are_linearised_again_do_not_inform_about_what_nothing_observes() {
    let roll = |more: &[&str]| {
        let settings = [
            "estimator.stop=\"400 s\"",
            "sensor.imu.simulation.rate=\"20 Hz\"",
            "sensor.dvl.misalignment.sigma=\"5 deg\"",
            "sensor.reference.simulation.rate=\"1 Hz\"",
        ];
        let (layout, _, p, _) = last("alignment-in-motion", &[&settings[..], more].concat());
        let roll = layout.find("dvl.misalignment").expect("a DVL").tangent_range().start;
        p.get(roll, roll).sqrt().to_degrees()
    };
    let (plain, again) = (roll(&[]), roll(&["estimator.relinearise=\"240 s\""]));
    println!("sigma of the roll: {plain:.2} deg, and linearised again {again:.2} deg");
    assert!(plain < 4.0 && (4.7..=5.0).contains(&again), "{plain} {again}");
}

/// 5 s of `quickstart` from its start on.
const SHORT: [&str; 2] = ["estimator.stop=\"65 s\"", "sensor.imu.simulation.rate=\"10 Hz\""];

#[test]
fn where_no_sample_is_linearised_again_the_run_goes_on_without_and_says_so() {
    let again = "estimator.relinearise=\"4 s\"";
    for (more, words) in [
        ("estimator.type=\"ukf\"", "type = \"ukf\", but with type = \"ekf\""),
        ("estimator.smooth=true", "smoothed run; `passes` linearises all"),
        ("estimator.lag=\"1 s\"", "smoothed run; `passes` linearises all"),
        ("estimator.passes=3", "smoothed run; `passes` linearises all"),
    ] {
        let plain = last("quickstart", &[&SHORT[..], &[more]].concat());
        let set = last("quickstart", &[&SHORT[..], &[more, again]].concat());
        assert_eq!((plain.1, plain.2), (set.1, set.2), "{more}");
        let notes: Vec<&String> = set.3.iter().filter(|e| e.contains("`relinearise`")).collect();
        assert!(notes.len() == 1 && notes[0].contains(words), "{notes:?}");
    }
}

#[test]
fn a_span_of_zero_linearises_no_sample_again() {
    let off = last("quickstart", &[&SHORT[..], &["estimator.relinearise=\"0 s\""]].concat());
    let plain = last("quickstart", &SHORT);
    assert_eq!((off.1, off.2, off.3), (plain.1, plain.2, plain.3));
}

/// Samples that may be late are settled in their order, and then linearised again.
#[test]
fn samples_that_may_be_late_are_linearised_again() {
    let settings = [&SHORT[..], &["estimator.relinearise=\"4 s\""]].concat();
    let in_order = last("quickstart", &settings);
    let late = last("quickstart", &[&settings[..], &["sensor.dvl.late=\"1 s\""]].concat());
    assert_eq!((&in_order.1, &in_order.2), (&late.1, &late.2));
    assert!(late.3.iter().any(|e| e.contains("again: converged after")), "{:?}", late.3);
    assert_ne!(last("quickstart", &SHORT).2, late.2);
}
