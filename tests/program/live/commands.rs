//! Commands to a live run.

use super::desk::{Desk, datagrams, dive, result, sealed, sentences, warnings};
use crate::common::navfuse;
use serde_json::Value;
use std::io::Write;

const STDIN: &str = "[link.stdin]\ncommands = true\n";
/// A receiver that an operator is.
const OPERATOR: &str = "[sensor.operator]\ntype = \"gnss\"\nhorizontal_noise = \"20 m\"\n\
                        vertical_noise = \"20 m\"\nrecovery = { action = \"obey\" }\n";
/// Angle by which the operator sets the vehicle to the north, rad, and its length there, m.
const NORTH: [f64; 2] = [1e-4, 636.0];

/// The dive with each of some commands before the first sentence of its time, s.
fn with(commands: &[(f64, &str)]) -> Vec<u8> {
    let (mut left, mut bytes) = (commands.iter().peekable(), Vec::new());
    for (_, time, line) in sentences() {
        while let Some((_, command)) = left.next_if(|(at, _)| *at <= time) {
            bytes.extend_from_slice(sealed(command).as_bytes());
        }
        bytes.extend_from_slice(format!("{line}\r\n").as_bytes());
    }
    bytes
}

/// The sentence of an operator who sets the position to the north of a fix at this time, s.
fn position(at: f64) -> String {
    let fix = sentences().find(|(sensor, time, _)| *sensor == "gnss" && *time >= at).unwrap().2;
    let content = fix.trim_start_matches('$').split('*').next().unwrap();
    let channel = |field: &str| match field.strip_prefix("lat=") {
        Some(latitude) => format!("lat={:?}", latitude.parse::<f64>().unwrap() + NORTH[0]),
        None => field.to_owned(),
    };
    let fields: Vec<String> = content.split(',').map(channel).collect();
    fields.join(",").replace("PNVF,gnss", "PNVF,operator")
}

fn replayed(desk: &Desk) -> Value {
    let log = desk.path("live/run.mcap").display().to_string();
    result(navfuse(&["replay", &log, "--no-output", "--format", "json"]))
}

#[test]
fn a_sensor_that_is_switched_off_is_left_out_until_it_is_switched_on() {
    let desk = Desk::new(STDIN);
    let commands = [(10.0, "PNVC,sensor,dvl,off"), (25.0, "PNVC,sensor,dvl,on")];
    let result = desk.pass(&with(&commands), &["--speed", "inf"]);
    assert_eq!(result["samples"]["dvl"]["read"], 201 - 75, "{result}");
    let text = warnings(&result);
    assert!(text.contains("dvl is switched off") && text.contains("dvl is switched on"), "{text}");
    assert_eq!(replayed(&desk)["states"], result["states"]);
}

#[test]
fn a_link_that_may_not_command_changes_nothing_and_a_strange_command_neither() {
    let commands = [(10.0, "PNVC,reset"), (11.0, "PNVC,sensor,imu,off"), (12.0, "PNVC,sonar,on")];
    for (link, commands, why) in [
        (
            "[link.stdin]\n",
            &commands[..],
            "3 commands refused, since the link has no `commands = true`",
        ),
        (STDIN, &commands[2..], "1 command unknown or of no sensor"),
    ] {
        let result = Desk::new(link).pass(&with(commands), &["--speed", "inf"]);
        assert_eq!(result["states"], dive().states);
        assert!(warnings(&result).contains(why), "{}", warnings(&result));
    }
}

#[test]
fn a_reset_begins_the_run_anew_and_the_log_before_it_is_whole() {
    let desk = Desk::new(STDIN);
    let before = sentences().take_while(|(_, time, _)| *time < 20.0);
    let before: String = before.map(|(_, _, line)| format!("{line}\r\n")).collect();
    let all = [before.as_bytes(), sealed("PNVC,reset").as_bytes(), &dive().sentences].concat();
    let result = desk.pass(&all, &["--speed", "inf"]);
    assert_eq!(result["states"], dive().states);
    assert_eq!(replayed(&desk)["states"], result["states"]);
    let earlier = std::fs::read_dir(desk.path("live/earlier")).unwrap().next().unwrap().unwrap();
    let log = earlier.path().join("run.mcap").display().to_string();
    let replay = navfuse(&["replay", &log, "--no-output", "--format", "json"]);
    let end = super::desk::result(replay)["duration_s"].as_f64().unwrap();
    assert!((17.9..18.1).contains(&end), "{end}");
}

