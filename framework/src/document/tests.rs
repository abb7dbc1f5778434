#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use super::*;
use crate::units::{AngularRateNoise, Length, Sigma, Triple};
use proptest::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

const TEXT: &str = r#"# a scenario
name = "a"

[process.ins]
gyro_noise = "0.1 deg"

[sensor.dvl]
noise = 3
lever_arm = ["1 m",
             "2 m/s",
             "3 m"]
extra = { gaet = 1 }

[[trajectory.segments]]
kind = "dive"
duration = 1

[[trajectory.segments]]
kind = "clmib"
duration = -4

[sensor."odd name".a.b]
c = true
"#;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)] // only read
struct Ins {
    gyro_noise: AngularRateNoise,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)] // only read
struct Dvl {
    noise: f64,
    lever_arm: Option<Triple<Length>>,
    extra: Option<Extra>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)] // only read
struct Extra {
    gate: Option<f64>,
    scale: Option<u32>,
}

#[derive(Debug, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Dive,
    Climb,
}

#[derive(Debug, Deserialize)]
#[allow(dead_code)] // only read
struct Segment {
    kind: Kind,
    duration: u32,
}

fn document() -> Document {
    Document::parse("scenarios/a.toml", TEXT).unwrap()
}

fn at<'a>(document: &'a Document, path: &[&str]) -> Node<'a> {
    path.iter().fold(document.root(), |node, key| node.get(key).unwrap())
}

fn error<T: serde::de::DeserializeOwned + std::fmt::Debug>(node: &Node<'_>) -> String {
    node.parse::<T>().unwrap_err().to_string()
}

#[test]
fn an_error_names_file_line_key_what_was_found_and_what_is_allowed() {
    let d = document();
    assert_eq!(
        error::<Ins>(&at(&d, &["process", "ins"])),
        "scenarios/a.toml:5: process.ins.gyro_noise = \"0.1 deg\": found 'deg' which is an angle, \
         an angular rate noise is needed, e.g. deg/h/sqrt(Hz), deg/sqrt(h), rad/s/sqrt(Hz)"
    );
    // keys are read in the order of the file: of two mistakes the first is reported
    let dvl = at(&d, &["sensor", "dvl"]);
    assert_eq!(
        error::<Dvl>(&dvl),
        "scenarios/a.toml:10: sensor.dvl.lever_arm.1 = \"2 m/s\": found 'm/s' which is a speed, \
         a length is needed, \
         e.g. m, cm, km"
    );
    assert_eq!(
        error::<Dvl>(&dvl.only(&["noise", "extra"])),
        "scenarios/a.toml:12: sensor.dvl.extra.gaet: unknown key \"gaet\"; did you mean \
         \"gate\"? (allowed: gate, scale)"
    );
    assert_eq!(
        error::<Dvl>(&dvl.only(&[])),
        "scenarios/a.toml:7: sensor.dvl: missing key \"noise\""
    );
    assert_eq!(
        error::<Extra>(&dvl.only(&["extra"])),
        "scenarios/a.toml:12: sensor.dvl.extra: unknown key \"extra\" (allowed: gate, scale)"
    );
    assert_eq!(
        error::<bool>(&at(&d, &["sensor", "dvl", "noise"])),
        "scenarios/a.toml:8: sensor.dvl.noise = 3: found a whole number, expected true or false"
    );
    assert_eq!(
        error::<String>(&dvl),
        "scenarios/a.toml:7: sensor.dvl: found a table, expected a string"
    );
    assert_eq!(
        error::<u32>(&at(&d, &["trajectory", "segments", "1", "duration"])),
        "scenarios/a.toml:20: trajectory.segments.1.duration = -4: expected a whole number, not \
         negative"
    );
    assert_eq!(
        error::<Vec<Segment>>(&at(&d, &["trajectory", "segments"])),
        "scenarios/a.toml:19: trajectory.segments.1.kind = \"clmib\": unknown value \"clmib\"; \
         did you mean \"climb\"? (allowed: dive, climb)"
    );
    assert_eq!(
        error::<Kind>(&at(&d, &["sensor", "dvl", "noise"])),
        "scenarios/a.toml:8: sensor.dvl.noise = 3: found a whole number, expected a string"
    );
    assert_eq!(
        error::<Triple<Length>>(&at(&d, &["sensor", "odd name", "a", "b", "c"])),
        "scenarios/a.toml:23: sensor.\"odd name\".a.b.c = true: found a boolean, \
         expected one value for all three axes, or an array of three"
    );
    assert_eq!(
        error::<BTreeMap<String, BTreeMap<String, f64>>>(&at(&d, &["sensor"])),
        "scenarios/a.toml:9: sensor.dvl.lever_arm = [\"1 m\", \"2 m/s\", \"3 m\"]: found an \
         array, expected a number"
    );
}

