//! What goes wrong on a vehicle, each with its outcome.

use super::desk::{Desk, dive, result, sealed, send, sentences, shifted, stop, warnings};
use serde_json::Value;
use std::io::Write;
use std::net::{TcpListener, UdpSocket};

const STDIN: &str = "[link.stdin]\n";
/// Fast, and slow enough that an hour is a step of a clock.
const SPEED: [&str; 2] = ["--speed", "10"];

/// Runs the dive with its sentences replaced, each by any number of others.
fn run(replace: impl FnMut((&str, f64, &str)) -> Vec<u8>) -> Value {
    let bytes: Vec<u8> = sentences().flat_map(replace).collect();
    Desk::new(STDIN).pass(&bytes, &SPEED)
}

/// As [`run`], where no fault is one of time: a computer that stalls costs nothing.
fn run_by_samples(replace: impl FnMut((&str, f64, &str)) -> Vec<u8>) -> Value {
    let bytes: Vec<u8> = sentences().flat_map(replace).collect();
    Desk::new(STDIN).pass(&bytes, &["--speed", "inf"])
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
    let result = run_by_samples(|(_, _, line)| {
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
    let result = run_by_samples(|(_, _, line)| {
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
    let result = run_by_samples(|(_, _, line)| plain(line).repeat(2));
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
        assert!(text.contains(&format!("{name}: its clock stepped by")), "{text}");
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

#[test]
fn a_viewer_that_no_longer_answers_does_not_hold_the_run() {
    // it accepts connections, and never reads from them
    let viewer = TcpListener::bind("127.0.0.1:0").unwrap();
    let connect = format!("sink.rerun.connect=\"{}\"", viewer.local_addr().unwrap());
    let result =
        Desk::new(STDIN).pass(&dive().sentences, &["--speed", "inf", "--set", connect.as_str()]);
    assert_eq!(result["states"], dive().states);
    let recorded = result["paths"].to_string();
    assert!(recorded.contains("run.rrd, but a viewer no longer answered"), "{recorded}");
    assert!(recorded.contains("run.mcap"), "{recorded}");
}

#[test]
fn a_viewer_that_is_closed_does_not_hold_the_run() {
    let viewer = TcpListener::bind("127.0.0.1:0").unwrap();
    let connect = format!("sink.rerun.connect=\"{}\"", viewer.local_addr().unwrap());
    // it closes every connection
    std::thread::spawn(move || viewer.incoming().for_each(drop));
    let result =
        Desk::new(STDIN).pass(&dive().sentences, &["--speed", "inf", "--set", connect.as_str()]);
    assert_eq!(result["states"], dive().states);
    assert!(result["paths"].to_string().contains("run.mcap"), "{result}");
}

#[test]
fn samples_that_arrive_in_another_order_give_the_same_estimates() {
    // each measurement comes after up to 0.8 s of newer samples
    let mut lines: Vec<_> = sentences().enumerate().collect();
    lines.sort_by_key(|(k, (sensor, time, _))| match *sensor {
        "imu" | "reference" => (time * 1e6) as u64,
        _ => ((time + (k * 7919 % 800) as f64 * 1e-3) * 1e6) as u64,
    });
    let shuffled: Vec<u8> = lines.iter().flat_map(|(_, (_, _, line))| plain(line)).collect();
    assert_ne!(shuffled, dive().sentences);
    let result = Desk::new(STDIN).pass(&shuffled, &["--speed", "inf"]);
    assert_eq!(result["states"], dive().states);
}

#[test]
fn a_sensor_that_is_unplugged_and_comes_back_is_reported_and_used_again() {
    let result = run(|(sensor, time, line)| match sensor {
        "dvl" if (10.0..25.0).contains(&time) => Vec::new(),
        _ => plain(line),
    });
    assert!(warnings(&result).contains("dvl lost: no sample for"), "{}", warnings(&result));
    assert!((100..130).contains(&used(&result, "dvl")), "{result}");
}

#[test]
fn a_second_publisher_whose_clock_is_an_hour_ahead_is_refused_and_the_first_one_used() {
    let result = run(|(sensor, _, line)| match sensor {
        "dvl" => [plain(line), shifted(line, 3600.0).into_bytes()].concat(),
        _ => plain(line),
    });
    assert_eq!(result["states"], dive().states);
    assert!(warnings(&result).contains("dvl: a time stamp is wrong by"), "{}", warnings(&result));
}

#[cfg(target_os = "linux")]
#[test]
fn datagrams_that_the_system_drops_are_reported() {
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let desk = Desk::new(&format!("[link.udp]\naddress = \"127.0.0.1:{port}\"\n"));
    let live = desk.live(&SPEED);
    desk.wait_for("it listens", |_| true);
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    send("-STOP", &live);
    // far more than any usual buffer holds
    for _ in 0..20_000 {
        sender.send_to(&[b'x'; 1024], ("127.0.0.1", port)).unwrap();
    }
    std::thread::sleep(std::time::Duration::from_secs(1));
    send("-CONT", &live);
    desk.wait_for("a sample", |state| {
        sender.send_to(&plain("$PNVF,depth,1.0,depth=0.0*1E"), ("127.0.0.1", port)).ok();
        state["links"][0]["samples"].as_u64().unwrap() > 0
    });
    stop(&live);
    let text = warnings(&result(live.wait_with_output().unwrap()));
    assert!(text.contains("datagrams dropped: they came faster than they were read"), "{text}");
}

#[test]
fn a_sensor_that_floods_its_link_loses_its_own_samples_and_the_loss_is_reported() {
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let desk = Desk::new(&format!(
        "{STDIN}[link.flood]\ntype = \"udp\"\naddress = \"127.0.0.1:{port}\"\n"
    ));
    let mut live = desk.live(&["--speed", "inf", "--set", "sensor.depth.late=20 s"]);
    let mut input = live.stdin.take().unwrap();
    desk.wait_for("it listens", |_| true);
    input.write_all(&dive().sentences).unwrap();
    drop(input);
    desk.wait_for("all of it", |s| s["time_s"].as_f64().is_some_and(|t| t > 39.9));
    // 50 samples in each datagram
    let flood = UdpSocket::bind("127.0.0.1:0").unwrap();
    let late: String =
        (0..50).map(|k| sealed(&format!("PNVF,depth,39.9{k:02},depth=0.0"))).collect();
    desk.wait_for("drops", |state| {
        for _ in 0..200 {
            flood.send_to(late.as_bytes(), ("127.0.0.1", port)).ok();
        }
        state["links"][0]["dropped"].as_u64().unwrap()
            + state["links"][1]["dropped"].as_u64().unwrap()
            > 0
    });
    stop(&live);
    let result = result(live.wait_with_output().unwrap());
    assert!(warnings(&result).contains("samples dropped"), "{}", warnings(&result));
    assert_eq!(result["samples"]["dvl"]["read"], 201, "{result}");
}
