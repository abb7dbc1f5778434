//! The command in daily use: on a terminal of 80 columns, in pipes, with mistaken scenarios.

use crate::common::{Need, command, navfuse, scenario, skip, stderr, stdout};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// A short run without files.
const SHORT: [&str; 3] = ["--set", "estimator.stop=200 s", "--no-output"];

/// Calls the command in a pseudo-terminal of 80 columns; without `script`, the test
/// is skipped.
fn on_terminal(arguments: &[&str], environment: &[(&str, &str)]) -> Option<String> {
    let quoted = arguments.iter().map(|a| format!("'{a}'")).collect::<Vec<_>>().join(" ");
    in_shell(&quoted, environment)
}

/// The same with the words of a shell, which may send the output through another program.
fn in_shell(words: &str, environment: &[(&str, &str)]) -> Option<String> {
    let line = format!("stty cols 80 rows 40; {} {words}", env!("CARGO_BIN_EXE_navfuse"));
    let mut script = Command::new("script");
    script.args(["-qec", &line, "/dev/null"]).env("TERM", "xterm").env_remove("NO_COLOR");
    script.envs(environment.iter().copied()).stdin(Stdio::null());
    match script.output() {
        Ok(output) => Some(stdout(&output).replace('\r', "")),
        Err(_) => {
            skip(Need::Unix, "`script`, which makes the pseudo-terminal");
            None
        }
    }
}

/// The text without sequences that set a colour.
fn without_colours(text: &str) -> String {
    let mut parts = text.split("\u{1b}[");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.split_once('m').map_or("", |(_, rest)| rest))
}

/// Every word with a digit and how often it is there; the computing time is left out.
fn numbers(text: &str) -> BTreeMap<String, usize> {
    let mut count = BTreeMap::new();
    for line in text.lines().filter(|line| !line.contains(" m in ")) {
        for word in line.split_whitespace().filter(|w| w.contains(|c: char| c.is_numeric())) {
            *count.entry(word.to_owned()).or_default() += 1;
        }
    }
    count
}

#[test]
fn a_table_that_a_pager_shows_fits_the_terminal() {
    let Some(shown) = in_shell("list | cat", &[("COLUMNS", "")]) else { return };
    assert!(shown.lines().count() > 20, "{shown}");
    assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
}

#[test]
fn nothing_is_wider_than_80_columns_and_no_number_is_broken() {
    let [quickstart, auv] = ["quickstart", "auv"].map(|n| scenario(n).display().to_string());
    let vary = "sensor.dvl.noise=1 cm/s,2 cm/s";
    let run = [&["run", &quickstart][..], &SHORT].concat();
    let compare = [&["compare", &quickstart, "--vary", vary][..], &SHORT].concat();
    for arguments in [&run[..], &compare, &["check", &auv], &["list"], &["list", "dvl"]] {
        let Some(shown) = on_terminal(arguments, &[("NO_COLOR", "1")]) else { return };
        // the progress bar is drawn over, up to its last carriage return
        let wide = shown.lines().filter(|l| l.chars().count() > 80 && !l.contains('\u{1b}'));
        // a path is one word, which is not broken
        let wide: Vec<&str> = wide.filter(|l| !l.contains(&quickstart[..20])).collect();
        assert!(wide.is_empty(), "{arguments:?}: {wide:#?}");
        let (there, expected) = (numbers(&shown), numbers(&stdout(&navfuse(arguments))));
        assert!(expected.len() > 5, "{arguments:?} prints numbers");
        for (number, count) in expected {
            let found = there.get(&number).copied().unwrap_or_default();
            assert!(found >= count, "{arguments:?}: {number} is there {found} times of {count}");
        }
    }
}

#[test]
fn colours_are_on_terminals_alone_and_can_be_switched_off() {
    let path = scenario("quickstart").display().to_string();
    let run = [&["run", &path][..], &SHORT].concat();
    let Some(shown) = on_terminal(&run, &[]) else { return };
    let verdict = |text: &str| {
        let line = text.lines().find(|l| l.contains("verdict: "));
        line.unwrap_or_else(|| panic!("no verdict in {text}")).to_owned()
    };
    assert!(verdict(&shown).contains("\u{1b}[32m"), "{:?}", verdict(&shown));
    assert_eq!(without_colours(&verdict(&shown)), "verdict: consistent");
    let plain = on_terminal(&run, &[("NO_COLOR", "1")]).expect("it was there before");
    assert_eq!(verdict(&plain), "verdict: consistent");
    assert_eq!(verdict(&stdout(&navfuse(&run))), "verdict: consistent");
}