#[test]
fn keys_that_another_reader_takes_are_hidden_but_listed_as_allowed() {
    let d = document();
    let node = at(&d, &["sensor", "dvl"]).without(&["noise", "lever_arm"]);
    assert_eq!(
        error::<Extra>(&node),
        "scenarios/a.toml:12: sensor.dvl.extra: unknown key \"extra\" (allowed: gate, scale, \
         noise, lever_arm)"
    );
    assert_eq!(
        d.root().check_keys(&["name", "proces", "sensor", "trajectory"]).unwrap_err().to_string(),
        "scenarios/a.toml:4: process: unknown key \"process\"; did you mean \"proces\"? \
         (allowed: name, proces, sensor, trajectory)"
    );
    assert!(
        at(&d, &["name"])
            .check_keys(&[])
            .unwrap_err()
            .to_string()
            .contains("found a string, a table is needed")
    );
}

#[test]
fn entries_come_in_the_order_of_the_file() {
    let d = Document::parse("o", "[z]\n[a]\nm = 1\nb.y = 2\nb.x = 3\n[z.q]").unwrap();
    let keys = |node: Node<'_>| {
        node.entries().unwrap().into_iter().map(|(key, _)| key.to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(keys(d.root()), ["z", "a"]);
    assert_eq!(keys(at(&d, &["a"])), ["m", "b"]);
    assert_eq!(keys(at(&d, &["a", "b"])), ["y", "x"]);
}

#[test]
fn an_override_is_applied_and_errors_name_it() {
    let mut d = document();
    for set in [
        "process.ins.gyro_noise=0.1 deg/h/sqrt(Hz)",
        "trajectory.segments.1.duration = 7",
        "sensor.dvl.extra={ gate = 2.5 }",
        "sensor.depth.bias.sigma=-5 cm",
        "sensor.\"odd name\".flag=true",
        "label=x=y",
    ] {
        d.set(set).unwrap_or_else(|e| panic!("{e}"));
    }
    assert!(at(&d, &["process", "ins"]).parse::<Ins>().is_ok());
    assert_eq!(at(&d, &["trajectory", "segments", "1", "duration"]).parse::<u32>().unwrap(), 7);
    assert_eq!(at(&d, &["sensor", "dvl", "extra"]).parse::<Extra>().unwrap().gate, Some(2.5));
    assert_eq!(at(&d, &["label"]).value().as_str(), Some("x=y"));
    let sigma = at(&d, &["sensor", "depth", "bias", "sigma"]);
    assert_eq!(
        error::<Sigma<Length>>(&sigma),
        "--set sensor.depth.bias.sigma = \"-5 cm\": a sigma cannot be negative: -0.05 m"
    );
    assert!(
        error::<Ins>(&at(&d, &["sensor", "depth"]))
            .starts_with("--set sensor.depth.bias.sigma: sensor.depth")
    );
    assert_eq!(
        error::<f32>(&at(&d, &["sensor", "dvl", "extra"])),
        "--set sensor.dvl.extra: found a table, expected a number"
    );
    // neighbours keep their lines
    assert_eq!(
        at(&d, &["trajectory", "segments", "1", "kind"]).location().to_string(),
        "scenarios/a.toml:19"
    );
    assert_eq!(d.overrides().len(), 6);
    assert_eq!(d.text(), TEXT);
    let effective = Document::parse("effective", d.to_toml()).unwrap();
    assert_eq!(effective.root().value(), d.root().value());
}

#[test]
fn a_malformed_override_is_refused_and_changes_nothing() {
    let mut d = document();
    let before = d.to_toml();
    for (set, reason) in [
        ("name", "`key.path=value` is needed"),
        ("=1", "not a key path"),
        ("a..b=1", "not a key path"),
        ("a b=1", "not a key path"),
        ("[x]\na=1", "not a key path"),
        ("name=", "a value is needed"),
        ("name=\"x", "the value is not TOML"),
        ("name=[1, 2", "the value is not TOML"),
        ("name.first=1", "name is a string, not a table"),
        (
            "trajectory.segments.2.duration=1",
            "trajectory.segments has 2 elements, counted from 0: there is no 2",
        ),
        ("trajectory.segments.first=1", "there is no first"),
    ] {
        let error = d.set(set).unwrap_err().to_string();
        assert!(error.starts_with(&format!("--set {set}: ")) && error.contains(reason), "{error}");
    }
    assert!(d.set(&format!("{}=1", vec!["a"; 100_000].join("."))).is_err());
    assert_eq!(d.to_toml(), before);
    assert!(d.overrides().is_empty());
}

#[test]
fn a_syntax_error_names_line_and_column() {
    let syntax = |text: &str| Document::parse("b.toml", text).unwrap_err().to_string();
    assert!(
        syntax("a = 1\nb = = 2\n").starts_with("b.toml:2:5: "),
        "{}",
        syntax("a = 1\nb = = 2\n")
    );
    assert_eq!(syntax("a = 1\r\n\r\na = 2"), "b.toml:3:1: duplicate key");
    assert!(syntax("é = 1").starts_with("b.toml:1:1: "), "{}", syntax("é = 1"));
    assert!(
        syntax("a = 99999999999999999999").starts_with("b.toml:1:5: "),
        "{}",
        syntax("a = 99999999999999999999")
    );
    let missing = Document::from_file("no/such/file.toml").unwrap_err().to_string();
    assert!(missing.starts_with("no/such/file.toml: "), "{missing}");
}

#[test]
fn a_deeply_nested_text_is_refused() {
    for text in [
        format!("{} = 1", vec!["a"; 100_000].join(".")),
        format!("[{}]", vec!["a"; 100_000].join(".")),
        format!("a = {}", "[".repeat(100_000)),
        format!("a = {}1{}", "{b=".repeat(100_000), "}".repeat(100_000)),
    ] {
        assert!(Document::parse("deep", text).is_err());
    }
}

#[test]
fn the_name_gives_stem_and_folder() {
    let d = document();
    assert_eq!((d.stem().as_str(), d.folder()), ("a", Path::new("scenarios")));
}

#[test]
fn a_suggestion_is_near_or_none() {
    let allowed = ["gate", "noise", "scale", "Hz"];
    assert_eq!(did_you_mean("gaet", allowed), Some("gate"));
    assert_eq!(did_you_mean("Noise", allowed), Some("noise"));
    assert_eq!(did_you_mean("hz", allowed), Some("Hz"));
    assert_eq!(did_you_mean("temperature", allowed), None);
    assert_eq!(did_you_mean("", allowed), None);
}

proptest! {
    #[test]
    fn no_text_makes_the_document_panic(
        text in "\\PC{0,60}", toml in "[a-c.=\\[\\]{}\"' 0-9\n,-]{0,40}"
    ) {
        for text in [&text, &toml] {
            if let Ok(mut d) = Document::parse("any", text.as_str()) {
                let _ = d.set(&toml);
                let _ = d.to_toml();
                let _ = d.root().parse::<Ins>().map_err(|e| e.to_string());
                let _ = d.root().check_keys(&["a"]).map_err(|e| e.to_string());
            }
            let _ = document().set(text);
        }
    }
}

/// A folder with files, each a name and a text.
fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    folder
}

