//! The command as a user calls it.

use crate::common::recording::Recording;
use crate::common::{command, navfuse, root, scenario, stderr, stdout};
use navfuse_core::units::{AccelerationNoise, AngularRateNoise, Length, Speed};
use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant};

/// Runs a scenario with JSON output into a folder and returns the object.
fn run_json(scenario: &Path, out: &Path, more: &[&str]) -> Value {
    let output = command()
        .arg("run")
        .arg(scenario)
        .arg("--format=json")
        .arg("--out")
        .arg(out)
        .args(more)
        .output();
    let output = output.expect("the command starts");
    assert!(output.status.success(), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).expect("standard output is one JSON object")
}

/// A short simulated run with all sensors of the quickstart.
const SHORT: [&str; 2] = ["--set", "estimator.stop=200 s"];

#[test]
fn json_has_every_documented_key_and_nothing_else_is_on_standard_output() {
    let folder = tempfile::tempdir().expect("a folder");
    let result = run_json(&scenario("quickstart"), folder.path(), &SHORT);
    for key in ["duration_s", "distance_m", "wall_s"] {
        assert!(result[key].is_number(), "{key}: {}", result[key]);
    }
    assert_eq!(result["scenario"], "quickstart");
    assert_eq!(result["samples"]["imu"]["read"], 20000);
    assert_eq!(result["samples"]["imu"]["used"], 14000);
    for key in ["read", "accepted", "gated", "rejected", "mean_nis"] {
        assert!(result["samples"]["dvl"][key].is_number(), "{key}");
    }
    let units = [
        ("ins.attitude", "deg", 3),
        ("ins.velocity", "m/s", 3),
        ("ins.position", "m", 3),
        ("ins.gyro_bias", "deg/h", 3),
        ("ins.accel_bias", "ug", 3),
        ("dvl.scale", "", 1),
        ("dvl.misalignment", "deg", 3),
    ];
    for (state, unit, length) in units {
        let value = &result["states"][state];
        assert_eq!(value["unit"], unit, "{state}");
        for key in ["components", "estimate", "sigma", "error"] {
            assert_eq!(
                value[key].as_array().map(Vec::len),
                Some(length),
                "{state}.{key}: {}",
                value[key]
            );
        }
    }
    for key in ["final", "rms", "percent_of_distance"] {
        assert!(result["horizontal_error_m"][key].is_number(), "{key}");
    }
    assert_eq!(result["states"]["ins.attitude"]["components"][2], "yaw");
    assert_eq!(result["states"]["ins.position"]["error_components"][2], "down");
    assert_eq!(result["frame"], "ned");
    assert_eq!((&result["seed"], &result["verdict"]["level"]), (&1.into(), &"consistent".into()));
    assert_eq!(result["version"], env!("CARGO_PKG_VERSION"));
    let log = result["paths"].as_array().and_then(|p| p.iter().find(|p| p["sink"] == "mcap"));
    let log = log.and_then(|p| p["path"].as_str()).expect("the path of the log");
    assert!(Path::new(log).is_file());
    assert!(result["warnings"].is_array());
}

#[test]
fn a_run_that_must_not_be_used_ends_with_the_exit_code_3_unless_that_is_accepted() {
    let path = scenario("quickstart").display().to_string();
    let run = |more: &[&str]| {
        // a quarter turn about down
        let turned = "sensor.dvl.samples={ axes = [\"y\", \"-x\", \"z\"] }";
        let turned = ["--set", turned, "--no-output"];
        navfuse(&[&["run", &path], &SHORT[..], &turned, more].concat())
    };
    let refused = run(&[]);
    assert_eq!(refused.status.code(), Some(3), "{}", stderr(&refused));
    let text = stdout(&refused);
    let last = text.lines().last().expect("a verdict");
    assert!(last.starts_with("verdict: do not use: dvl"), "{last}");
    assert_eq!(run(&["--accept-inconsistent"]).status.code(), Some(0));
    let json = run(&["--format=json"]);
    assert_eq!(json.status.code(), Some(3));
    let json: Value = serde_json::from_str(&stdout(&json)).expect("one object");
    assert_eq!(json["verdict"]["level"], "do_not_use");
    assert_eq!(json["verdict"]["reasons"][0]["about"], "dvl");
    let consistent = navfuse(&[&["run", &path, "--no-output"], &SHORT[..]].concat());
    assert_eq!(consistent.status.code(), Some(0));
    assert_eq!(stdout(&consistent).lines().last(), Some("verdict: consistent"));
}

