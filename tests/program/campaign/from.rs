//! Verdicts from a time on.

use crate::common::{navfuse, stdout};
use serde_json::Value;

/// The scale starts 20 % off: its first seconds of motion are not linear, and the sigma of a filter
/// that linearises each sample once is too small there.
fn judged(from: &[&str]) -> Value {
    let scenario = crate::common::scenario("pan-wu-3d").display().to_string();
    let short = [
        "monte-carlo",
        &scenario,
        "--runs",
        "150",
        "--every",
        "5 s",
        "--set",
        "estimator.stop=680 s",
    ];
    let cheap = ["--set", "sensor.imu.simulation.rate=20 Hz", "--no-output", "--format", "json"];
    let once = ["--set", "estimator.relinearise=0 s"];
    let output = navfuse(&[&short[..], &once[..], &cheap[..], from].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|e| panic!("{e}: {output:?}"))
}

#[test]
fn earlier_epochs_do_not_enter_the_verdict() {
    let (whole, later) = (judged(&[]), judged(&["--from", "640 s"]));
    let verdict = |report: &Value| report["points"][0]["verdict"]["consistent"].as_bool();
    assert_eq!((verdict(&whole), verdict(&later)), (Some(false), Some(true)), "{later:#}");
    let used = |report: &Value| report["points"][0]["nis"][0]["used"].as_u64().unwrap_or(0);
    // 5 Hz, 150 runs: 80 s of samples, and the 40 s after 640 s with the interval that ends there
    assert!(used(&whole).abs_diff(150 * 5 * 80) < 150, "{}", used(&whole));
    assert!(used(&later).abs_diff(150 * 5 * 45) < 150, "{}", used(&later));
}

#[test]
fn a_time_after_the_end_is_rejected() {
    let scenario = crate::common::scenario("pan-wu-3d").display().to_string();
    let output = navfuse(&["monte-carlo", &scenario, "--from", "3000 s", "--no-output"]);
    let text = crate::common::stderr(&output);
    assert!(
        !output.status.success() && text.contains("--from 3000 s") && text.contains("2060"),
        "{text}"
    );
}