/// The quickstart with mistakes in a file of its own.
fn mistaken(folder: &Path) -> (String, String) {
    let text = std::fs::read_to_string(scenario("quickstart")).expect("the scenario");
    let changes = [
        ("gate = 0.999", "gaet = 0.999"),
        ("noise = \"5 cm\"", "noise = \"5 kg\""),
        ("[sensor.reference]", "[sensor.refrence]"),
        ("rate = \"100 Hz\"", "rat = \"100 Hz\""),
        ("heading = \"30 deg\"", "heading = \"30 kg\""),
    ];
    let text = changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    let path = folder.join("mine.toml");
    std::fs::write(&path, &text).expect("the test can write");
    (path.display().to_string(), text)
}

/// The places and carets of the errors that `check` printed, as (line, marked text).
fn marked(said: &str, text: &str, name: &str) -> Vec<(usize, String)> {
    let lines: Vec<&str> = said.lines().collect();
    let errors =
        lines.iter().enumerate().filter(|(_, l)| l.starts_with(&format!("error: {name}:")));
    let mut found = Vec::new();
    for (at, error) in errors {
        let place = error.strip_prefix(&format!("error: {name}:")).unwrap_or_default();
        let Some(line) = place.split(':').next().and_then(|n| n.parse::<usize>().ok()) else {
            continue; // the number of mistakes
        };
        let carets = lines[at + 3].split_once("| ").map_or("", |(_, carets)| carets);
        let before = carets.chars().take_while(|c| *c == ' ').count();
        let length = carets.trim().chars().count();
        let source = text.lines().nth(line - 1).unwrap_or_default();
        found.push((line, source.chars().skip(before).take(length).collect()));
    }
    found.sort();
    found
}

#[test]
fn check_reports_all_mistakes_at_once_each_with_its_line_and_a_caret() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, text) = mistaken(folder.path());
    let output = navfuse(&["check", &path]);
    assert_eq!(output.status.code(), Some(1));
    let said = stderr(&output);
    let line = |part: &str| {
        1 + text.lines().position(|l| l.contains(part)).unwrap_or_else(|| panic!("{part}"))
    };
    let expected = [
        (line("rat = "), "rat"),
        (line("gaet"), "gaet"),
        (line("5 kg"), "\"5 kg\""),
        (line("refrence"), "refrence"),
        (line("30 kg"), "\"30 kg\""),
    ];
    let expected: Vec<(usize, String)> = expected.map(|(l, t)| (l, t.to_owned())).into();
    assert_eq!(marked(&said, &text, &path), expected, "{said}");
    assert!(said.ends_with(&format!("error: {path}: 5 mistakes\n")), "{said}");
    assert!(stdout(&output).is_empty(), "nothing is printed of a scenario that does not fit");
    // the first of them is the error of a run
    let run = navfuse(&["run", &path, "--no-output"]);
    let first = stderr(&run).lines().next().unwrap_or_default().to_owned();
    assert!(said.contains(&first), "{first}");
}

#[test]
fn check_reports_a_mistake_of_a_source_beside_a_sensor_that_lacks_a_key() {
    let text = "[process.ins]\ntype = \"ins\"\n[sensor.imu]\ntype = \"imu\"\n[source.csv]\ndirektory = \"d\"\n";
    let said = stderr(&with_input(&["check", "-"], text));
    assert!(said.contains("stdin:3: sensor.imu: missing key"), "{said}");
    assert!(said.contains("stdin:6: source.csv.direktory: unknown key"), "{said}");
}

/// A mistake of one letter costs a glance: the message has the word that was meant, once.
#[test]
fn a_mistyped_word_of_the_command_line_is_answered_with_the_one_that_was_meant() {
    let root = scenario("quickstart");
    let root = root.parent().and_then(Path::parent).expect("the folder of the scenarios");
    for (arguments, expected) in [
        (&["rnu"][..], "a similar subcommand exists: 'run'"),
        (&["run", "scenarios/quickstrat.toml"], "did you mean scenarios/quickstart.toml?"),
        (&["check", "quickstart.toml"], "did you mean scenarios/quickstart.toml?"),
        (&["report", "scenarios/run.mcap"], "has no .mcap file"),
        (&["view", "nowhere"], "`navfuse run` writes runs/NAME/run.rrd"),
        (
            &["check", "scenarios/auv.toml", "--set", "sensor.depth.gaet=0.999"],
            "did you mean \"gate\"?",
        ),
    ] {
        let output = command().args(arguments).current_dir(root).output().expect("it starts");
        let said = stderr(&output);
        assert!(!output.status.success() && said.contains(expected), "{arguments:?}: {said}");
        assert!(said.matches("sensor.depth.gaet").count() <= 1, "{said}");
    }
}

