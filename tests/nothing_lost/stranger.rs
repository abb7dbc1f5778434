//! Files from a stranger: a log can do nothing but be read, and no text reaches the terminal's
//! controls.

use crate::common::recording::Recording;
use crate::common::{command, stderr, stdout};
use crate::run;

#[test]
fn the_sinks_of_a_log_are_not_obeyed() {
    let recording = Recording::new();
    let [victim, tables] = ["mine.txt", "estimate.csv"].map(|name| recording.path(name));
    let sinks = [
        format!("sink.copy={{ type = \"mcap\", path = {:?} }}", victim.display().to_string()),
        "sink.mcap.enabled=true".to_owned(),
        "sink.csv.enabled=true".to_owned(),
        "sink.rerun.path=other.rrd".to_owned(),
    ];
    let output = run(&recording, &sinks.each_ref().map(|sink| ["--set", sink]).concat());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(victim.is_file() && recording.path("out/estimate.csv").is_file());
    std::fs::write(&victim, "mine").expect("the test can write");
    let log = recording.path("out/run.mcap");
    let replay = |more: &[&str]| {
        let mut replay = command();
        replay.arg("replay").arg(&log).arg("--out").arg(recording.path("again")).args(more);
        let output = replay.output().expect("the command starts");
        assert!(output.status.success(), "{}", stderr(&output));
    };
    replay(&[]);
    assert_eq!(std::fs::read_to_string(&victim).expect("it is still there"), "mine");
    assert!(recording.path("again/run.mcap").is_file());
    assert!(!recording.path("again/other.rrd").exists() && !tables.exists());
    assert!(!recording.path("again/estimate.csv").exists());
    // whoever replays decides
    replay(&["--set", "sink.csv.enabled=true"]);
    assert!(recording.path("again/estimate.csv").is_file());
}

#[test]
fn no_control_character_of_a_file_reaches_the_terminal() {
    let recording = Recording::new();
    // an escape sequence, its form of one byte, and a change of the direction of writing
    let name = "a\\u001b[31mb\\u009b2Jc\\u202ed";
    let text = std::fs::read_to_string(recording.path("rest.toml")).expect("the scenario");
    recording.write("rest.toml", &format!("name = \"{name}\"\n{text}"));
    let harmless =
        |text: &str| text.chars().all(|c| c == '\n' || !(c.is_control() || c == '\u{202e}'));
    let output = run(&recording, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    let printed = stdout(&output);
    assert!(harmless(&printed) && printed.contains(name), "{printed:?}");
    let printed = stdout(&run(&recording, &["--format=json"]));
    assert!(harmless(&printed), "{printed:?}");
    let json: serde_json::Value = serde_json::from_str(&printed).expect("one JSON object");
    assert_eq!(json["scenario"], "a\u{1b}[31mb\u{9b}2Jc\u{202e}d");
    recording.write("rest.toml", &format!("{text}\n[sensor.\"{name}\"]\n"));
    let message = stderr(&run(&recording, &[]));
    assert!(harmless(&message) && message.contains("31mb"), "{message:?}");
}
