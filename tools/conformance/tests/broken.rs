//! Plugins broken on purpose, one fault at a time: the kit finds each, and says what to mend.

mod bad;

use bad::streams::BadStreams;
use bad::{BadPlugin, Bare, Undocumented};
use navfuse_conformance::{Report, report};
use navfuse_core::plugin::{Plugin, Registry};

const SCENARIO: &str = r#"
    [process.ins]
    attitude = { sigma = "0.02 deg" }
    velocity = { sigma = "1 cm/s" }
    position = { sigma = ["1 m", "1 m", "1 cm"] }

    [sensor.imu]
    gyro_noise = "0.1 deg/h/sqrt(Hz)"
    accel_noise = "10 ug/sqrt(Hz)"
    simulation = { rate = "20 Hz" }

    [sensor.reference]
    simulation = { rate = "1 Hz" }

    [source.simulation]
    segments = [{ type = "surge", duration = "10 s", speed = "2 m/s" }, { type = "cruise", duration = "20 s" }]
"#;

fn report_on(plugin: &dyn Plugin, tables: &str) -> Report {
    report(&[plugin], &format!("{SCENARIO}\n{tables}"))
}

fn sensor(fault: &str) -> Report {
    let table = "[sensor.bad]\nnoise = \"5 cm\"\nbias = { sigma = \"5 cm\" }\nsimulation = { rate = \"2 Hz\" }\n";
    report_on(&BadPlugin, &format!("{table}fault = \"{fault}\""))
}

/// A vehicle without an IMU.
fn process(fault: &str) -> Report {
    report(
        &[&BadPlugin],
        &format!(
            r#"
            [process.cart]
            fault = "{fault}"
            [sensor.fix]
            noise = "5 cm"
            simulation = {{ rate = "2 Hz" }}
            [source.simulation]
            segments = [{{ type = "static", duration = "30 s" }}]
            "#
        ),
    )
}

/// That a check failed with that message.
fn tells(report: &Report, check: &str, message: &str) {
    let told = report.failures().any(|f| f.check == check && f.to_string().contains(message));
    assert!(told, "{check} does not tell {message:?}:\n{report}");
}

#[test]
fn a_sensor_without_a_fault_passes_every_check() {
    let report = sensor("none");
    assert_eq!(report.failures().count(), 0, "{report}");
    let names = [
        "parameters",
        "channels",
        "jacobian",
        "noise",
        "determinism",
        "snapshot",
        "rejection",
        "nis",
        "nees",
    ];
    assert_eq!(report.findings.iter().map(|f| f.check).collect::<Vec<_>>(), names);
    let report = process("none");
    let wrong: Vec<_> = report.failures().map(|f| f.check).filter(|c| *c != "nees").collect();
    assert!(wrong.is_empty(), "{report}"); // no reference tells its truth
    tells(&report, "nees", "add [sensor.reference]");
}

#[test]
fn a_wrong_jacobian() {
    tells(
        &sensor("jacobian"),
        "jacobian",
        "derivative of channel one with respect to bad.bias, axis 1, is 5.000000e-1; central differences of predict give 1.0",
    );
}

#[test]
fn a_state_that_is_read_in_a_branch() {
    tells(&sensor("branch"), "jacobian", "predict reads bad.bias at some states and not at others");
}

#[test]
fn a_prediction_that_needs_another_channel() {
    tells(
        &sensor("needs"),
        "jacobian",
        "let the prediction of one channel not depend on another that may be missing",
    );
}

#[test]
fn rows_of_channels_that_are_missing() {
    let report = sensor("rows");
    tells(&report, "jacobian", "a sample without one is linearised with 2 rows, 1 are needed");
    tells(
        &report,
        "rejection",
        "a sample without channel one is used with 2 channels, 1 are there",
    );
}

#[test]
fn a_noise_that_is_no_covariance() {
    tells(&sensor("correlation"), "noise", "not positive semi-definite");
    tells(&sensor("asymmetric"), "noise", "R is not symmetric");
    tells(&sensor("negative"), "noise", "the variance of axis 1 is -2.5");
}

#[test]
fn channels_that_do_not_fit() {
    tells(&sensor("name"), "channels", "channel \"Depth one\" with unit \"m\" makes no heading");
    tells(&sensor("nan"), "channels", "its simulated channel two is NaN");
    tells(&sensor("beyond"), "channels", "its simulator sets channel number 6, but 2 are declared");
    tells(&sensor("none of them"), "channels", "its model predicts no channel");
    tells(&sensor("unset"), "channels", "channel two is in no simulated sample");
}