/// Calls the command with a text in standard input.
fn with_input(arguments: &[&str], text: &str) -> Output {
    let mut command = command();
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command starts");
    let mut input = child.stdin.take().expect("a pipe");
    input.write_all(text.as_bytes()).expect("the command reads");
    drop(input);
    child.wait_with_output().expect("the command ends")
}

#[test]
fn a_scenario_is_read_from_standard_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, text) = mistaken(folder.path());
    let said = stderr(&with_input(&["check", "-"], &text));
    assert!(said.contains("error: stdin:") && said.contains("5 mistakes"), "{said}");
    let path = scenario("quickstart");
    let text = std::fs::read_to_string(&path).expect("the scenario");
    let json = ["--format", "json", "--set", "name=quickstart"];
    let path = path.display().to_string();
    let [piped, file] = ["-", &path].map(|of| [&["run", of][..], &SHORT, &json].concat());
    let mut values = [with_input(&piped, &text), navfuse(&file)]
        .map(|o| serde_json::from_str::<Value>(&stdout(&o)).expect("JSON"));
    values.iter_mut().for_each(|v| v["wall_s"] = Value::Null);
    assert_eq!(values[0], values[1]);
}

#[test]
fn an_included_scenario_runs_as_the_whole_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let base = folder.path().join("base.toml");
    std::fs::copy(scenario("quickstart"), base).expect("a copy");
    let path = folder.path().join("quickstart.toml");
    let text = "include = \"base.toml\"\nname = \"quickstart\"\n[sensor.dvl]\nnoise = \"2 cm/s\"\n";
    std::fs::write(&path, text).expect("the test can write");
    let json = |path: &Path, set: &str| {
        let path = path.display().to_string();
        let output =
            navfuse(&[&["run", &path, "--format=json", "--set", set][..], &SHORT].concat());
        let mut value: Value = serde_json::from_str(&stdout(&output)).expect("JSON");
        value["wall_s"] = Value::Null;
        value
    };
    let whole = json(&scenario("quickstart"), "sensor.dvl.noise=2 cm/s");
    assert_eq!(json(&path, "name=quickstart"), whole);
    // a mistake in the included file has that file's name
    let text = text.replace("base.toml", "other.toml");
    std::fs::write(&path, text).expect("the test can write");
    std::fs::write(folder.path().join("other.toml"), "[sensor.dvl]\ngaet = 1\n").expect("a file");
    let said = stderr(&navfuse(&["check", &path.display().to_string()]));
    assert!(said.contains("other.toml:2: sensor.dvl.gaet"), "{said}");
}

