//! The JSON report, which programs read.

use crate::campaign::{SHORT, json, output, path};
use serde_json::Value;

/// Checks that the object has exactly these keys, in this order.
fn has_keys(value: &Value, keys: &[&str]) {
    let found: Vec<&str> =
        value.as_object().expect("an object").keys().map(String::as_str).collect();
    assert_eq!(found, keys);
}

const POINT: [&str; 10] =
    ["values", "runs", "failed", "end_s", "states", "anees", "nis", "worst", "judged", "verdict"];
const STATE: [&str; 10] = [
    "state",
    "component",
    "unit",
    "rmse",
    "mean_error",
    "sigma",
    "rmse_over_sigma",
    "bound",
    "rmse_over_bound",
    "smoothed",
];

/// Of ten runs the worst one has a page, which is that of the run with this seed.
#[test]
fn the_page_of_a_campaign_leads_to_the_page_of_its_worst_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    let campaign = ["monte-carlo", &path("quickstart"), "--runs", "10", "--out", &out];
    output(&[&campaign[..], &SHORT].concat());
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("a page");
    let worst = &json(&folder.path().join("report.json"))["points"][0]["worst"];
    let link = format!("<a href=\"worst-1.html\">{}</a>", worst["run"]);
    assert!(read("campaign.html").contains(&link), "{link}");
    assert!(read("worst-1.html").contains(&format!("seed = {}", worst["seed"])), "{worst}");
    assert!(!folder.path().join("worst-2.html").exists());
}

/// Two points of five runs are ten, and so have one page: that of the worst run of both points.
#[test]
fn the_page_of_a_sweep_lists_the_worst_run_of_each_point_and_leads_to_the_worst_of_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    let vary = ["--vary", "sensor.dvl.noise=1 cm/s,5 mm/s", "--runs", "5", "--out", &out];
    output(&[&["sweep", &path("quickstart")], &vary[..], &SHORT].concat());
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("a page");
    let report = json(&folder.path().join("report.json"));
    let points = report["points"].as_array().expect("the points");
    let page = read("campaign.html");
    for point in points {
        let again = point["worst"]["again"].as_str().expect("how to repeat the run");
        let again = again.replace('"', "&quot;");
        assert!(page.contains(&again), "{again}");
    }
    let nees = |point: &&Value| point["worst"]["nees"].as_f64().expect("a NEES");
    let worst = points.iter().max_by(|a, b| nees(a).total_cmp(&nees(b))).expect("a point");
    let link = format!("<a href=\"worst-1.html\">{}</a>", worst["worst"]["run"]);
    assert!(page.contains(&link), "{link}");
    let (run, key) = (read("worst-1.html"), format!("sensor.dvl.noise={}", worst["values"][0]));
    assert!(run.contains(&format!("seed = {}", worst["worst"]["seed"])), "{worst}");
    assert!(run.contains(&key.replace('"', "")), "{key}");
    assert!(!folder.path().join("worst-2.html").exists());
}

#[test]
fn the_report_has_the_documented_keys_and_nothing_else_is_on_standard_output() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    // two runs and an overconfident filter fill every part of the report
    let set = [
        "--set",
        "sensor.dvl.simulation.noise=3",
        "--set",
        "sensor.dvl.gate=0.5",
        SHORT[0],
        SHORT[1],
    ];
    let campaign =
        ["monte-carlo", &path("quickstart"), "--runs", "2", "--format=json", "--out", &out];
    let text = output(&[&campaign[..], &set].concat());
    // a NaN would not be JSON
    let report: Value = serde_json::from_str(&text).expect("one JSON object");
    assert_eq!(report, json(&folder.path().join("report.json")));
    has_keys(&report, &["scenario", "keys", "runs", "smoothed", "seed", "points"]);
    // the page shows the same verdict and the run to look at, and loads nothing
    let page = std::fs::read_to_string(folder.path().join("campaign.html")).expect("the page");
    let again = report["points"][0]["worst"]["again"].as_str().expect("how to repeat the run");
    let again = again.replace('"', "&quot;");
    for part in ["INCONSISTENT", &again, "<svg ", "ins.attitude"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("src=") && !page.contains("<link"), "the page loads something");
    assert_eq!(
        (&report["scenario"], &report["runs"], &report["seed"]),
        (&"quickstart".into(), &2.into(), &1.into())
    );
    let point = &report["points"][0];
    has_keys(point, &POINT);
    assert_eq!(
        (&point["runs"], &point["failed"], &point["end_s"]),
        (&2.into(), &0.into(), &100.0.into())
    );
    let states = point["states"].as_array().expect("the states");
    assert_eq!(states.len(), 19);
    for state in states {
        has_keys(state, &STATE);
        let numbers = STATE[3..].iter().map(|key| state[key].as_f64());
        assert!(numbers.into_iter().all(|n| n.is_some_and(f64::is_finite)), "{state}");
    }
    let anees = point["anees"].as_array().expect("the ANEES");
    assert_eq!(
        (anees.len(), &anees[0]["of"], &anees[0]["dimension"]),
        (8, &"whole state".into(), &19.into())
    );
    for a in anees {
        has_keys(a, &["of", "dimension", "value", "band", "rmse_over_bound", "inside"]);
        has_keys(&a["band"], &["low", "high"]);
    }
    for nis in point["nis"].as_array().expect("the NIS") {
        has_keys(nis, &["sensor", "used", "gated", "mean", "expected", "band"]);
    }
    has_keys(&point["worst"], &["run", "seed", "nees", "failure", "again"]);
    let verdict = &point["verdict"];
    has_keys(verdict, &["consistent", "text", "findings"]);
    assert_eq!(verdict["consistent"], false);
    has_keys(&verdict["findings"][0], &["of", "text", "factor", "since"]);
    assert_eq!(verdict["text"], verdict["findings"][0]["text"]);
}

