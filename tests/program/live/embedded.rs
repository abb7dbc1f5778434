//! A live run inside a program, and its equality with the offline run.

use super::desk::{Desk, dive, warnings};
use crate::common::{navfuse, stdout};
use navfuse_core::document::Document;
use navfuse_core::run::runner::{self, pass_samples};
use navfuse_core::run::scenario::Scenario;
use navfuse_live::Live;
use serde_json::Value;
use std::sync::atomic::AtomicBool;

const STDIN: &str = "[link.stdin]\n";

#[test]
fn the_state_of_a_live_run_is_that_of_the_offline_run_and_its_log_replays_to_the_same_bits() {
    let desk = Desk::new(STDIN);
    let live = desk.pass(&dive().sentences, &["--speed", "inf"]);
    assert_eq!(live["states"], dive().states);
    assert_eq!(warnings(&live), "");
    let log = desk.path("live/run.mcap").display().to_string();
    let replay = navfuse(&["replay", &log, "--no-output", "--format", "json"]);
    let replay: Value = serde_json::from_str(&stdout(&replay)).unwrap();
    assert_eq!(replay["states"], live["states"]);
    assert_eq!(replay["verdict"], live["verdict"]);
    assert!(!desk.path("live/live.checkpoint").exists(), "the run has come to its end");
}

#[test]
fn the_scenarios_of_the_pages_on_the_bluerov2_and_on_ros_2_compose() {
    for page in [
        include_str!("../../../docs/src/how-to/bluerov2.md"),
        include_str!("../../../docs/src/tutorials/ros2-odometry.md"),
    ] {
        let scenario =
            page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        let registry = navfuse::standard_plugins();
        let document = Document::parse("page.toml".to_owned(), scenario.to_owned()).unwrap();
        let scenario = Scenario::new(&registry, document, &[]).unwrap();
        assert!(scenario.compose().unwrap().sensor("dvl").is_some());
        // links and sinks fit the sensors: a program without ROS 2 stops at its network alone
        let opened = scenario.assemble_live(None).map(drop);
        let reason = opened.err().map_or_else(String::new, |error| error.to_string());
        assert!(reason.is_empty() || reason.contains("built without ROS 2"), "{reason}");
    }
}

#[test]
fn a_program_pushes_samples_and_the_newest_estimate_is_that_of_the_offline_run() {
    let registry = navfuse::standard_plugins();
    let desk = Desk::new("");
    let document = Document::from_file(desk.path("desk.toml")).unwrap();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    let offline = runner::run(scenario.assemble(None).unwrap(), &AtomicBool::new(false), |_| {});

    let live = Live::new(&scenario).unwrap();
    assert!(live.newest().is_none() && live.is_running());
    pass_samples(scenario.assemble(None).unwrap(), |sample| {
        let values: Vec<f64> = (0..16).map_while(|k| sample.get(k)).collect();
        // the queue is bounded: a program that pushes faster than the filter tries again
        while !live.push(sample.sensor, sample.time, &values) {
            std::thread::yield_now();
        }
        true
    })
    .unwrap();
    let finished = live.finish().unwrap();
    assert_eq!(finished.summary.states, offline.summary.states);
}