#[test]
fn quiet_prints_the_verdict_alone_and_verbose_the_notes() {
    let path = scenario("quickstart").display().to_string();
    let run = |flag: &str| navfuse(&[&["run", &path, flag][..], &SHORT].concat());
    let quiet = run("-q");
    assert_eq!((stdout(&quiet).as_str(), stderr(&quiet).as_str()), ("verdict: consistent\n", ""));
    let (usual, verbose) = (run("--accept-inconsistent"), run("-v"));
    let notes = stderr(&verbose).lines().filter(|l| l.starts_with("note: ")).count();
    assert!(notes > 0 && !stderr(&usual).contains("note: "), "{}", stderr(&verbose));
    let checked = navfuse(&["check", "-q", &path]);
    assert!(checked.status.success() && stdout(&checked).is_empty());
    let campaign = ["monte-carlo", "-q", &path, "--runs", "2", "--no-output"];
    let campaign = navfuse(&[&campaign[..], &SHORT[..2]].concat());
    let printed = stdout(&campaign);
    assert!(printed.starts_with("verdict: ") && printed.lines().count() == 1, "{printed}");
    assert!(campaign.status.success() && stderr(&campaign).is_empty(), "{}", stderr(&campaign));
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let definition = navfuse::definition();
    let names: Vec<&str> = definition.get_subcommands().map(clap::Command::get_name).collect();
    assert!(names.contains(&"run") && names.len() > 14, "{names:?}");
    for shell in ["bash", "zsh", "fish"] {
        let script = stdout(&navfuse(&["completions", shell]));
        for name in &names {
            assert!(script.contains(name), "{shell}: {name}");
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().display().to_string();
    assert!(navfuse(&["completions", "man", "--out", &out]).status.success());
    for name in &names {
        let page = folder.path().join(format!("navfuse-{name}.1"));
        let page = std::fs::read_to_string(&page).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(page.contains("Examples"), "{name}: the page has the examples");
        assert!(stdout(&navfuse(&[name, "--help"])).contains("Examples:"), "{name} --help");
    }
}

/// Examples are copied from a terminal, so none is broken; clap breaks the paragraphs.
#[test]
fn no_example_is_wider_than_80_columns_and_no_paragraph_is_broken_by_hand() {
    let definition = navfuse::definition();
    let texts = definition.get_subcommands().chain([&definition]);
    for text in texts.filter_map(clap::Command::get_after_help).map(ToString::to_string) {
        let lines: Vec<&str> = text.lines().collect();
        for line in lines.iter().filter(|line| line.starts_with(' ')) {
            assert!(line.chars().count() <= 80, "{line}");
        }
        for pair in lines.windows(2) {
            let flush = |line: &str| !line.is_empty() && !line.starts_with(' ');
            assert!(!(flush(pair[0]) && flush(pair[1])), "{pair:?}");
        }
    }
}

/// A viewer that reports a version and notes what it is opened with.
#[cfg(all(unix, feature = "rerun"))]
fn viewer(folder: &Path, version: &str) -> String {
    let program = folder.join(format!("viewer-{version}"));
    let note = folder.join("opened").display().to_string();
    let text = format!(
        "#!/bin/sh\n[ \"$1\" = --version ] && echo \"rerun-cli {version} [rustc 1.9]\" && exit\n\
         echo \"$1\" > '{note}.part' && mv '{note}.part' '{note}'\n"
    );
    // another process writes the program: a file that is open for writing here, even in a fork of
    // another test's thread, cannot be started
    let draft = folder.join("draft");
    std::fs::write(&draft, text).expect("the test can write");
    let mut install = std::process::Command::new("install");
    let installed = install.args(["-m", "755"]).args([&draft, &program]).status();
    assert!(installed.expect("install starts").success());
    program.display().to_string()
}

#[cfg(all(unix, feature = "rerun"))]
#[test]
fn view_opens_the_recording_of_a_run_and_converts_a_log_without_one() {
    let folder = tempfile::tempdir().expect("a folder");
    // an accent as macOS writes it: a letter of its own, which combines with the one before
    let run = folder.path().join("Mu\u{308}ritz").display().to_string();
    let path = scenario("quickstart").display().to_string();
    let off = ["--set", "estimator.stop=100 s", "--set", "sink.rerun.enabled=false"];
    let output = navfuse(&[&["run", &path, "--out", &run][..], &off].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let view = |of: &str, program: &str| {
        command().args(["view", of]).env("RERUN_BIN", program).output().expect("it starts")
    };
    let missing = view(&run, "/nowhere/rerun");
    let said = stderr(&missing);
    assert!(said.contains("pip install rerun-sdk==0.36.3") && said.contains("RERUN_BIN"), "{said}");
    let log = std::fs::read(format!("{run}/run.mcap")).expect("the log");
    let right = view(&run, &viewer(folder.path(), "0.36.3"));
    assert!(right.status.success() && stderr(&right).is_empty(), "{}", stderr(&right));
    let opened = folder.path().join("opened");
    let begun = std::time::Instant::now();
    while !opened.is_file() && begun.elapsed().as_secs() < 20 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let opened = std::fs::read_to_string(opened).expect("the viewer was started");
    assert_eq!(opened.trim(), format!("{run}/run.rrd"));
    assert!(Path::new(opened.trim()).is_file(), "the log was converted");
    let after = std::fs::read(format!("{run}/run.mcap")).expect("the log");
    assert!(after == log, "the log stays as it was");
    let other = view(&run, &viewer(folder.path(), "0.20.0"));
    assert!(stderr(&other).contains("version 0.20.0"), "{}", stderr(&other));
    let none = view(folder.path().join("none").to_str().expect("a path"), "/bin/true");
    assert!(stderr(&none).contains("navfuse run"), "{}", stderr(&none));
}

/// The next call converts the log from its beginning.
#[cfg(all(unix, feature = "rerun"))]
#[test]
fn a_conversion_that_is_interrupted_leaves_no_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let (path, out) = (scenario("auv").display().to_string(), run.display().to_string());
    let output = navfuse(&["run", &path, "--out", &out, "--set", "sink.rerun.enabled=false"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let mut view = command();
    view.args(["view", &out]).env("RERUN_BIN", viewer(folder.path(), "0.36.3"));
    let mut child = view.spawn().expect("it starts");
    let begun = std::time::Instant::now();
    while !run.join("run.rrd.part").is_file() && begun.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let signal = ["-INT", &child.id().to_string()];
    assert!(std::process::Command::new("kill").args(signal).status().expect("kill").success());
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert!(!run.join("run.rrd").exists(), "half a run is no recording of it");
}
