//! Plugins with one deliberate fault each: the kit finds every fault and names the remedy.

mod bad;

use bad::spinner::SpinnerPlugin;
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
    segments = [
        { type = "surge", duration = "10 s", speed = "2 m/s" },
        { type = "cruise", duration = "20 s" },
    ]
"#;

fn report_on(plugin: &dyn Plugin, tables: &str) -> Report {
    report(&[plugin], &format!("{SCENARIO}\n{tables}"))
}

fn sensor(fault: &str) -> Report {
    let table = "[sensor.bad]\nnoise = \"5 cm\"\nbias = { sigma = \"5 cm\" }\n\
                 simulation = { rate = \"2 Hz\" }\n";
    report_on(&BadPlugin, &format!("{table}fault = \"{fault}\""))
}

/// A vehicle without an IMU.
fn process(fault: &str) -> Report {
    process_with(fault, "")
}

fn process_with(fault: &str, tables: &str) -> Report {
    report(
        &[&BadPlugin],
        &format!(
            r#"
            [process.cart]
            fault = "{fault}"
            [sensor.fix]
            noise = "5 cm"
            simulation = {{ rate = "2 Hz" }}
            {tables}
            [source.simulation]
            segments = [{{ type = "static", duration = "30 s" }}]
            "#
        ),
    )
}

/// Asserts that a check failed with a message.
fn finds(report: &Report, check: &str, message: &str) {
    let found = report.failures().any(|f| f.check == check && f.to_string().contains(message));
    assert!(found, "{check} does not report {message:?}:\n{report}");
}

#[test]
fn a_sensor_without_a_fault_passes_every_check() {
    let report = sensor("none");
    assert_eq!(report.failures().count(), 0, "{report}");
    let names = [
        "parameters",
        "channels",
        "display",
        "jacobian",
        "noise",
        "sigma",
        "determinism",
        "snapshot",
        "checkpoint",
        "rejection",
        "nis",
        "nees",
    ];
    assert_eq!(report.findings.iter().map(|f| f.check).collect::<Vec<_>>(), names);
    let report = process("none");
    let wrong: Vec<_> = report.failures().map(|f| f.check).filter(|c| *c != "nees").collect();
    assert!(wrong.is_empty(), "{report}"); // no reference gives its truth
    finds(&report, "nees", "add [sensor.reference]");
}

#[test]
fn a_wrong_jacobian() {
    finds(
        &sensor("jacobian"),
        "jacobian",
        "derivative of channel one with respect to bad.bias, axis 1, is 5.000000e-1; \
         central differences of predict give 1.0",
    );
}

#[test]
fn a_state_that_is_read_in_a_branch() {
    let report = sensor("branch");
    finds(
        &report,
        "jacobian",
        "predict reads bad.bias at some states and not at others, and jumps",
    );
}

/// The nodes of a field that a sensor reads change with its place, and the field does not jump.
#[test]
fn a_state_that_is_read_near_it_alone_and_without_a_jump() {
    let report = sensor("ramp");
    assert!(report.failures().all(|f| f.check != "jacobian"), "{report}");
    assert!(report.findings.iter().any(|f| f.check == "jacobian"), "{report}");
}

#[test]
fn a_prediction_that_needs_another_channel() {
    finds(
        &sensor("needs"),
        "jacobian",
        "make the prediction of each channel independent of channels that may be missing",
    );
}

#[test]
fn rows_of_channels_that_are_missing() {
    let report = sensor("rows");
    finds(&report, "jacobian", "a sample without one is linearised with 2 rows instead of 1");
    finds(
        &report,
        "rejection",
        "a sample without channel one is used with 2 channels instead of 1",
    );
}

/// The rounding of Earth-fixed coordinates is no error of a derivative.
#[test]
fn a_range_between_earth_fixed_places_has_a_derivative() {
    let report = sensor("far");
    assert!(report.failures().all(|f| f.check != "jacobian"), "{report}");
}

#[test]
fn a_scale_that_is_not_that_of_its_unit() {
    let message =
        "the state bad.bias is shown in cm with the scale 1, and one such unit is 0.01 in SI";
    finds(&sensor("centimetres"), "display", message);
}

#[test]
fn a_noise_that_is_no_covariance() {
    finds(&sensor("correlation"), "noise", "not positive semi-definite");
    finds(&sensor("asymmetric"), "noise", "R is not symmetric");
    finds(&sensor("negative"), "noise", "the variance of axis 1 is -2.5");
}

#[test]
fn channels_that_do_not_fit() {
    finds(&sensor("name"), "channels", "channel \"Depth one\" cannot be the heading");
    finds(&sensor("nan"), "channels", "its simulated channel two is NaN");
    finds(&sensor("beyond"), "channels", "its simulator sets channel number 6, but 2 are declared");
    finds(&sensor("none of them"), "channels", "its model predicts no channel");
    finds(&sensor("unset"), "channels", "channel two is in no simulated sample");
}

#[test]
fn units_that_are_unknown_or_not_si() {
    let unknown = "the unit of the channel two in the type's code: unknown unit 'furlong'";
    finds(&sensor("furlongs"), "scenario", unknown);
    finds(&sensor("kilometres"), "scenario", "'km' is not SI, as samples are: declare 'm'");
}

#[test]
fn a_sigma_that_is_not_squared() {
    finds(&sensor("linear"), "sigma", "R holds variances, so square noise once");
    finds(&sensor("floor"), "sigma", "with twice the noise, which is 1.6");
}

#[test]
fn a_channel_that_measures_nothing_and_an_angle_beyond_a_turn() {
    finds(&sensor("blind"), "jacobian", "the prediction of channel two depends on no state");
    finds(&sensor("degrees"), "channels", "channel two is an angle, and its simulated value");
}

