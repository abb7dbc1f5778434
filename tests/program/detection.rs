//! `navfuse detect`: kinds of faults, of simulations and of recordings, in one table.

use crate::common::{command, root, stderr, stdout};
use crate::diagnose::DIVE;
use navfuse_core::document::Document;
use navfuse_core::run::scenario::Scenario;
use navfuse_diagnose::{Counts, Finding, Kinds, Options, Plainness, counts, detect};
use serde_json::Value;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A healthy scenario, one with a fault below the noise, and two with plain faults, of which the second
/// has the wrong culprit in the file.
const KINDS: &str = r#"
scenario = "dive.toml"
[[kind]]
name = "healthy"
[[kind]]
name = "hidden"
culprit = ["dvl"]
fault = ['sensor.dvl.simulation.faults=[{ type = "bias", size = "0.1 mm/s" }]']
[[kind]]
name = "plain"
culprit = ["depth"]
fault = ['sensor.depth.simulation.faults=[{ type = "sign" }]']
[[kind]]
name = "misnamed"
culprit = ["imu"]
fault = ['sensor.depth.simulation.faults=[{ type = "sign" }]']
"#;

#[test]
fn a_verdict_is_counted_by_the_likelihood_ratio_of_a_filter_that_knows_the_fault() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("kinds.toml");
    std::fs::write(folder.path().join("dive.toml"), DIVE).expect("it can be written");
    std::fs::write(&path, KINDS).expect("it can be written");
    let kinds =
        Kinds::of(&Document::from_file(&path).expect("it is TOML")).expect("they are kinds");
    let options = Options { threads: 2, seconds: 1.0 };
    let (registry, stop) = (navfuse::standard_plugins(), AtomicBool::new(false));
    let rows = detect(&registry, &kinds, 2, &options, &stop, &|_, _| {}).expect("it runs");
    let of = Plainness::ALL.map(|plain| counts(&rows, plain));
    let silent = Counts { runs: 2, silent: 2, ..Counts::default() };
    let plain = Counts { runs: 4, named: 2, wrong_name: 2, ..Counts::default() };
    assert_eq!(of, [silent, silent, Counts::default(), plain], "{rows:#?}");
    let again = detect(&registry, &kinds, 2, &Options { threads: 1, ..options }, &stop, &|_, _| {});
    assert_eq!(format!("{rows:?}"), format!("{:?}", again.expect("it runs")));
}

/// The dive with a fault of its own, which `without` takes out, and a recording that is not there.
const MORE: &str = r#"
scenario = "dive.toml"
[[kind]]
name = "own fault"
culprit = ["depth"]
settings = ['sensor.depth.simulation.faults=[{ type = "sign" }]']
without = ['sensor.depth.simulation.faults=[]']
[[kind]]
name = "recorded"
recording = "dive"
"#;

/// One command counts the kinds of several files, and leaves out those of recordings that it lacks.
#[test]
fn several_files_make_one_table_without_the_recordings_that_are_missing() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("it can be written");
        path
    };
    write("dive.toml", DIVE);
    let (first, second) = (write("first.toml", KINDS), write("second.toml", MORE));
    let flags = ["detect", "--runs", "1", "--format", "json"];
    let output = command().args(flags).args([first, second]).output().expect("the command starts");
    let warned = stderr(&output);
    assert!(output.status.success() && warned.contains("recording dive are left out"), "{warned}");
    let rows: Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    let names: Vec<&str> =
        rows.as_array().expect("rows").iter().filter_map(|r| r["name"].as_str()).collect();
    assert_eq!(names, ["healthy", "hidden", "plain", "misnamed", "own fault"]);
    let own = &rows[4]["runs"][0];
    assert_eq!(own["finding"], "named");
    assert_eq!(own["ratio"], rows[2]["runs"][0]["ratio"], "the same fault, put in or taken out");
}

/// A DVL turns in its mounting by 1 deg, which the gate passes and the filter follows in seconds.
const TURNED: &str = r#"
[[kind]]
name = "DVL turns by 1 deg"
culprit = ["dvl"]
fault = ['sensor.dvl.simulation.faults=[{ type = "turn", from = "250 s", size = "1 deg", channels = ["vel_x", "vel_y"] }]']
"#;

/// A sum that begins with the error fits it from its first sample on. One that begins a second before does not: with the begin
/// of all channels together none of these runs ended within 3.5 sigma, and one named the IMU.
#[test]
fn an_error_that_the_filter_follows_in_seconds_is_named_and_more_often_contained() {
    let scenario = root().join("scenarios/quickstart.toml");
    let text = format!("scenario = {scenario:?}\n{TURNED}");
    let kinds = Kinds::of(&Document::parse("kinds.toml", text).expect("TOML"));
    let options = Options { threads: 2, seconds: 1.0 };
    let (registry, stop) = (navfuse::standard_plugins(), AtomicBool::new(false));
    let kinds = kinds.expect("they are kinds");
    let rows = detect(&registry, &kinds, 8, &options, &stop, &|_, _| {}).expect("it runs");
    let runs = rows.iter().flat_map(|row| &row.runs);
    let contained = runs.clone().filter(|run| run.error.is_some_and(|error| error < 3.5)).count();
    assert!(runs.clone().all(|run| run.finding == Finding::Named), "{rows:#?}");
    assert!(contained >= 3, "{contained} of 8: {rows:#?}");
}

/// Every scenario of the shipped files composes with the settings of its kind, and with its fault.
#[test]
fn the_kinds_of_the_documentation_fit_their_scenarios() {
    let registry = navfuse::standard_plugins();
    for name in ["kinds", "modelled", "scenarios", "recordings"] {
        let path = root().join(format!("docs/detection/{name}.toml"));
        let kinds = Kinds::of(&Document::from_file(&path).expect("TOML")).expect("they are kinds");
        for kind in &kinds.kind {
            let scenario = kind.scenario.as_deref().unwrap_or(Path::new(""));
            for more in [&kind.fault, &kind.without] {
                let settings = [&kind.settings[..], &more[..]].concat();
                let document = Document::from_file(scenario).expect("the scenario");
                let composed = Scenario::new(&registry, document, &settings).map(|s| s.compose());
                assert!(matches!(composed, Ok(Ok(_))), "{name}: {}", kind.name);
            }
        }
    }
}
