//! Bad input gives a clear error and loses nothing: every message names file, line or time, key,
//! value and remedy.

use crate::common::recording::Recording;
use crate::common::{Need, command, navfuse, root, skip, stderr, stdout};
use serde_json::json;
use std::process::Output;

/// Runs the recording's scenario with the output in its folder.
fn run(recording: &Recording, more: &[&str]) -> Output {
    let (scenario, out) = (recording.path("rest.toml"), recording.path("out"));
    let mut command = command();
    command.arg("run").arg(scenario).arg("--out").arg(out).args(more);
    command.output().expect("the command starts")
}

/// Checks that the run fails with a message that has all of the parts, without a panic.
fn fails_with(output: &Output, parts: &[&str]) {
    let message = stderr(output);
    assert!(!output.status.success(), "it should fail: {}", stdout(output));
    reports(output, parts);
    assert!(!message.contains("panicked"), "{message}");
}

/// Checks that the run's message has all of the parts.
fn reports(output: &Output, parts: &[&str]) {
    let message = stderr(output);
    for part in parts {
        assert!(message.contains(part), "no {part:?} in:\n{message}");
    }
}

#[test]
fn the_undamaged_recording_runs() {
    let recording = Recording::new();
    let output = run(&recording, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).contains("dvl.scale"));
}

#[test]
fn two_sources_that_feed_one_sensor_are_an_error_that_names_both() {
    let recording = Recording::new();
    let folder = recording.folder().display();
    recording.change(
        "[source.csv]",
        &format!(
            "[source.again]\ntype = \"csv\"\ndirectory = {:?}\n[source.csv]",
            folder.to_string()
        ),
    );
    fails_with(&run(&recording, &[]), &["[sensor.", "samples from two sources, again and csv"]);
}

#[test]
fn a_table_that_nobody_named_is_not_read_beside_other_sources() {
    let recording = Recording::new();
    recording.change(
        "[source.csv]\ndirectory = \".\"",
        "[source.again]\ntype = \"csv\"\nfiles.dvl.path = \"dvl.csv\"\n[source.csv]\n\
         files.imu.path = \"imu.csv\"\nfiles.reference.path = \"reference.csv\"",
    );
    assert!(run(&recording, &[]).status.success(), "imu.csv is read once, and dvl.csv once");
}

#[test]
fn a_misspelt_key_is_named_with_its_line_and_the_nearest_key() {
    let recording = Recording::new();
    recording.change("gate = 0.999", "gaet = 0.999");
    fails_with(&run(&recording, &[]), &["rest.toml:15", "\"gaet\"", "did you mean \"gate\"?"]);
}

#[test]
fn a_misspelt_type_is_named_with_its_line_and_the_nearest_type() {
    let recording = Recording::new();
    recording.change("[sensor.dvl]", "[sensor.dvll]");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:12", "unknown sensor type \"dvll\"", "did you mean \"dvl\"?"],
    );
}

#[test]
fn a_wrong_unit_is_named_with_what_is_needed() {
    let recording = Recording::new();
    recording.change("noise = \"2 cm/s\"", "noise = \"2 cm\"");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:13", "sensor.dvl.noise", "2 cm", "length", "speed", "cm/s"],
    );
}

#[test]
fn a_missing_unit_is_named_with_an_example() {
    let recording = Recording::new();
    recording.change("noise = \"2 cm/s\"", "noise = 0.02");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:13", "sensor.dvl.noise", "0.02", "unit", "cm/s"],
    );
}

#[test]
fn a_negative_sigma_is_refused() {
    let recording = Recording::new();
    recording.change("velocity = { sigma = \"1 cm/s\" }", "velocity = { sigma = \"-1 cm/s\" }");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:3", "process.ins.velocity.sigma", "negative", "-1 cm/s"],
    );
}

#[test]
fn a_prior_of_zero_is_refused_and_the_remedy_named() {
    let recording = Recording::new();
    recording.change("scale = { sigma = \"1 %\" }", "scale = { sigma = 0 }");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:14", "sensor.dvl.scale.sigma", "singular", "mode = \"fixed\""],
    );
}

#[test]
fn an_unknown_reference_between_tables_is_named() {
    let recording = Recording::new();
    recording.change("noise = \"2 cm/s\"", "noise = \"2 cm/s\"\nnavigation = \"inz\"");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:14", "sensor.dvl.navigation", "inz.attitude", "ins.attitude"],
    );
    recording.change("[process.ins]", "[process.ins]\nimu = \"imu2\"");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:2", "process.ins.imu", "no driving sensor imu2", "imu"],
    );
}