#[test]
fn missing_values_are_null_in_the_report_of_a_bound() {
    let text =
        output(&["bound", &path("quickstart"), "--format=json", "--no-output", SHORT[0], SHORT[1]]);
    let report: Value = serde_json::from_str(&text).expect("one JSON object");
    let point = &report["points"][0];
    has_keys(point, &POINT);
    assert!(point["verdict"].is_null() && point["worst"].is_null());
    for state in point["states"].as_array().expect("the states") {
        assert!(state["rmse"].is_null() && state["sigma"].is_null(), "{state}");
        // the smoothed bound of a constant is its final bound, except for rounding
        let constant = state["state"] == "dvl.scale";
        let [bound, smoothed] =
            ["bound", "smoothed"].map(|key| state[key].as_f64().expect("a number"));
        assert!(!constant || (smoothed / bound - 1.0).abs() < 1e-9, "{state}");
    }
}

#[test]
fn a_sweep_has_an_entry_for_each_point_in_the_order_of_the_keys() {
    let vary =
        ["--vary", "sensor.dvl.noise=1 cm/s,2 cm/s", "--vary", "sensor.depth.noise=1 cm,1 m"];
    let more = ["--format=json", "--no-output", SHORT[0], SHORT[1]];
    let text = output(&[&["sweep", &path("quickstart")], &vary[..], &more].concat());
    let report: Value = serde_json::from_str(&text).expect("one JSON object");
    assert_eq!(report["keys"], serde_json::json!(["sensor.dvl.noise", "sensor.depth.noise"]));
    let values: Vec<&Value> =
        report["points"].as_array().expect("the points").iter().map(|p| &p["values"]).collect();
    let expected = [["1 cm/s", "1 cm"], ["1 cm/s", "1 m"], ["2 cm/s", "1 cm"], ["2 cm/s", "1 m"]];
    assert_eq!(serde_json::json!(values), serde_json::json!(expected));
}

#[test]
fn without_a_reference_only_states_with_a_truth_in_the_scenario_are_compared() {
    let settings = [
        "sensor.reference.enabled=false",
        "process.ins.attitude={sigma = \"0.05 deg\", initial = [\"0 deg\", \"0 deg\", \"30 deg\"]}",
        "process.ins.velocity={sigma = \"1 cm/s\", initial = \"0 m/s\"}",
        "process.ins.position={sigma = \"1 m\", latitude = \"43 deg\", longitude = \"5 deg\", \
         height = \"0 m\"}",
        "estimator.draw=nothing",
        SHORT[1],
    ];
    let quickstart = path("quickstart");
    let mut campaign = vec![
        "monte-carlo",
        &quickstart,
        "--runs=2",
        "--start=given",
        "--format=json",
        "--no-output",
    ];
    settings.iter().for_each(|s| campaign.extend(["--set", s]));
    let report: Value = serde_json::from_str(&output(&campaign)).expect("one JSON object");
    let point = &report["points"][0];
    // three gyro and three accelerometer biases, scale factor, three angles of misalignment
    assert_eq!(point["anees"][0]["dimension"], 10);
    for anees in point["anees"].as_array().expect("the ANEES") {
        let known = !["ins.attitude", "ins.velocity", "ins.position"]
            .contains(&anees["of"].as_str().unwrap_or(""));
        assert_eq!(anees["value"].is_number(), known, "{anees}");
    }
}