#[test]
fn errors_are_null_where_there_is_no_reference() {
    let recording = Recording::new();
    recording.change(
        "attitude = { sigma = \"0.1 deg\" }\n\
         velocity = { sigma = \"1 cm/s\" }\n\
         position = { sigma = \"1 m\" }",
        "attitude = { sigma = \"0.1 deg\", initial = \"0 deg\" }\n\
         velocity = { sigma = \"1 cm/s\", initial = \"0 m/s\" }\n\
         position = { sigma = \"1 m\", latitude = \"30 deg\", longitude = \"5 deg\", \
         height = \"0 m\" }",
    );
    let result = run_json(
        &recording.path("rest.toml"),
        &recording.path("out"),
        &["--set", "sensor.reference.enabled=false"],
    );
    assert!(result["horizontal_error_m"].is_null());
    assert!(result["states"]["ins.velocity"]["error"].is_null());
    assert!(result["states"]["dvl.scale"]["error"].is_null());
}

#[test]
fn the_text_has_the_table_the_drift_the_nis_and_where_it_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    let output = navfuse(&[
        "run",
        &scenario("quickstart").display().to_string(),
        "--out",
        &out,
        SHORT[0],
        SHORT[1],
    ]);
    let text = stdout(&output);
    for part in ["dvl.misalignment", "yaw", "1-sigma", "mean NIS", "% of the distance", "run.mcap"]
    {
        assert!(text.contains(part), "no {part:?} in:\n{text}");
    }
    #[cfg(feature = "rerun")]
    assert!(text.contains("run.rrd"), "{text}");
}

#[test]
fn the_same_seed_gives_the_same_log_to_the_byte_and_another_seed_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = |name: &str, seed: &str| {
        let out = folder.path().join(name);
        run_json(&scenario("quickstart"), &out, &[SHORT[0], SHORT[1], "--set", seed]);
        std::fs::read(out.join("run.mcap")).expect("the log is there")
    };
    let first = log("a", "seed=5");
    assert!(first == log("b", "seed=5"), "the same seed gave another log");
    assert!(first != log("c", "seed=6"), "another seed gave the same log");
}

