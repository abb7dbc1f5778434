//! One wording of a verdict in everything that shows it, and a run that is named by its folder.

use crate::common::{command, navfuse, scenario, stderr, stdout};
use navfuse_core::model::record::finding::Severity;
use serde_json::Value;
use std::path::Path;

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// The lever arm of the DVL is fixed at a wrong value, which the run finds and contains.
#[test]
fn a_contained_fault_has_one_wording_in_terminal_json_log_page_and_comparison() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let faulty = text(&scenario("faults/dvl-lever-arm"));
    let output = navfuse(&["run", &faulty, "--format=json", "--out", &text(&run)]);
    let result: Value = serde_json::from_str(&stdout(&output)).expect("JSON");
    let words = Severity::Contained.verdict();
    let line = result["verdict"]["text"].as_str().expect("a line");
    assert!(line.starts_with(&format!("{words}: dvl: ")), "{line}");
    assert_eq!(result["answers"]["usable"], "yes");

    let history = navfuse_report::read_log(&run.join("run.mcap"), |_| {}).expect("the log");
    let verdict = history.verdict.expect("a verdict");
    assert_eq!((verdict.words(), verdict.text.as_str()), (words, line));

    let output = navfuse(&["report", &text(&run)]);
    let printed = stdout(&output);
    assert_eq!(printed.lines().last(), Some(&*format!("verdict: {words}: dvl")));
    let page = std::fs::read_to_string(run.join("report.html")).expect("the page");
    assert!(page.contains(&format!("Verdict: <b>{words}</b>")));
    // a fault that is contained is no reason not to use the result
    assert!(
        !page.contains(r#"<li class="bad">contained"#) && page.contains("contained: <b>dvl</b>")
    );

    let output = navfuse(&["compare", &text(&run), &text(&run), "--no-output"]);
    let compared = stdout(&output);
    assert!(compared.contains(&format!("verdict of A: {line}")), "{compared}");
    let row = compared.lines().find(|row| row.trim().starts_with("verdict ")).expect("a row");
    assert_eq!(row.matches(words).count(), 2, "{row}");
    for shown in [&printed, &compared, &page] {
        assert!(!shown.contains(Severity::Doubtful.verdict()), "{shown}");
    }
}

#[test]
fn report_replay_and_export_find_the_log_in_the_folder_of_a_run_and_name_what_is_there_instead() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let short = ["--set", "estimator.stop=100 s", "--out"];
    let output = command().arg("run").arg(scenario("quickstart")).args(short).arg(&run).output();
    assert!(output.is_ok_and(|o| o.status.success()));
    let done = |arguments: &[&str]| {
        let output = navfuse(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        stdout(&output)
    };
    let (here, again) = (text(&run), text(&folder.path().join("again")));
    let printed = done(&["report", &here]);
    assert_eq!(printed.lines().next(), Some(&*text(&run.join("report.html"))));
    done(&["replay", &here, "--out", &again]);
    done(&["export", &here, "--to", "gpx"]);
    assert!(run.join("run.gpx").is_file());
    done(&["observability", &here]);
    // a log with another name, alone in its folder
    let moved = Path::new(&again).join("dive.mcap");
    std::fs::rename(Path::new(&again).join("run.mcap"), &moved).expect("the log");
    done(&["report", &again]);
    let rejected = |command: &str, folder: &str, named: &[&str]| {
        let output = navfuse(&[command, folder]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(named.iter().all(|name| said.contains(name)), "{said}");
    };
    std::fs::copy(&moved, moved.with_file_name("other.mcap")).expect("a second log");
    std::fs::remove_file(moved.with_file_name("run.rrd")).ok();
    for command in ["report", "replay"] {
        rejected(command, &again, &["several logs", "dive.mcap", "other.mcap"]);
    }
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("a folder");
    std::fs::write(empty.join("notes.txt"), "no log").expect("a file");
    for command in ["report", "replay"] {
        rejected(command, &text(&empty), &["no log", "notes.txt"]);
    }
}

/// In a folder with the settings of other programs alone.
#[test]
fn a_missing_scenario_lists_scenarios_and_no_settings_of_other_programs() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("the test can write");
    };
    write("Cargo.toml", "[package]\nname = \"dive\"\n");
    write("typos.toml", "[files]\n");
    let said = |name: &str| {
        let output = command().current_dir(folder.path()).args(["run", name]).output();
        stderr(&output.expect("the command starts"))
    };
    let none = said("mission.toml");
    assert!(none.contains("has no scenario") && !none.contains("typos"), "{none}");
    std::fs::create_dir(folder.path().join("dives")).expect("a folder");
    write("dives/lake.toml", "[sensor.imu]\n");
    let below = said("mission.toml");
    assert!(below.contains("the folder dives has lake.toml"), "{below}");
}