#[test]
fn a_file_is_laid_over_those_that_it_includes_and_errors_name_the_right_file() {
    let folder = folder(&[
        ("parts/sea.toml", "seed = 1\n[sensor.dvl]\nnoise = 3\ngate = 0.9\naxes = [1, 2]\n"),
        ("parts/imu.toml", "include = \"deeper/bias.toml\"\n[sensor.imu]\nnoise = 4\n"),
        ("parts/deeper/bias.toml", "[sensor.imu]\nnoise = 5\nbias = { sigma = 6, truth = 7 }\n"),
        (
            "run.toml",
            "include = [\"parts/sea.toml\", \"parts/imu.toml\"]\nseed = 2\n\
             [sensor.dvl]\naxes = [3]\n[sensor.imu.bias]\nsigma = 8\n",
        ),
    ]);
    let document = Document::from_file(folder.path().join("run.toml")).unwrap();
    let whole = Document::parse(
        "whole",
        "seed = 2\n[sensor.dvl]\nnoise = 3\ngate = 0.9\naxes = [3]\n\
         [sensor.imu]\nnoise = 4\nbias = { sigma = 8, truth = 7 }\n",
    )
    .unwrap();
    assert_eq!(document.root().value(), whole.root().value());
    let sensors = document.root().get("sensor").unwrap().entries().unwrap();
    assert_eq!(sensors.iter().map(|(name, _)| *name).collect::<Vec<_>>(), ["dvl", "imu"]);
    let place = |path: &[&str]| at(&document, path).location().to_string();
    assert!(place(&["sensor", "dvl", "gate"]).ends_with("parts/sea.toml:4"));
    assert!(place(&["sensor", "imu", "bias", "truth"]).ends_with("deeper/bias.toml:3"));
    assert!(place(&["sensor", "imu", "bias", "sigma"]).ends_with("run.toml:6"));
    assert!(place(&["sensor", "dvl", "axes"]).ends_with("run.toml:4"));
    // the second element of the included array is gone, and its place too
    assert!(at(&document, &["sensor", "dvl", "axes"]).get("1").is_none());
}

