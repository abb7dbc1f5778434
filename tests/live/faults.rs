//! What goes wrong on a vehicle, each with its outcome.

use super::desk::{Desk, dive, sealed, sentences, shifted, warnings};
use serde_json::Value;

const STDIN: &str = "[link.stdin]\n";
/// Fast, and slow enough that an hour is a step of a clock.
const SPEED: [&str; 2] = ["--speed", "100"];

/// Runs the dive with its sentences replaced, each by any number of others.
fn run(replace: impl FnMut((&str, f64, &str)) -> Vec<u8>) -> Value {
    let bytes: Vec<u8> = sentences().flat_map(replace).collect();
    Desk::new(STDIN).pass(&bytes, &SPEED)
}

fn plain(line: &str) -> Vec<u8> {
    format!("{line}\r\n").into_bytes()
}

/// The used samples of a sensor.
fn used(result: &Value, sensor: &str) -> u64 {
    let used = result["samples"][sensor]["accepted"].as_u64();
    used.unwrap_or_else(|| panic!("{result}"))
}

/// The latest time of an estimate, s: the filter starts at 2 s.
fn end(result: &Value) -> f64 {
    2.0 + result["duration_s"].as_f64().unwrap_or_else(|| panic!("{result}"))
}

#[test]
fn garbage_and_half_a_message_cost_nothing_else_and_are_reported() {
    let mut k = 0;
    let result = run(|(_, _, line)| {
        k += 1;
        let noise: &[u8] = match k % 40 {
            3 => b"\x00\xff$$*?\r\n",
            17 => &line.as_bytes()[..line.len() / 2],
            _ => b"",
        };
        [noise, &plain(line)].concat()
    });
    assert_eq!(result["states"], dive().states);
    assert!(warnings(&result).contains("hold no intact sentence"), "{}", warnings(&result));
}

#[test]
fn a_wrong_checksum_a_foreign_sensor_and_a_foreign_sentence_are_left_out_and_reported() {
    let mut k = 0;
    let result = run(|(_, _, line)| {
        k += 1;
        let extra = match k % 50 {
            1 => sealed("PNVF,sonar,1.0,range=3"),
            2 => sealed("GPGSV,1,1,00"),
            3 => line.replace('*', "0*"),
            _ => String::new(),
        };
        [extra.as_bytes(), &plain(line)].concat()
    });
    assert_eq!(result["states"], dive().states);
    let text = warnings(&result);
    assert!(text.contains("without a sensor, a time or channels"), "{text}");
}

#[test]
fn duplicated_samples_are_used_once() {
    let result = run(|(_, _, line)| plain(line).repeat(2));
    assert_eq!(result["states"], dive().states);
}

#[test]
fn a_sample_that_is_nan_is_rejected_and_the_others_are_used() {
    let result = run(|(sensor, time, line)| {
        let nan = |text: &str| sealed(text).into_bytes();
        match sensor {
            "dvl" if time > 20.0 && time < 21.0 => {
                nan(&format!("PNVF,dvl,{time:.9},vel_x=NaN,vel_y=inf,vel_z=-inf"))
            }
            _ => plain(line),
        }
    });
    assert!(end(&result) > 39.0);
    assert!(used(&result, "dvl") > 180);
    assert_eq!(result["samples"]["dvl"]["rejected"], 4, "{result}");
}

#[test]
fn a_clock_that_is_set_by_an_hour_costs_a_few_samples_and_is_reported() {
    for (name, hour) in [("dvl", 3600.0), ("dvl", -3600.0), ("imu", 3600.0), ("imu", -3600.0)] {
        let result = run(|(sensor, time, line)| match sensor == name && time > 20.0 {
            true => shifted(line, hour).into_bytes(),
            false => plain(line),
        });
        let text = warnings(&result);
        assert!(text.contains(&format!("{name}: its clock was set by")), "{text}");
        assert!((35.0..45.0).contains(&end(&result)), "{name} {hour}: {}", end(&result));
        let read = result["samples"]["dvl"]["read"].as_u64();
        assert!(read.is_some_and(|read| read > 190), "{name} {hour}: {result}");
    }
}

#[test]
fn a_single_stamp_in_the_future_costs_its_sample() {
    let mut ahead = 0;
    let result = run(|(sensor, time, line)| {
        let wrong = sensor == "dvl" && time > 20.0 && ahead == 0;
        ahead += u32::from(wrong);
        let extra = if wrong { shifted(line, 86_400.0) } else { String::new() };
        [extra.as_bytes(), &plain(line)].concat()
    });
    assert_eq!(result["states"], dive().states);
    assert!(warnings(&result).contains("dvl: a time stamp is wrong by"), "{}", warnings(&result));
}

#[test]
fn an_imu_that_is_unplugged_and_comes_back_does_not_end_the_run() {
    let result = run(|(sensor, time, line)| match sensor {
        "imu" if (20.0..26.0).contains(&time) => Vec::new(),
        _ => plain(line),
    });
    assert!(end(&result) > 39.0);
    assert!(warnings(&result).contains("without a sample: the process coasted"));
}

#[cfg(unix)]
#[test]
fn a_full_disk_costs_the_log_and_not_the_run() {
    let desk = Desk::new(STDIN);
    let arguments = ["--speed", "inf", "--set", "sink.mcap.path=/dev/full"];
    let result = desk.pass(&dive().sentences, &arguments);
    assert_eq!(result["states"], dive().states);
    assert!(warnings(&result).contains("/dev/full"), "{}", warnings(&result));
}
