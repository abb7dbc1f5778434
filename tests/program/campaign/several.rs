//! Several scenarios give one table.

use crate::campaign::{SHORT, json, output, path};
use crate::common::{navfuse, stderr};
use serde_json::Value;

#[test]
fn several_scenarios_give_one_table_with_a_row_for_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    let [healthy, wrong] = ["faults/healthy", "faults/gyro-in-degrees"].map(path);
    let runs = ["--runs", "2", "--format=json", "--out", &out];
    let campaign = [&["monte-carlo", &healthy, &wrong], &runs[..], &SHORT[..]].concat();
    let rows: Value = serde_json::from_str(&output(&campaign)).expect("one JSON array");
    let rows = rows.as_array().expect("rows");
    let of = |key: &str| rows.iter().map(|row| row[key].clone()).collect::<Vec<_>>();
    assert_eq!(of("scenario"), ["healthy", "gyro-in-degrees"]);
    // errors of 2 runs and 19 states: one above 3.5 sigma in 1 of 57 pairs of runs, of which the
    // seed gives one; gyros 57 times too sensitive leave no state right
    assert_eq!(of("within"), [2, 0]);
    assert_eq!(rows[0]["missed"], 0);
    assert_eq!(rows[0]["warned"], serde_json::json!({}));
    // 40 s are too short to find the gyros; each verdict names one part first
    assert_eq!(rows[0]["blamed"], serde_json::json!({}));
    let blamed = rows[1]["blamed"].as_object().expect("names");
    assert_eq!(blamed.values().filter_map(Value::as_u64).sum::<u64>(), 2);
    let found = |key: &str| rows[1][key].as_u64().expect("a number");
    assert_eq!(found("refused") + found("missed"), 2);
    for name in ["healthy", "gyro-in-degrees"] {
        let report = json(&folder.path().join(name).join("report.json"));
        assert_eq!(report["scenario"], name);
    }
}

#[test]
fn a_part_of_several_scenarios_is_rejected_with_the_remedy() {
    let [first, second] = ["quickstart", "faults/healthy"].map(path);
    let output = navfuse(&["monte-carlo", &first, &second, "--shard", "1/2"]);
    let message = stderr(&output);
    assert!(!output.status.success() && message.contains("--shard 1/2"), "{message}");
    assert!(message.contains("one scenario"), "{message}");
}