#[test]
fn a_circle_of_files_and_a_missing_one_are_rejected_at_the_line_that_names_them() {
    let folder = folder(&[
        ("a.toml", "seed = 1\ninclude = \"b.toml\"\n"),
        ("b.toml", "include = [\"./a.toml\"]\n"),
        ("c.toml", "include = \"d.toml\"\n"),
        ("e.toml", "include = 3\n"),
        ("f.toml", "include = \"g.toml\"\n"),
        ("g.toml", "x =\n"),
    ]);
    let error = |name: &str| {
        let error = Document::from_file(folder.path().join(name)).unwrap_err();
        error.to_string()
    };
    let circle = error("a.toml");
    assert!(circle.contains("b.toml:1: include.0"), "{circle}");
    assert!(circle.contains("a file includes itself"), "{circle}");
    let missing = error("c.toml");
    assert!(missing.contains("c.toml:1: include = \"d.toml\": "), "{missing}");
    assert!(missing.contains("relative to the file that includes it"), "{missing}");
    assert!(error("e.toml").contains("a path is needed"), "{}", error("e.toml"));
    assert!(error("f.toml").contains("g.toml:1:"), "{}", error("f.toml"));
}

/// The text of a log comes from a stranger, who must not choose files that are read.
#[test]
fn a_text_without_a_file_includes_nothing() {
    let document = Document::parse("log", "include = \"/etc/passwd\"\n").unwrap();
    assert!(document.root().get("include").is_some());
}

#[test]
fn an_excerpt_marks_the_value_or_the_unknown_key() {
    let text = "[sensor.dvl]\n\tnoise = \"1 kg\"  # of a sample\ngaet = 0.9\n";
    let document = Document::parse("dive.toml", text).unwrap();
    let noise = at(&document, &["sensor", "dvl", "noise"]).error("no");
    assert_eq!(
        noise.excerpt().unwrap().to_string(),
        "  |\n2 |  noise = \"1 kg\"  # of a sample\n  |          ^^^^^^"
    );
    let key = at(&document, &["sensor", "dvl"]).check_keys(&["noise"]).unwrap_err();
    assert_eq!(key.excerpt().unwrap().to_string(), "  |\n3 | gaet = 0.9\n  | ^^^^");
    let table = at(&document, &["sensor", "dvl"]).error("no");
    assert_eq!(table.excerpt().unwrap().to_string(), "  |\n1 | [sensor.dvl]\n  |         ^^^");
    let syntax = Document::parse("dive.toml", "a = 1\nb = \n").unwrap_err();
    assert!(syntax.excerpt().unwrap().to_string().contains("2 | b ="), "{syntax:?}");
}

#[test]
fn a_removed_path_is_gone_and_an_element_of_an_array_stays() {
    let mut document = Document::parse("a", "[x]\n\"y z\" = [{ a = 1, b = 2 }]\n").unwrap();
    assert!(document.remove_path("x.\"y z\".0.b"));
    assert!(!document.remove_path("x.\"y z\".0.b") && !document.remove_path("x.\"y z\".0"));
    let left = Document::parse("b", "[x]\n\"y z\" = [{ a = 1 }]\n").unwrap();
    assert_eq!(document.root().value(), left.root().value());
}

#[test]
fn a_renamed_path_keeps_its_place_and_those_below() {
    let text = "[sensor.refrence]\nrate = 3\n[sensor.dvl]\nx = 1\n";
    let mut document = Document::parse("a.toml", text).unwrap();
    assert!(document.rename_path("sensor.refrence", "reference"));
    assert!(!document.rename_path("sensor.dvl", "reference"), "the key is not free");
    assert!(!document.rename_path("sensor.none", "some"), "there is no such key");
    let rate = at(&document, &["sensor", "reference", "rate"]);
    assert_eq!(rate.location().to_string(), "a.toml:2");
    let names: Vec<_> = document.root().get("sensor").unwrap().entries().unwrap();
    assert_eq!(names.iter().map(|(n, _)| *n).collect::<Vec<_>>(), ["reference", "dvl"]);
}

#[test]
fn an_error_shows_60_characters_of_a_value_and_no_longer_array() {
    let error = |value: &str| {
        let document = Document::parse("a.toml", format!("x = {value}\n")).unwrap();
        at(&document, &["x"]).error("no").to_string()
    };
    let text = |length: usize| format!("{:?}", "ä".repeat(length));
    for length in [1, 60] {
        let found = error(&text(length));
        assert!(found.contains(&format!("x = {}: no", text(length))), "{found}");
    }
    let found = error(&text(61));
    assert!(found.contains(&format!("x = {}...: no", text(60))), "{found}");
    // 3 characters for each element: "[1, 1, 1]" has 9
    let array = |elements: &str| error(&format!("[{elements}{}1]", "1, ".repeat(18)));
    let found = array("1, ");
    assert!(found.contains("x = [1, 1") && found.contains(", 1]: no"), "{found}");
    assert!(!array("11, ").contains("x = ") && array("11, ").contains("x: no"), "{found}");
}