#[test]
fn a_setting_that_does_not_fit_is_named_as_such() {
    let recording = Recording::new();
    let output = run(&recording, &["--set", "sensor.dvl.noise=2 bar"]);
    fails_with(&output, &["--set sensor.dvl.noise", "2 bar", "pressure", "speed"]);
}

#[test]
fn a_segment_that_does_not_fit_is_named_with_its_own_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long-turns.toml");
    let quickstart = std::fs::read_to_string(root().join("scenarios/quickstart.toml")).unwrap();
    let text = quickstart.replace("\nturn = \"20 s\"", "\nturn = \"200 s\"");
    let line = text.lines().position(|l| l.starts_with("turn = ")).unwrap() + 1;
    std::fs::write(&path, text).unwrap();
    let place = format!("long-turns.toml:{line}: source.simulation.segments.3.turn");
    let output = navfuse(&["run", path.to_str().unwrap(), "--no-output"]);
    fails_with(&output, &[&place, "segment 4 (`square`): four turns leave nothing of 480 s"]);
}

#[test]
fn a_missing_scenario_and_a_syntax_error_are_named() {
    fails_with(&navfuse(&["run", "no-such.toml"]), &["no-such.toml"]);
    let recording = Recording::new();
    recording.change("[sensor.dvl]", "[sensor.dvl");
    fails_with(&run(&recording, &[]), &["rest.toml:12"]);
}

#[test]
fn a_missing_file_is_named_with_the_key_to_set() {
    let recording = Recording::new();
    std::fs::remove_file(recording.path("imu.csv")).expect("it is there");
    fails_with(&run(&recording, &[]), &["imu.csv", "imu"]);
}