#[test]
fn a_constraint_of_a_process_is_no_sensor_of_the_scenario() {
    let report = process_with("constraint", "[sensor.reference]\nsimulation = { rate = \"1 Hz\" }");
    assert_eq!(report.failures().count(), 0, "{report}");
    // the same checks find a fault beside it
    finds(&process("phi"), "transition", "of cart.place");
}

#[test]
fn a_state_without_a_truth_is_judged_by_nobody() {
    let report = process_with("clock", "[sensor.reference]\nsimulation = { rate = \"1 Hz\" }");
    assert_eq!(report.failures().count(), 0, "{report}");
}

#[test]
fn a_channel_of_an_instrument_that_the_scenario_does_not_have_is_not_missing() {
    let report = sensor("spare");
    assert!(report.failures().all(|f| f.check != "channels"), "{report}");
    finds(&sensor("unset"), "channels", "channel two is in no simulated sample");
}

#[test]
fn a_simulator_that_is_not_repeatable() {
    finds(&sensor("static"), "determinism", "the sample of [sensor.bad] at");
}

#[test]
fn a_model_with_memory() {
    finds(&sensor("memory"), "snapshot", "keep nothing in a measurement model");
}

#[test]
fn a_sensor_that_is_noisier_than_stated() {
    finds(
        &sensor("noisy"),
        "nis",
        "innovations are larger than their covariance predicts; compare the noise that \
         `simulate` adds",
    );
}

#[test]
fn a_simulator_of_something_else() {
    finds(&sensor("offset"), "nees", "(bad.bias: ");
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
    finds(&report, "parameters", "parameter noise takes a bare number; give it a dimension");
    finds(&report, "parameters", "parameter noise has no documentation; write a /// comment");
    finds(&report, "channels", "the scenario does not simulate it; add `simulation");
}

#[test]
fn a_process_with_a_wrong_transition() {
    finds(
        &process("phi"),
        "transition",
        "of cart.place, axis 1, with respect to cart.speed, axis 1, is -1.000000e0; \
         central differences of propagate give 1.0",
    );
    finds(&process("undeclared"), "transition", "declare its place with Composer::transition");
    finds(&process("q"), "transition", "is not positive: the variance of axis 2");
}

/// A rotation by a rate of zero: its derivative is the axis, and nalgebra returns a constant there.
#[test]
fn a_step_whose_derivative_is_lost_at_zero() {
    let scenario = |fault: &str| {
        format!(
            "[process.spinner]\nfault = {fault}\n[sensor.bow]\nnoise = \"1 %\"\n\
             simulation = {{ rate = \"2 Hz\" }}\n[source.simulation]\n\
             segments = [{{ type = \"static\", duration = \"30 s\" }}]\n"
        )
    };
    let lost = report(&[&SpinnerPlugin], &scenario("true"));
    finds(&lost, "transition", "Rotation::retract has it");
    assert!(lost.next.iter().all(|next| !next.contains("overconfident")), "{lost}");
    let sound = report(&[&SpinnerPlugin], &scenario("false"));
    assert!(sound.failures().all(|f| f.check != "transition"), "{sound}");
}

#[test]
fn a_process_whose_copy_forgets() {
    finds(
        &process("forgets"),
        "snapshot",
        "let boxed_clone of a process model copy all of its memory",
    );
}

#[test]
fn a_process_that_saves_not_all_it_remembers() {
    let message = "pass everything that a process, a monitor, an alignment or a detector remembers";
    finds(&process("unsaved"), "checkpoint", message);
}

#[test]
fn a_scenario_in_which_nothing_is_checked() {
    finds(&report_on(&BadPlugin, ""), "scenario", "add a table for one of: cart, bad, fix");
    finds(&report_on(&BadPlugin, "[sensor.bda]"), "scenario", "did you mean \"bad\"?");
}

fn streams(source: &str, sink: &str) -> Report {
    report(
        &[&BadStreams],
        &format!(
            r#"
            [process.ins]
            attitude = {{ sigma = "1 deg", initial = "0 deg" }}
            velocity = {{ sigma = "1 cm/s", initial = "0 m/s" }}
            [process.ins.position]
            sigma = "1 m"
            latitude = "32 deg"
            longitude = "34 deg"
            height = "0 m"
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
    let once = ["determinism", "snapshot", "checkpoint", "source", "sink"];
    assert_eq!(names, [&["parameters", "parameters"][..], &once].concat());
}

#[test]
fn samples_that_no_filter_can_take() {
    finds(&streams("back", "none"), "source", "the samples of [sensor.imu] go from 14.900");
    finds(&streams("nan", "none"), "source", "channel gyro_x of [sensor.imu] at 15.000");
    finds(&streams("channel", "none"), "source", "has channel number 9, but 6 are declared");
    finds(&streams("end", "none"), "source", "after the end that the source reports");
    finds(&streams("again", "none"), "source", "it returns a sample after it reported the end");
    finds(
        &streams("stranger", "none"),
        "scenario",
        "belongs to sensor number 7, but the scenario has 1",
    );
    finds(&streams("nothing", "none"), "scenario", "the filter never starts");
}

#[test]
fn a_sink_that_fails_or_that_another_run_cannot_be_compared_with() {
    finds(&streams("none", "full"), "sink", "it fails at");
    finds(
        &streams("none", "clock"),
        "sink",
        "two runs with the same seed write last.txt differently from byte",
    );
    finds(&streams("none", "cut"), "sink", "an interrupted run leaves no last.txt");
    finds(&streams("none", "empty"), "sink", "its file last.txt is empty");
    finds(
        &streams("none", "nowhere"),
        "sink",
        "it reports that it wrote /nowhere/last.txt, but there is no such file",
    );
}
