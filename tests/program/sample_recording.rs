//! The sample recording in `scenarios/sample-dive`, and the tutorial that calibrates a DVL with it.

use crate::common::{navfuse, root, run_without_sinks, scenario, stderr, stdout};
use navfuse_core::document::Document;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Scale factor, then roll, pitch and yaw of the misalignment in degrees: the `truth` values of
/// `scenarios/sample-dive/simulation.toml`, which the recording's README states too.
const TRUTH: [f64; 4] = [1.006, 0.5, -0.8, 1.5];

/// Largest error of one component in sigma. A normal error is beyond it once in 2150 times, so that
/// one of four is once in 540. The files do not change, and so neither does the outcome.
const BOUND: f64 = 3.5;

/// Each sensor with the decimals of its channels: a hundredth of the noise of a sample or less.
const SENSORS: [(&str, [usize; 6]); 3] = [
    ("imu", [7, 7, 7, 5, 5, 5]), // rad/s, m/s^2
    ("dvl", [4; 6]),             // m/s
    ("depth", [3; 6]),           // m
];

fn folder() -> PathBuf {
    root().join("scenarios/sample-dive")
}

/// The text of a sensor's file, from the samples that the simulation gives with some settings.
fn simulated(sensor: &str, decimals: &[usize], settings: &[String]) -> String {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(folder().join("simulation.toml")).expect("a scenario");
    let scenario = Scenario::new(&registry, document, settings).expect("the settings fit");
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let sensors = &assembly.composition.sensors;
    let index = sensors.iter().position(|s| s.info.name == sensor).expect("the sensor is there");
    let channels = &sensors[index].info.channels;
    let mut text = "# Simulated, not recorded: see README.md in this folder.\ntime_s".to_owned();
    channels.iter().for_each(|c| text = format!("{text},{}", c.column()));
    text.push('\n');
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(index));
        while source.next(&mut sample).expect("a simulation does not fail") {
            if sample.sensor.0 != index {
                continue;
            }
            let _ = write!(text, "{:.2}", sample.time.seconds());
            for (channel, decimals) in (0..channels.len()).zip(decimals) {
                let value = sample.get(channel).expect("all channels are there");
                let _ = write!(text, ",{value:.decimals$}");
            }
            text.push('\n');
        }
    }
    text
}

/// The rows of a file's text as numbers.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let numbers =
        |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    text.lines().skip(2).map(numbers).collect()
}

/// `UPDATE=1` in the environment writes the files first.
#[test]
fn the_files_hold_what_the_simulation_gives() {
    for (sensor, decimals) in SENSORS {
        let (path, text) =
            (folder().join(format!("{sensor}.csv")), simulated(sensor, &decimals, &[]));
        if std::env::var_os("UPDATE").is_some() {
            std::fs::write(&path, &text).expect("the test can write");
        }
        let file = std::fs::read_to_string(&path).expect("the file is there");
        assert_eq!(file.lines().nth(1), text.lines().nth(1), "{sensor}: the headings differ");
        let (file, simulated) = (rows(&file), rows(&text));
        assert_eq!(file.len(), simulated.len(), "{sensor}: the number of samples differs");
        // another C library may round the last digit differently
        let units = decimals.map(|d| 1.01 * 0.1_f64.powi(i32::try_from(d).expect("a few")));
        for (row, expected) in file.iter().zip(&simulated) {
            let equal = row[0] == expected[0]
                && (row[1..].iter().zip(&expected[1..]).zip(&units))
                    .all(|((a, b), u)| (a - b).abs() < *u);
            assert!(equal, "{sensor}: the file has {row:?}, the simulation gives {expected:?}");
        }
    }
}

/// The filter finds scale factor and misalignment within their sigma, and each sigma is at most a
/// tenth of its prior: 1 % and 2 deg.
#[test]
fn the_filter_finds_the_true_calibration() {
    let finished = run_without_sinks(&scenario("csv-dvl"), &[]);
    assert!(finished.error.is_none(), "{:?}", finished.error);
    assert!(finished.events.is_empty(), "{:?}", finished.events);
    let rows = &finished.summary.rows;
    let of = |name: &str| rows.iter().find(|r| r.name == name).expect("it is estimated");
    let (scale, misalignment) = (of("dvl.scale"), of("dvl.misalignment"));
    let found = std::iter::once((scale.estimate[0], scale.sigma[0], 0.01))
        .chain((misalignment.estimate.iter().zip(&misalignment.sigma)).map(|(e, s)| (*e, *s, 2.0)));
    for (truth, (estimate, sigma, prior)) in TRUTH.into_iter().zip(found) {
        println!("{estimate:.5} +- {sigma:.5}, truth {truth}");
        assert!((estimate - truth).abs() < BOUND * sigma, "{estimate} +- {sigma}, truth {truth}");
        assert!(sigma < 0.1 * prior, "sigma {sigma}, prior {prior}");
    }
}