#[test]
fn replay_reproduces_every_estimate_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, replay) = (folder.path().join("run"), folder.path().join("replay"));
    let csv = ["--set", "sink.csv.enabled=true"];
    let mut first = run_json(&scenario("quickstart"), &run, &[SHORT[0], SHORT[1], csv[0], csv[1]]);
    let output = command()
        .arg("replay")
        .arg(run.join("run.mcap"))
        .args(["--format=json", csv[0], csv[1], "--out"])
        .arg(&replay)
        .output()
        .expect("the command starts");
    assert!(output.status.success(), "{}", stderr(&output));
    let mut second: Value = serde_json::from_str(&stdout(&output)).expect("one JSON object");
    for value in [&mut first, &mut second] {
        value["wall_s"].take();
        value["paths"].take();
        value["warnings"].take();
        // the source of a replay is the log, not a simulation
        value["seed"].take();
    }
    assert_eq!(first, second);
    for file in ["estimate.csv", "innovations.csv"] {
        let read = |folder: &Path| std::fs::read(folder.join(file)).expect("the sink wrote it");
        assert!(read(&run) == read(&replay), "{file} differs");
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_reports_it_and_leaves_a_log_that_opens() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut child = command()
        .arg("run")
        .arg(scenario("pan-wu-3d"))
        .arg("--out")
        .arg(folder.path())
        .args(["--set", "sensor.imu.simulation.rate=1 kHz", "--set", "estimator.start=0 s"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the command starts");
    let [log, part] = ["run.mcap", "run.mcap.part"].map(|name| folder.path().join(name));
    let begun = Instant::now();
    while std::fs::metadata(&part).map_or(0, |m| m.len()) < 1_000_000
        && begun.elapsed() < Duration::from_secs(60)
    {
        std::thread::sleep(Duration::from_millis(2));
    }
    std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .expect("kill");
    let status = child.wait().expect("it ends");
    assert_eq!(status.code(), Some(130));
    let again = navfuse(&["replay", &log.display().to_string(), "--format=json", "--no-output"]);
    assert!(again.status.success(), "{}", stderr(&again));
    let result: Value = serde_json::from_str(&stdout(&again)).expect("one JSON object");
    assert!(result["samples"]["imu"]["read"].as_u64() > Some(1000), "{result}");
}

#[test]
fn check_prints_the_composition_and_runs_nothing() {
    let output = navfuse(&["check", &scenario("pan-wu-3d").display().to_string()]);
    let text = stdout(&output);
    for part in [
        "19 error states",
        "dvl.misalignment",
        "ins.gyro_bias",
        "vel_x_mps",
        "driven by imu",
        "simulation",
        "mcap",
    ] {
        assert!(text.contains(part), "no {part:?} in:\n{text}");
    }
}

#[test]
fn list_prints_every_type_and_the_parameters_of_one_with_unit_default_and_meaning() {
    let all = stdout(&navfuse(&["list"]));
    for name in ["ins", "imu", "dvl", "depth", "reference", "simulation", "csv", "mcap"] {
        assert!(all.contains(name), "no {name} in:\n{all}");
    }
    let dvl = stdout(&navfuse(&["list", "dvl"]));
    for part in
        ["noise", "scale", "misalignment", "lever_arm", "gate", "0.9999", "cm/s", "(required)"]
    {
        assert!(dvl.contains(part), "no {part:?} in:\n{dvl}");
    }
    let output = navfuse(&["list", "dvk"]);
    assert!(
        !output.status.success() && stderr(&output).contains("did you mean \"dvl\"?"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn every_scenario_fits_the_schema_and_a_misspelt_key_does_not() {
    let schema: Value =
        serde_json::from_str(&stdout(&navfuse(&["schema"]))).expect("the schema is JSON");
    let validator = jsonschema::validator_for(&schema).expect("the schema is one");
    let folders = ["scenarios", "scenarios/observability", "scenarios/faults"]
        .map(|f| std::fs::read_dir(root().join(f)).expect("a folder"));
    let paths = folders.into_iter().flatten().map(|entry| entry.expect("a file").path());
    for path in paths.filter(|path| path.extension().is_some_and(|e| e == "toml")) {
        let text = std::fs::read_to_string(&path).expect("a scenario");
        let value = serde_json::to_value(toml::from_str::<toml::Table>(&text).expect("TOML"))
            .expect("JSON");
        let errors: Vec<String> =
            validator.iter_errors(&value).map(|e| format!("{}: {e}", e.instance_path())).collect();
        assert!(errors.is_empty(), "{}: {errors:#?}", path.display());
        let wrong = serde_json::to_value(
            toml::from_str::<toml::Table>(&format!("{text}\n[sensor.dvl.gaet]\n")).expect("TOML"),
        );
        assert!(
            !validator.is_valid(&wrong.expect("JSON")),
            "{}: a misspelt key fits",
            path.display()
        );
    }
}

/// The first reference to a pattern in a schema.
fn pattern(schema: &Value) -> Option<&str> {
    match schema {
        Value::Object(map) => {
            let own = map.get("$ref").and_then(Value::as_str);
            let own =
                own.and_then(|r| r.strip_prefix("#/$defs/")).filter(|r| r.contains("pattern"));
            own.or_else(|| map.values().find_map(pattern))
        }
        Value::Array(items) => items.iter().find_map(pattern),
        _ => None,
    }
}

/// The schema marks what the program rejects, and nothing that it accepts: every unit of a list, and
/// every quotient of two and of three of them, with squares and roots below the line.
#[test]
fn the_schema_and_the_program_accept_the_same_units() {
    let schema: Value =
        serde_json::from_str(&stdout(&navfuse(&["schema"]))).expect("the schema is JSON");
    let accepts = |table: &str, key: &str| {
        let own = &schema["$defs"][table]["properties"][key];
        let pattern = pattern(own).unwrap_or_else(|| panic!("{table}.{key}: {own}"));
        jsonschema::validator_for(&schema["$defs"][pattern]).expect("a schema")
    };
    let schemas = [
        accepts("sensor.depth", "noise"),
        accepts("sensor.dvl", "noise"),
        accepts("sensor.imu", "gyro_noise"),
        accepts("sensor.imu", "accel_noise"),
    ];
    let program = |text: &str| {
        [
            text.parse::<Length>().is_ok(),
            text.parse::<Speed>().is_ok(),
            text.parse::<AngularRateNoise>().is_ok(),
            text.parse::<AccelerationNoise>().is_ok(),
        ]
    };
    let above = ["m", "cm", "µm", "ft", "s", "h", "Hz", "deg", "°", "rad", "ug", "kn", "rpm", "kg"];
    let mut units: Vec<String> = above.map(str::to_owned).to_vec();
    let below = ["s", "h", "Hz", "m"].map(|u| [u.into(), format!("{u}^2"), format!("sqrt({u})")]);
    let below = below.concat();
    for a in above {
        for b in &below {
            units.push(format!("{a}/{b}"));
            units.extend(below.iter().map(|c| format!("{a} / {b}/{c}")));
        }
    }
    let mut accepted = [0; 4];
    for unit in units {
        let text = format!("1.5e-2 {unit}");
        let both = schemas.iter().zip(program(&text)).zip(&mut accepted);
        for (k, ((schema, expected), count)) in both.enumerate() {
            assert_eq!(schema.is_valid(&text.as_str().into()), expected, "{k}: {text:?}");
            *count += i32::from(expected);
        }
    }
    assert!(accepted.iter().all(|count| *count > 10), "{accepted:?}");
    for text in ["1 m", "1", "m/s", "1,5 m/s", "nan m/s", "1 m/s now"] {
        assert!(!schemas[1].is_valid(&text.into()), "{text:?} is no speed");
    }
    for text in ["-.5 m/s", "1. kn", "1E3 m*Hz", "2 m·s^-1", "3 1/s*m", "4 sqrt(m^2/s^2)"] {
        assert!(schemas[1].is_valid(&text.into()) && program(text)[1], "{text:?} is a speed");
    }
}

/// A sensor of increments and one of mean rates hold the same information: the estimates agree to
/// rounding, which after 20,000 steps and the filter's gains is below a thousandth of a sigma.
#[test]
fn an_imu_of_increments_is_as_good_as_one_of_rates() {
    let folder = tempfile::tempdir().expect("a folder");
    let rates = run_json(&scenario("quickstart"), &folder.path().join("rates"), &SHORT);
    let more = [SHORT[0], SHORT[1], "--set", "sensor.imu.output=increments"];
    let increments = run_json(&scenario("quickstart"), &folder.path().join("increments"), &more);
    for (state, value) in rates["states"].as_object().expect("the states") {
        let numbers = |v: &Value| {
            v.as_array().map_or_else(Vec::new, |a| a.iter().filter_map(Value::as_f64).collect())
        };
        let other = &increments["states"][state];
        let sigmas: Vec<f64> = numbers(&value["sigma"]);
        for ((a, b), sigma) in
            numbers(&value["error"]).iter().zip(numbers(&other["error"])).zip(sigmas)
        {
            assert!((a - b).abs() <= 1e-3 * sigma, "{state}: {a} and {b} with sigma {sigma}");
        }
    }
    let log = folder.path().join("increments").join("run.mcap");
    let again = navfuse(&["replay", &log.display().to_string(), "--format=json", "--no-output"]);
    let again: Value = serde_json::from_str(&stdout(&again)).expect("one JSON object");
    assert_eq!(again["states"], increments["states"]);
}

#[test]
fn a_reference_between_two_imu_samples_starts_the_filter_and_is_compared_at_its_own_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let more = [SHORT[0], SHORT[1], "--set", "sensor.reference.simulation.offset=5 ms"];
    let result = run_json(&scenario("quickstart"), folder.path(), &more);
    // from the reference at 60.005 s to the last IMU sample at 200 s
    assert_eq!(result["duration_s"], 139.995);
}

/// `--connect` sets the address in the table of the one sink for the viewer, whatever its name is.
#[cfg(feature = "rerun")]
#[test]
fn a_live_view_changes_the_one_sink_for_the_viewer() {
    let recording = Recording::new();
    let run = |sinks: &str, live: &[&str]| {
        let (scenario, out) = (recording.path("rest.toml"), recording.path("out"));
        let mut command = command();
        command.arg("run").arg(scenario).arg("--out").arg(out);
        command.args(["--set", &format!("sink={sinks}")]).args(live);
        command.output().expect("the command starts")
    };
    let rejected = |sinks: &str, live: &[&str], parts: &[&str]| {
        let output = run(sinks, live);
        assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
        for part in parts {
            assert!(stderr(&output).contains(part), "no {part:?} in: {}", stderr(&output));
        }
    };
    // no sink, or several, that the option could change: nothing is opened
    let connect = ["--connect", "127.0.0.1:1"];
    let two = "{ one = { type = \"rerun\" }, two = { type = \"rerun\", path = \"two.rrd\" } }";
    rejected(two, &connect, &["--connect", "[sink.one]", "[sink.two]", "disable"]);
    rejected("{ rerun = { enabled = false } }", &["--serve"], &["--serve", "disables"]);
    assert!(!recording.path("out").exists());
    // nothing listens at port 1, and the error names the table whose sink tried it
    rejected("{ viewer = { type = \"rerun\" } }", &connect, &["sink.viewer", "127.0.0.1:1"]);
    rejected("{}", &connect, &["127.0.0.1:1"]);
    let output = run("{ viewer = { type = \"rerun\" } }", &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(recording.path("out/run.rrd").is_file());
}
