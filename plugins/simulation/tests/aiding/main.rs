//! Faults of aiding sensors: noticed, named and survived.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod bench;

use bench::Trial;
use navfuse_core::model::finding::{Finding, Severity};

const DIVE: &str = include_str!("../../../../scenarios/surface-dive.toml");

const STOP: &str = "estimator.stop=630 s";

/// GNSS until the fault is over, and none from before the fault on.
const PLACES: [&str; 2] = [
    "sensor.gnss.simulation.outages=[[\"320 s\", \"1080 s\"]]",
    "sensor.gnss.simulation.outages=[[\"200 s\", \"1080 s\"]]",
];

/// Runs the dive with a fault of a sensor from 250 s to 310 s.
fn dive(place: &str, sensor: &str, fault: &str) -> Trial {
    let span = "from = \"250 s\", to = \"310 s\"";
    let fault = format!("sensor.{sensor}.simulation.faults=[{{ {fault}, {span} }}]");
    let trial = bench::run(DIVE, &[STOP, place, &fault]);
    trial.print(&format!("{place} {fault}"));
    trial
}

/// Finding about a sensor, the most severe one.
fn worst<'a>(trial: &'a Trial, sensor: &str) -> Option<&'a Finding> {
    let findings = trial.finished.findings.iter();
    findings.filter(|finding| finding.about == sensor).max_by_key(|finding| finding.severity)
}

#[test]
fn a_wrong_speed_of_the_dvl_is_never_adopted() {
    for place in PLACES {
        let fault = "type = \"bias\", size = \"0.3 m/s\", channels = [\"vel_x\"]";
        let trial = dive(place, "dvl", fault);
        // 60 s at 5 Hz, less the first sample; then four samples that agree
        assert_eq!(trial.errors.outcomes["dvl Isolated"], 300 - 150 + 4);
        assert!(trial.errors.largest().0 <= 3.5, "{:?}", trial.errors.largest());
        assert_eq!(worst(&trial, "dvl").unwrap().severity, Severity::Doubtful);
    }
}

#[test]
fn a_wrong_depth_is_never_adopted() {
    for place in PLACES {
        let trial = dive(place, "depth", "type = \"bias\", size = \"5 m\"");
        assert_eq!(trial.errors.outcomes["depth Isolated"], 120 - 60 + 4);
        assert!(trial.errors.largest().0 <= 3.5, "{:?}", trial.errors.largest());
        assert!(worst(&trial, "depth").unwrap().text.contains("jumped"));
    }
}