#[test]
fn a_run_is_saved_by_a_command() {
    let desk = Desk::new(STDIN);
    let mut live = desk.live(&["--speed", "inf", "--checkpoint", "1 h"]);
    let mut input = live.stdin.take().unwrap();
    input.write_all(&with(&[(20.0, "PNVC,checkpoint")])).unwrap();
    desk.wait_for("it is saved", |s| s["command"] == "the run is saved, by stdin");
    assert!(std::fs::metadata(desk.path("live/live.checkpoint")).unwrap().len() > 1000);
    drop(input);
    assert_eq!(result(live.wait_with_output().unwrap())["states"], dive().states);
}

#[test]
fn a_run_that_cannot_be_saved_yet_is_saved_later() {
    let desk = Desk::new(STDIN);
    let mut live = desk.live(&["--speed", "inf", "--set", "estimator.relinearise=5 s"]);
    let mut input = live.stdin.take().unwrap();
    let commands = [(4.0, "PNVC,checkpoint"), (20.0, "PNVC,checkpoint")];
    input.write_all(&with(&commands)).unwrap();
    desk.wait_for("it is saved", |s| s["command"] == "the run is saved, by stdin");
    drop(input);
    let text = warnings(&result(live.wait_with_output().unwrap()));
    assert!(text.contains("the run cannot be saved: it linearises its samples again"), "{text}");
}

#[test]
fn an_operator_sets_the_position_and_nothing_else() {
    let off = "PNVC,sensor,gnss,off";
    let set = position(25.0);
    let tables = format!("{STDIN}{OPERATOR}");
    let run = |commands| Desk::new(&tables).pass(&with(commands), &["--speed", "inf"]);
    let [before, after] = [run(&[(20.0, off)]), run(&[(20.0, off), (25.0, &set)])];
    let of = |result: &Value, state: &str, key: &str, k: usize| {
        result["states"][state][key][k].as_f64().unwrap_or_else(|| panic!("{result}"))
    };
    let north = of(&after, "ins.position", "error", 0);
    assert!((north - NORTH[1]).abs() < 10.0, "{north} m");
    let sigma = of(&after, "ins.position", "sigma", 0);
    assert!((20.0..20.1).contains(&sigma), "{sigma} m: that of the fix");
    let height = of(&after, "ins.position", "sigma", 2);
    assert!(height < 0.02, "{height} m: the fix does not contradict the height");
    for state in ["ins.attitude", "ins.velocity", "ins.gyro_bias"] {
        for k in 0..3 {
            let change = of(&after, state, "estimate", k) - of(&before, state, "estimate", k);
            assert!(change.abs() < 0.1 * of(&before, state, "sigma", k), "{state} {k}: {change}");
        }
    }
    let text = warnings(&after);
    assert!(text.contains("operator: the estimate is set: latitude is off by"), "{text}");
}

#[test]
fn a_continuous_output_blends_a_correction_in_and_has_it_in_its_sigma_until_then() {
    let commands = [(20.0, "PNVC,sensor,gnss,off"), (25.0, &position(25.0))];
    let sinks = ["", "blend = \"2 s\""];
    let sent = datagrams(sinks, &format!("{STDIN}{OPERATOR}"), &with(&commands));
    let [global, local] = sent.map(|all| {
        let read = |text: &Vec<u8>| serde_json::from_slice::<Value>(text).unwrap();
        all.iter().map(read).collect::<Vec<_>>()
    });
    assert!(local.len() > 300, "{}", local.len());
    let number = |value: &Value| value.as_f64().unwrap();
    let north = |e: &Value| number(&e["position_deg_deg_m"][0]).to_radians() * NORTH[1] / NORTH[0];
    let largest = |all: &[Value]| {
        let steps = all.windows(2).map(|w| (north(&w[1]) - north(&w[0])).abs());
        steps.fold(0.0, f64::max)
    };
    assert!(largest(&global) > 0.9 * NORTH[1], "{}", largest(&global));
    // ten a second, of a vehicle at 2 m/s
    assert!(largest(&local) < NORTH[1] * 0.11 / 2.0 + 0.3, "{}", largest(&local));
    for (global, local) in global.iter().zip(&local) {
        assert_eq!(global["time_s"], local["time_s"]);
        let offset = (north(global) - north(local)).abs();
        assert!(offset <= number(&local["position_sigma_ned_m"][0]) + 1e-3, "{offset}: {local}");
    }
    let end = [global, local].map(|all| north(&all[all.len() - 1]));
    assert!((end[0] - end[1]).abs() < 1.0, "{end:?}");
}
