//! The topics for those who look at a log.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::{Logged, fixture, number, read};
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{Epoch, Record, Truth};
use navfuse_core::model::stream::Sink;
use navfuse_core::units::time::Time;
use navfuse_mcap::Compression;
use serde_json::{Value, json};

/// Two epochs a second for 40 s, each a metre further north; the truth is half a metre behind.
fn logged() -> Vec<Logged> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sink = fixture::create(&path, Compression::Zstd);
    let (layout, covariance) = (fixture::layout(), fixture::covariance());
    for k in 0..=80 {
        let (time, north) = (Time::from_nanos(k * 500_000_000), k as f64);
        let state = fixture::state(&layout, time, north);
        let (truth, known) = (fixture::state(&layout, time, north - 0.5), [true; 5]);
        let truth = Some(Truth { state: &truth, known: &known });
        let epoch = Epoch { layout: &layout, state: &state, covariance: &covariance, truth };
        sink.take(&Record::Epoch(&epoch)).unwrap();
    }
    sink.take(&Record::Verdict(&Verdict::new(Vec::new(), Vec::new()))).unwrap();
    sink.finish().unwrap();
    read(&path)
}

fn of<'l>(log: &'l [Logged], topic: &str) -> Vec<&'l Logged> {
    log.iter().filter(|m| m.topic == topic).collect()
}

fn north(pose: &Value) -> f64 {
    number(&pose["position"]["x"])
}

/// A path is written after 10 s, and then each time the run is 10 s and a quarter longer: at 10, 20, 30
/// and 40 s.
#[test]
fn paths_grow_from_the_first_position_and_each_message_has_all_of_it() {
    let log = logged();
    for (topic, behind) in [("/estimate/path", 0.0), ("/reference/path", 0.5)] {
        let paths = of(&log, topic);
        let times: Vec<u64> = paths.iter().map(|m| m.log_time / 1_000_000_000).collect();
        assert_eq!(times, [10, 20, 30, 40], "{topic}");
        for (path, poses) in paths.iter().zip([21, 41, 61, 81]) {
            assert_eq!(path.schema, "nav_msgs/msg/Path");
            let all = path.fields["poses"].as_array().unwrap();
            assert_eq!(all.len(), poses, "{topic}");
            for (k, pose) in all.iter().enumerate() {
                // an ulp of a latitude of 0.6 rad is 1.1e-16 rad, times 6.4e6 m
                let off = north(&pose["pose"]) - (k as f64 - behind);
                assert!(off.abs() < 3e-9, "{topic} {k}: {off}");
            }
            assert_eq!(all[0]["header"]["frame_id"], "s:ned");
            assert_eq!(all[1]["header"]["stamp"], json!({ "sec": 0, "nanosec": 500_000_000 }));
        }
    }
}

#[test]
fn the_reference_has_a_frame_of_its_own_and_the_ellipsoid_three_sigmas() {
    let log = logged();
    let reference = of(&log, "/reference/odometry");
    assert_eq!(reference.len(), 41, "one a second");
    assert_eq!(reference[40].fields["child_frame_id"], "s:reference_frd");
    assert!((north(&reference[40].fields["pose"]["pose"]) - 79.5).abs() < 3e-9);
    let markers = of(&log, "/estimate/markers");
    assert_eq!(markers.len(), 41, "one a second");
    let marker = &markers[40].fields["markers"][0];
    assert_eq!((&marker["header"]["frame_id"], &marker["type"]), (&json!("s:ned"), &json!(2)));
    assert!((north(&marker["pose"]) - 80.0).abs() < 3e-9);
    // the sum of the squared diameters is 36 times the trace of the covariance
    let covariance = fixture::covariance();
    let trace: f64 = (6..9).map(|k| covariance.get(k, k)).sum();
    let squares: f64 = ["x", "y", "z"].map(|k| number(&marker["scale"][k]).powi(2)).iter().sum();
    assert!((squares / (36.0 * trace) - 1.0).abs() < 1e-12, "{squares} {trace}");
}

#[test]
fn the_verdict_is_the_last_message() {
    let log = logged();
    let last = log.last().unwrap();
    assert_eq!((last.topic.as_str(), last.log_time), ("/verdict", 40_000_000_000));
    assert_eq!(last.fields["level"], "s:consistent");
}
