//! Files from a stranger: a log can do nothing but be read, and no text reaches the terminal's
//! controls.

use crate::common::recording::Recording;
use crate::common::{command, stderr, stdout};
use crate::nothing_lost::run;

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

#[test]
fn no_control_character_of_a_file_reaches_a_page() {
    let recording = Recording::new();
    let rest = std::fs::read_to_string(recording.path("rest.toml")).expect("the scenario");
    let name = "a\\u001b[31mb\\u009b2Jc\\u202ed";
    let named = rest.replace("[sensor.dvl]", &format!("[sensor.\"{name}\"]\ntype = \"dvl\""));
    let named = named.replace("files.dvl", &format!("files.\"{name}\""));
    recording.write("rest.toml", &format!("name = \"{name}\"\n{named}"));
    let output = run(&recording, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    for arguments in [
        &["report", "out/run.mcap", "--out", "page.html"][..],
        &["compare", "out/run.mcap", "out/run.mcap", "--out", "."],
    ] {
        let output = command().current_dir(recording.folder()).args(arguments).output();
        let output = output.expect("the command starts");
        assert!(output.status.success(), "{}", stderr(&output));
    }
    for page in ["page.html", "compare.html"] {
        let text = std::fs::read_to_string(recording.path(page)).expect("the page");
        let obeyed = |c: char| c != '\n' && (c.is_control() || c == '\u{202e}');
        assert!(!text.contains(obeyed) && text.contains("[31mb"), "{page}");
    }
}

/// A text of such a path names another file, or none.
#[cfg(target_os = "linux")]
#[test]
fn a_path_that_is_not_utf8_is_kept_or_refused() {
    use std::os::unix::ffi::OsStrExt;
    let recording = Recording::new();
    let out = std::path::Path::new(std::ffi::OsStr::from_bytes(b"out\xff"));
    let call = |name: &str, path: &std::path::Path, more: &[&str]| {
        let mut command = command();
        command.current_dir(recording.folder()).arg(name).arg(path).args(more).arg("--out");
        command.arg(out).output().expect("the command starts")
    };
    let output = call("run", "rest.toml".as_ref(), &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    let log = out.join("run.mcap");
    assert!(recording.folder().join(&log).is_file());
    std::fs::copy(recording.path("rest.toml"), recording.folder().join(out).join("rest.toml"))
        .expect("the test can write");
    for (name, path, more) in [
        ("run", out.join("rest.toml"), &[][..]),
        ("replay", log.clone(), &[]),
        ("export", log.clone(), &["--to", "csv"]),
        ("observability", log.clone(), &[]),
        ("import", log, &[]),
    ] {
        let output = call(name, &path, more);
        assert_eq!(output.status.code(), Some(1), "{name}");
        assert!(stderr(&output).contains("rename the file"), "{name}: {}", stderr(&output));
    }
}