#[test]
fn a_missing_column_is_named_with_those_that_may_be_meant() {
    let recording = Recording::new();
    recording.replace_line("dvl.csv", 1, "time_s,vel_x_mps,vel_y_mps,speed_z_mps");
    fails_with(&run(&recording, &[]), &["dvl.csv", "vel_z", "speed_z_mps"]);
    recording.replace_line("dvl.csv", 1, "time_s,vel_x_mps,vel_y_mps,downward_mps");
    let output = run(&recording, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    reports(&output, &["warning", "dvl.csv", "no column for vel_z", "downward_mps"]);
    let imu =
        "time_s,gyro_x_radps,gyro_y_radps,yaw_rate_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2";
    recording.replace_line("imu.csv", 1, imu);
    fails_with(&run(&recording, &[]), &["imu.csv", "gyro_z", "yaw_rate_radps"]);
}

#[test]
fn a_reference_of_positions_alone_is_compared_in_its_positions() {
    let recording = Recording::new();
    let fixes = (1..=20).map(|k| format!("{k}.0,30.0,5.0,0.5\n")).collect::<String>();
    recording.write("reference.csv", &format!("time_s,lat_deg,lon_deg,height_m\n{fixes}"));
    fails_with(
        &run(&recording, &[]),
        &["never started", "no sample of [sensor.reference] gives ins.attitude"],
    );
    let given = [
        "--set",
        "process.ins.attitude.initial=0 deg",
        "--set",
        "process.ins.velocity.initial=0 m/s",
        "--format=json",
    ];
    let output = run(&recording, &given);
    assert!(output.status.success(), "{}", stderr(&output));
    let result: serde_json::Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    let error = |state: &str| result["states"][state]["error"].clone();
    assert_eq!((error("ins.attitude"), error("ins.velocity")), (json!(null), json!(null)));
    // the filter starts at the height of the reference and rests, with a DVL, for 20 s
    let height = error("ins.position")[2].as_f64().expect("a number");
    assert!(height.abs() < 0.2, "{height}");
    assert!(result["horizontal_error_m"]["rms"].as_f64().expect("a number") < 0.2);
}

#[test]
fn an_excluded_span_is_counted_and_one_that_ends_before_it_begins_is_refused() {
    let recording = Recording::new();
    recording.change("gate = 0.999", "exclude = [[\"5 s\", \"8 s\"], [\"15 s\", \"16 s\"]]");
    let output = run(&recording, &["--format=json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let result: serde_json::Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    // the filter starts with the reference of 1 s and uses the 19 later samples but 5, 6, 7, 15 s
    let dvl = &result["samples"]["dvl"];
    assert_eq!((&dvl["read"], &dvl["excluded"]), (&json!(20), &json!(4)), "{dvl}");
    assert_eq!((&dvl["accepted"], &dvl["rejected"]), (&json!(15), &json!(0)), "{dvl}");
    recording.change("gate = 0.999", "exclude = [[\"8 s\", \"5 s\"]]");
    fails_with(&run(&recording, &[]), &["rest.toml:15", "[8 s, 5 s]", "ends after it begins"]);
}

#[test]
fn a_cell_that_is_no_number_is_named_with_line_and_column() {
    let recording = Recording::new();
    recording.replace_line("imu.csv", 500, "4.99,0,0,abc,0,0,-9.8");
    fails_with(&run(&recording, &[]), &["imu.csv:500", "gyro_z_radps", "abc"]);
}

#[test]
fn a_nan_is_named_with_line_and_column() {
    let recording = Recording::new();
    recording.replace_line("dvl.csv", 9, "8.0,0.001,NaN,0.001");
    fails_with(&run(&recording, &[]), &["dvl.csv:9", "vel_y_mps", "NaN"]);
}

#[test]
fn time_going_backwards_is_named_with_line_and_remedy() {
    let recording = Recording::new();
    recording.replace_line("imu.csv", 500, "4.50,0,0,0,0,0,-9.8");
    fails_with(&run(&recording, &[]), &["imu.csv:500", "4.5", "disorder"]);
}

#[test]
fn a_duplicate_time_is_named_with_line_and_remedy() {
    let recording = Recording::new();
    recording.replace_line("dvl.csv", 9, "7.0,0.001,0.001,0.001");
    fails_with(&run(&recording, &[]), &["dvl.csv:9", "7", "disorder"]);
}

#[test]
fn a_gap_in_the_imu_ends_the_run_with_its_time_and_remedy_and_keeps_the_log() {
    let recording = Recording::new();
    recording.remove_lines("imu.csv", 1001..=1100);
    let output = run(&recording, &[]);
    fails_with(&output, &["ins", "no IMU sample for 1.010 s before 11.000 s", "max_gap = 0.1 s"]);
    assert!(stdout(&output).contains("dvl.scale"), "the estimate until then is printed");
    let log = recording.path("out").join("run.mcap");
    let again = navfuse(&["replay", &log.display().to_string(), "--no-output"]);
    fails_with(&again, &["max_gap"]); // the log opens, and has the gap
}

#[test]
fn a_sensor_without_data_is_named() {
    let recording = Recording::new();
    std::fs::remove_file(recording.path("dvl.csv")).expect("it is there");
    let output = run(&recording, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    reports(&output, &["dvl", "no sample of [sensor.dvl]"]);
}

#[test]
fn a_reference_that_never_comes_is_named_with_the_remedy() {
    let recording = Recording::new();
    let output = run(&recording, &["--set", "estimator.start=100 s"]);
    fails_with(&output, &["never started", "estimator.start", "100"]);
}

#[test]
fn no_initial_value_and_no_reference_is_an_error_that_names_the_keys() {
    let recording = Recording::new();
    recording.change("[sensor.reference]", "");
    fails_with(&run(&recording, &[]), &["no initial value", "attitude", "[sensor.reference]"]);
}

#[test]
fn a_cut_off_log_is_read_up_to_the_cut_with_a_message() {
    let recording = Recording::new();
    assert!(run(&recording, &[]).status.success());
    let log = recording.path("out").join("run.mcap");
    let bytes = std::fs::read(&log).expect("the log is there");
    for share in [0.5, 0.9] {
        std::fs::write(&log, &bytes[..(bytes.len() as f64 * share) as usize])
            .expect("the test can write");
        let output = navfuse(&["replay", &log.display().to_string(), "--no-output"]);
        reports(&output, &["cut off", "run.mcap"]);
        assert!(!stderr(&output).contains("panicked"));
    }
}

#[test]
fn a_full_disk_is_named_and_the_result_is_still_printed() {
    if !std::path::Path::new("/dev/full").exists() {
        return skip(Need::Unix, "/dev/full");
    }
    let recording = Recording::new();
    let output = run(&recording, &["--set", "sink.mcap.path=/dev/full"]);
    fails_with(&output, &["/dev/full", "mcap"]);
    assert!(stdout(&output).contains("dvl.scale"), "{}", stdout(&output));
}

#[test]
fn a_closed_pipe_ends_the_command_without_a_panic() {
    let recording = Recording::new();
    let fifo = recording.path("pipe.mcap");
    let made = std::process::Command::new("mkfifo").arg(&fifo).status();
    if !made.is_ok_and(|s| s.success()) {
        return skip(Need::Unix, "mkfifo");
    }
    let reader = std::process::Command::new("head")
        .arg("-c")
        .arg("100")
        .arg(&fifo)
        .stdout(std::process::Stdio::null())
        .spawn();
    let mut reader = reader.expect("head starts");
    let output = run(&recording, &["--set", &format!("sink.mcap.path={}", fifo.display())]);
    reader.wait().expect("head ends");
    fails_with(&output, &["pipe.mcap"]);
    assert!(stdout(&output).contains("dvl.scale"));
}

#[test]
fn a_standard_output_that_closes_early_is_no_panic() {
    let recording = Recording::new();
    let binary = env!("CARGO_BIN_EXE_navfuse");
    let script =
        format!("{binary} run {} --no-output | true", recording.path("rest.toml").display());
    let output =
        std::process::Command::new("sh").arg("-c").arg(script).output().expect("sh starts");
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
}

#[test]
fn an_imu_that_begins_long_after_the_filter_is_refused() {
    let scenario = crate::common::scenario("quickstart").display().to_string();
    let settings = ["--set", "sensor.imu.simulation.offset=50 s", "--set", "estimator.start=0 s"];
    let output =
        command().args(["run", &scenario, "--no-output", "--format=json"]).args(settings).output();
    let output = output.expect("the command starts");
    // or the filter waits for the first reference with an IMU sample: 580 s
    let started_late = stdout(&output).contains("\"duration_s\":57");
    assert!(started_late || stderr(&output).contains("max_gap"), "{}", stderr(&output));
}

/// Lost samples of an IMU of increments cost their content, but not the filter: its errors stay
/// those of a filter without losses, 3 sigma for the DVL's scale factor.
#[test]
fn lost_increments_are_bridged_and_reported() {
    let scenario = crate::common::scenario("quickstart").display().to_string();
    let settings =
        ["--set", "sensor.imu.output=increments", "--set", "sensor.imu.simulation.dropout=1 %"];
    let output =
        command().args(["run", &scenario, "--no-output", "--format=json"]).args(settings).output();
    let output = output.expect("the command starts");
    reports(&output, &["without a sample", "bridged", "samples were missing"]);
    let result: serde_json::Value =
        serde_json::from_str(&stdout(&output)).expect("one JSON object");
    let scale = &result["states"]["dvl.scale"];
    let ratio = scale["error"][0].as_f64().expect("an error")
        / scale["sigma"][0].as_f64().expect("a sigma");
    assert!(ratio.abs() < 3.0, "{ratio} sigma");
}

#[test]
fn a_fault_that_cannot_be_simulated_is_named_with_the_remedy() {
    let scenario = crate::common::scenario("quickstart").display().to_string();
    let cases = [
        ("sensor.imu.simulation.rate=1e12 Hz", "up to 1 MHz"),
        ("sensor.dvl.simulation.dropout=2", "such as \"2 %\""),
        ("sensor.imu.simulation.offset=-1 s", "begins at 0 s"),
        ("sensor.dvl.simulation.outages=[[\"400 s\", \"100 s\"]]", "ends after it begins"),
        ("sensor.imu.simulation.outliers=50 %", "only measuring sensors"),
    ];
    for (setting, remedy) in cases {
        fails_with(
            &navfuse(&["run", &scenario, "--no-output", "--set", setting]),
            &["simulation]", remedy],
        );
    }
}

#[test]
fn a_fault_that_does_not_fit_its_sensor_is_named_with_line_and_remedy() {
    let recording = Recording::new();
    let simulation = "noise = \"2 cm/s\"\nsimulation = { rate = \"5 Hz\", faults = [FAULT] }";
    let cases = [
        (r#"{ type = "stuk" }"#, "faults.0.type", "did you mean \"stuck\"?"),
        (r#"{ type = "sign", channels = ["vel_w"] }"#, "faults.0.channels.0", "vel_x, vel_y"),
        (r#"{ type = "bias", size = "2 cm" }"#, "faults.0.size", "m/s, cm/s, kn"),
        (r#"{ type = "bias", size = "2 cm/s", form = "1 s" }"#, "faults.0.form", "\"from\""),
        (r#"{ type = "bias", size = "2 cm/s", from = 3 }"#, "faults.0.from = 3", "unit"),
    ];
    for (fault, key, remedy) in cases {
        recording.change("noise = \"2 cm/s\"", &simulation.replace("FAULT", fault));
        let key = format!("sensor.dvl.simulation.{key}");
        fails_with(&run(&recording, &[]), &["rest.toml:14", &key, remedy]);
    }
}

#[test]
fn a_standard_error_that_is_closed_is_no_panic() {
    let script = format!("{} run no-such.toml 2>&-; exit $?", env!("CARGO_BIN_EXE_navfuse"));
    let output =
        std::process::Command::new("sh").arg("-c").arg(script).output().expect("sh starts");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_gate_or_an_adaptive_noise_of_a_sensor_that_corrects_nothing_is_refused() {
    for key in ["gate = 0.99", "adaptive_noise = true"] {
        let recording = Recording::new();
        let noise = "accel_noise = \"10 ug/sqrt(Hz)\"";
        recording.change(noise, &format!("{noise}\n{key}"));
        fails_with(
            &run(&recording, &[]),
            &["rest.toml:11", &format!("sensor.imu.{key}"), "corrects the state"],
        );
    }
}

#[test]
fn what_a_source_refuses_is_named_with_the_line_of_its_table() {
    let recording = Recording::new();
    std::fs::remove_file(recording.path("imu.csv")).expect("it is there");
    fails_with(
        &run(&recording, &[]),
        &["rest.toml:", "source.csv: [sensor.imu]", "imu.csv", "files.imu.path"],
    );
    let pan_wu = crate::common::scenario("pan-wu-3d").display().to_string();
    for (setting, parts) in [
        (
            "source.simulation.segments=[]",
            ["--set source.simulation.segments = []: ", "the table is empty"],
        ),
        (
            "source.simulation.start.latitude=95 deg",
            ["--set source.simulation.start.latitude = \"95 deg\": ", "within 89 deg"],
        ),
        ("estimator.stop=10 s", ["estimator.stop = 10", "before estimator.start = 600"]),
    ] {
        fails_with(&navfuse(&["run", &pan_wu, "--no-output", "--set", setting]), &parts);
    }
}

#[test]
fn two_sinks_of_one_file_are_rejected_before_either_opens_it() {
    let recording = Recording::new();
    std::fs::create_dir(recording.path("out")).expect("the test can write");
    recording.write("out/run.mcap", "an earlier run");
    for (first, second) in [("run.mcap", "run.mcap"), ("run.mcap", "../out/./run.mcap")] {
        let sinks = format!(
            "sink={{ mcap = {{ path = {first:?} }}, copy = {{ type = \"mcap\", path = {second:?} }} }}"
        );
        let output = run(&recording, &["--set", &sinks]);
        fails_with(&output, &["[sink.mcap]", "[sink.copy]", "run.mcap", "`path`"]);
        let kept = std::fs::read_to_string(recording.path("out/run.mcap"));
        assert_eq!(kept.expect("it is there"), "an earlier run");
    }
    std::fs::remove_file(recording.path("out/run.mcap")).expect("it is there");
    let apart = "sink={ mcap = {}, copy = { type = \"mcap\", path = \"copy.mcap\" } }";
    let output = run(&recording, &["--set", apart]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(recording.path("out/copy.mcap").is_file());
}

#[cfg(feature = "rerun")]
#[test]
fn two_recordings_for_the_viewer_in_one_file_are_rejected_before_either_opens_it() {
    let recording = Recording::new();
    std::fs::create_dir(recording.path("out")).expect("the test can write");
    recording.write("out/run.rrd", "an earlier run");
    let sinks = "sink={ a = { type = \"rerun\" }, b = { type = \"rerun\" } }";
    fails_with(&run(&recording, &["--set", sinks]), &["[sink.a]", "[sink.b]", "run.rrd", "`path`"]);
    let kept = std::fs::read_to_string(recording.path("out/run.rrd"));
    assert_eq!(kept.expect("it is there"), "an earlier run");
}