/// IO-DVLC finds them from IMU and DVL alone.
#[test]
fn the_calibration_method_finds_the_true_calibration() {
    let path = scenario("csv-dvl").display().to_string();
    let output = navfuse(&["calibrate", &path, "--format", "json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let json: Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    let method = &json["methods"][0];
    for (truth, key) in TRUTH.into_iter().zip(["k", "roll_deg", "pitch_deg", "yaw_deg"]) {
        let number =
            |of: &str| method[of][key].as_f64().unwrap_or_else(|| panic!("{of} {key}: {json}"));
        let (estimate, sigma) = (number("estimate"), number("sigma"));
        println!("{key}: {estimate:.5} +- {sigma:.5}, truth {truth}");
        assert!((estimate - truth).abs() < BOUND * sigma, "{key}: {estimate} +- {sigma}");
    }
}

/// An alignment finds the attitude during the run, and there is no reference: the methods have no
/// attitude to begin from, and must not take the block's value before the alignment for one.
#[test]
fn a_calibration_without_an_attitude_is_an_error() {
    let path = scenario("csv-dvl").display().to_string();
    let output = navfuse(&["calibrate", &path, "--set", "process.ins.alignment=static"]);
    let text = stderr(&output);
    assert!(!output.status.success() && text.contains("no initial attitude"), "{text}");
}

/// Imports samples without any answer, runs them, and returns the verdict with latitude (deg) at the end
/// and its sigma, m.
fn imported(files: &[PathBuf], folder: &Path) -> (String, f64, f64) {
    let dive = folder.join("dive.toml").display().to_string();
    let paths = files.iter().map(|file| file.display().to_string());
    let arguments: Vec<String> = ["import".to_owned()].into_iter().chain(paths).collect();
    let arguments: Vec<&str> =
        arguments.iter().map(String::as_str).chain(["--out", &dive]).collect();
    let output = navfuse(&arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let finished = run_without_sinks(Path::new(&dive), &[]);
    let verdict = finished.summary.verdict.text.clone();
    let row = finished.summary.rows.iter().find(|r| r.name == "ins.position").expect("it is there");
    (verdict, row.estimate[0], row.sigma[0])
}

/// The gyros find north by the Earth's rate, whose share along the vertical depends on the latitude. A
/// position that nobody gave is anywhere, so that they find the latitude too; with one that is 9.5 deg off
/// by 10 m the Earth's rate would be taken for steps of a gyro bias. The vehicle sails 1 km at most,
/// 0.01 deg, and three sigma are added.
#[test]
fn the_files_imported_without_any_answer_are_consistent_and_show_their_latitude() {
    let place = tempfile::tempdir().expect("a folder");
    let of = |folder: &Path| SENSORS.map(|(sensor, _)| folder.join(format!("{sensor}.csv")));
    let south = place.path().join("south");
    std::fs::create_dir(&south).expect("the test can write");
    for (sensor, decimals) in SENSORS {
        let there = ["source.simulation.start.latitude=\"-35 deg\"".to_owned()];
        let text = simulated(sensor, &decimals, &there);
        std::fs::write(south.join(format!("{sensor}.csv")), text).expect("the test can write");
    }
    for (files, latitude) in [(of(&folder()), 54.5), (of(&south), -35.0)] {
        let (verdict, found, sigma) = imported(&files, place.path());
        assert!(verdict.starts_with("consistent"), "{latitude}: {verdict}");
        let bound = 0.01 + 3.0 * sigma / 111_000.0;
        assert!(
            (found - latitude).abs() < bound && bound < 0.2,
            "{found} +- {sigma} m: {latitude}"
        );
        std::fs::remove_file(place.path().join("dive.toml")).expect("it is there");
    }
}

#[test]
fn the_tutorial_shows_the_scenario_as_it_is() {
    let page = root().join("docs/src/tutorials/csv-to-calibrated-dvl.md");
    let page = std::fs::read_to_string(page).expect("the page is there");
    let text = std::fs::read_to_string(scenario("csv-dvl")).expect("the scenario is there");
    let blocks: Vec<&str> =
        page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(blocks.len() > 3, "the page has {} blocks of TOML", blocks.len());
    for block in blocks {
        assert!(text.contains(block), "the scenario has not the page's\n{block}");
    }
}
