//! What a user sees of a live run: its warnings at once, and the screen of a terminal.

use super::desk::{Desk, dive, sentences, stop};
use navfuse_testing::absent::{Need, skip};
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

const STDIN: &str = "[link.stdin]\n";

#[test]
fn warnings_are_printed_while_the_run_goes_on() {
    // nobody listens at this port
    let desk = Desk::new(&format!("{STDIN}[link.tcp]\naddress = \"127.0.0.1:1\"\n"));
    let mut live = desk.live(&["--speed", "inf"]);
    let (to, lines) = channel();
    let errors = BufReader::new(live.stderr.take().unwrap());
    std::thread::spawn(move || errors.lines().map_while(Result::ok).try_for_each(|l| to.send(l)));
    let wait_for = |words: &str| {
        let mut before = Vec::new();
        loop {
            let line = lines.recv_timeout(Duration::from_secs(60));
            let line = line.unwrap_or_else(|_| panic!("{words} is not in {before:#?}"));
            if line.contains(words) {
                return line;
            }
            before.push(line);
        }
    };
    wait_for("warning: tcp 127.0.0.1:1: not open");
    // a DVL that is unplugged: the input goes on, and nothing ends
    let mut input = live.stdin.take().unwrap();
    let plugged = |(sensor, time, _): &(&str, f64, &str)| *sensor != "dvl" || *time < 10.0;
    let lines_sent: String =
        sentences().filter(plugged).map(|(_, _, line)| format!("{line}\r\n")).collect();
    input.write_all(lines_sent.as_bytes()).unwrap();
    let lost = wait_for("dvl lost: no sample for");
    assert!(lost.starts_with("warning: "), "{lost}");
    assert!(live.try_wait().unwrap().is_none(), "the run still goes on");
    stop(&live);
    drop(input);
    live.wait().unwrap();
    // the end prints nothing a second time
    let rest: Vec<String> = lines.iter().collect();
    assert!(!rest.iter().any(|l| l.contains("dvl lost") || l.contains("not open")), "{rest:#?}");
}

#[test]
fn the_screen_needs_a_terminal() {
    let desk = Desk::new(STDIN);
    let output = desk.live(&["--tui"]).wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{text}");
    assert!(text.contains("error: --tui: standard output is no terminal; leave it out"), "{text}");
}

/// The state of the run is drawn on a pseudo-terminal, the key q ends the run as SIGINT does, and the
/// terminal is as it was before.
#[cfg(unix)]
#[test]
fn the_screen_shows_the_run_until_a_key_ends_it_and_restores_the_terminal() {
    for key in ["q", "\u{3}"] {
        let desk = Desk::new(STDIN);
        let [scenario, out] = ["desk.toml", "live"].map(|n| desk.path(n).display().to_string());
        let samples = desk.path("samples");
        std::fs::write(&samples, &dive().sentences).unwrap();
        // the input of the run is a pipe that stays open; the keys come from the terminal
        let line = format!(
            "stty cols 80 rows 24; stty -a > '{0}.before'; mkfifo '{0}.pipe'; exec 3<>'{0}.pipe'; \
             cat '{1}' >&3 & '{2}' live '{0}' --out '{out}' --speed inf --tui <'{0}.pipe'; \
             echo ended $?; stty -a > '{0}.after'",
            scenario,
            samples.display(),
            env!("CARGO_BIN_EXE_navfuse"),
        );
        let mut script = Command::new("script");
        script.args(["-qec", &line, "/dev/null"]).env("TERM", "xterm").env_remove("NO_COLOR");
        script.stdin(Stdio::piped()).stdout(Stdio::piped());
        let Ok(mut script) = script.spawn() else {
            return skip(Need::Unix, "`script`, which makes the pseudo-terminal");
        };
        desk.wait_for("all of it", |s| s["time_s"].as_f64().is_some_and(|t| t > 39.9));
        std::thread::sleep(Duration::from_secs(2));
        script.stdin.as_mut().unwrap().write_all(key.as_bytes()).unwrap();
        let shown = crate::common::stdout(&script.wait_with_output().unwrap());
        let (before, rest) = shown.split_once("\u{1b}[?1049h").expect("another screen");
        let (screen, after) = rest.split_once("\u{1b}[?1049l").expect("the screen of before");
        assert!(before.contains("note: "), "{before:?}");
        // the screen moves over spaces and over what stays, so it has words
        for word in ["desk", "consistent", "40.000", "imu", "100.0", "determined", "started"] {
            assert!(screen.contains(word), "{word}: {screen:?}");
        }
        assert!(after.contains("verdict: ") && after.contains("ended 0"), "{after:?}");
        let setting = |when: &str| std::fs::read_to_string(format!("{scenario}.{when}")).unwrap();
        assert_eq!(setting("before"), setting("after"));
    }
}