#[test]
fn a_simulator_that_is_not_repeatable() {
    tells(&sensor("static"), "determinism", "the sample of [sensor.bad] at");
}

#[test]
fn a_model_with_memory() {
    tells(&sensor("memory"), "snapshot", "keep nothing in a measurement model");
}

#[test]
fn a_sensor_that_is_noisier_than_it_says() {
    tells(
        &sensor("noisy"),
        "nis",
        "innovations are larger than the filter says; compare what `simulate` adds",
    );
}

#[test]
fn a_simulator_of_something_else() {
    tells(&sensor("offset"), "nees", "(bad.bias: ");
}

#[test]
fn parameters_without_documentation_or_unit() {
    struct Both;
    impl Plugin for Both {
        fn build(&self, registry: &mut Registry) {
            registry.sensor::<Bare>();
            registry.sensor::<Undocumented>();
        }
    }
    let report =
        report_on(&Both, "[sensor.bare]\nnoise = 0.1\n[sensor.undocumented]\nnoise = \"5 cm\"");
    tells(&report, "parameters", "parameter noise takes a bare number; give it a dimension");
    tells(&report, "parameters", "parameter noise has no documentation; write a /// comment");
    tells(&report, "channels", "it is not simulated; give it `simulation");
}

#[test]
fn a_process_with_a_wrong_transition() {
    tells(
        &process("phi"),
        "transition",
        "of cart.place, axis 1, with respect to cart.speed, axis 1, is -1.000000e0; central differences of propagate give 1.0",
    );
    tells(&process("undeclared"), "transition", "declare its place with Composer::transition");
    tells(&process("q"), "transition", "is not positive: the variance of axis 2");
}

#[test]
fn a_process_whose_copy_forgets() {
    tells(
        &process("forgets"),
        "snapshot",
        "let boxed_clone of a process model copy all of its memory",
    );
}

#[test]
fn a_scenario_in_which_nothing_is_checked() {
    tells(&report_on(&BadPlugin, ""), "scenario", "add a table for one of: cart, bad, fix");
    tells(&report_on(&BadPlugin, "[sensor.bda]"), "scenario", "did you mean \"bad\"?");
}

fn streams(source: &str, sink: &str) -> Report {
    report(
        &[&BadStreams],
        &format!(
            r#"
            [process.ins]
            attitude = {{ sigma = "1 deg", initial = "0 deg" }}
            velocity = {{ sigma = "1 cm/s", initial = "0 m/s" }}
            position = {{ sigma = "1 m", latitude = "32 deg", longitude = "34 deg", height = "0 m" }}
            [sensor.imu]
            gyro_noise = "0.1 deg/h/sqrt(Hz)"
            accel_noise = "10 ug/sqrt(Hz)"
            [source.rest]
            fault = "{source}"
            [sink.last]
            fault = "{sink}"
            "#
        ),
    )
}

#[test]
fn a_source_and_a_sink_without_a_fault_pass() {
    let report = streams("none", "none");
    assert_eq!(report.failures().count(), 0, "{report}");
    let names: Vec<_> = report.findings.iter().map(|f| f.check).collect();
    assert_eq!(names, ["parameters", "parameters", "determinism", "snapshot", "source", "sink"]);
}

#[test]
fn samples_that_no_filter_can_take() {
    tells(&streams("back", "none"), "source", "the samples of [sensor.imu] go from 14.900");
    tells(&streams("nan", "none"), "source", "channel gyro_x of [sensor.imu] at 15.000");
    tells(&streams("channel", "none"), "source", "has channel number 9, and 6 are declared");
    tells(&streams("end", "none"), "source", "after the end that it tells");
    tells(&streams("again", "none"), "source", "a sample after it said that there is none");
    tells(
        &streams("stranger", "none"),
        "scenario",
        "is of sensor number 7, and the scenario has 1",
    );
    tells(&streams("nothing", "none"), "scenario", "the filter never starts");
}

#[test]
fn a_sink_that_fails_or_that_another_run_cannot_be_compared_with() {
    tells(&streams("none", "full"), "sink", "it fails at");
    tells(
        &streams("none", "clock"),
        "sink",
        "two runs with the same seed write last.txt differently from byte",
    );
    tells(&streams("none", "cut"), "sink", "of a run that is interrupted it leaves no last.txt");
    tells(&streams("none", "empty"), "sink", "the file last.txt that it wrote is empty");
    tells(
        &streams("none", "nowhere"),
        "sink",
        "it tells that it wrote to /nowhere/last.txt, and there is no such file",
    );
}
