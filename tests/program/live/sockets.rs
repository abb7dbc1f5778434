//! Samples over UDP, TCP and serial ports, as instruments send them.

use super::desk::{Desk, dive, result, stop, warnings};
use crate::common::{command, navfuse, stdout};
#[cfg(unix)]
use serialport::SerialPort;
#[cfg(unix)]
use std::io::Read;
use std::io::Write;
use std::net::{TcpListener, UdpSocket};
use std::process::{Child, Stdio};

/// A port of the loopback that is free now.
fn free() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Plays the dive to a place.
fn play(desk: &Desk, to: &str, speed: &str) -> Child {
    let scenario = desk.path("desk.toml").display().to_string();
    command()
        .args(["play", &scenario, "--to", to, "--speed", speed])
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn a_server_that_goes_away_is_connected_to_again() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap();
    let desk = Desk::new(&format!("[link.tcp]\naddress = \"{address}\"\n"));
    let live = desk.live(&["--speed", "inf"]);
    let middle = dive().sentences.len() / 2;
    for half in [&dive().sentences[..middle], &dive().sentences[middle..]] {
        let (mut client, _) = server.accept().unwrap();
        client.write_all(half).unwrap();
    }
    desk.wait_for("all of it", |s| s["time_s"].as_f64().is_some_and(|t| t > 39.9));
    stop(&live);
    let result = result(live.wait_with_output().unwrap());
    // the sentence that was cut in two is lost
    assert!(warnings(&result).contains("lost: the other side closed it"), "{}", warnings(&result));
}

#[test]
fn a_recording_is_played_over_udp_and_the_state_of_the_run_is_seen_meanwhile() {
    let port = free();
    let desk = Desk::new(&format!("[link.udp]\naddress = \"127.0.0.1:{port}\"\n"));
    let live = desk.live(&["--speed", "10"]);
    desk.wait_for("it listens", |_| true);
    let mut player = play(&desk, &format!("udp://127.0.0.1:{port}"), "10");
    desk.wait_for("an estimate", |s| {
        s["running"] == true
            && s["sensors"][0]["state"] == "used"
            && s["states"].as_array().is_some_and(|states| !states.is_empty())
            && s["sensors"][2]["share"].is_number()
    });
    let status = navfuse(&["status", &desk.path("live").display().to_string()]);
    assert!(status.status.success());
    for word in [
        "running",
        "imu",
        "dvl",
        "used",
        "NIS",
        "share",
        "position: 43.0",
        "1-sigma of the position, m: ",
        "components are determined",
        "ins.accel_bias x: not determined, 1-sigma ",
        "; would help: turn by 90 deg",
    ] {
        assert!(stdout(&status).contains(word), "{word}: {}", stdout(&status));
    }
    player.kill().unwrap();
    player.wait().unwrap();
    // 5 s of the run without a sample
    desk.wait_for("silence", |s| s["sensors"][0]["state"] == "silent");
    stop(&live);
    let result = result(live.wait_with_output().unwrap());
    assert!(warnings(&result).contains("imu lost: no sample for 5 s"), "{}", warnings(&result));
}

#[test]
fn instruments_are_played_as_they_write_and_the_estimate_leaves_as_datagrams() {
    let [sentences, receiver, log, display] = [free(), free(), free(), free()];
    let display = UdpSocket::bind(format!("127.0.0.1:{display}")).unwrap();
    let desk = Desk::new(&format!(
        "[link.vehicle]\ntype = \"udp\"\naddress = \"127.0.0.1:{sentences}\"\n\
         [link.receiver]\ntype = \"udp\"\naddress = \"127.0.0.1:{receiver}\"\n\
         nmea = {{ gnss = \"gnss\" }}\n\
         [link.a50]\ntype = \"tcp\"\naddress = \"127.0.0.1:{log}\"\n\
         dvl = {{ format = \"water-linked-json\", bottom_track = \"dvl\" }}\n\
         [sink.udp]\naddress = \"{}\"\n",
        display.local_addr().unwrap()
    ));
    // a busy computer delays by more than the second that is usual
    let live = desk.live(&["--speed", "10", "--set", "sensor.gnss.late=20 s"]);
    desk.wait_for("it listens", |_| true);
    let mut player = command()
        .args(["play", &desk.path("desk.toml").display().to_string(), "--speed", "10"])
        .args(["--to", &format!("udp://127.0.0.1:{sentences}")])
        .args(["--to", &format!("gnss=nmea:udp://127.0.0.1:{receiver}")])
        .args(["--to", &format!("dvl=water-linked-json:tcp://127.0.0.1:{log}")])
        .spawn()
        .unwrap();
    assert!(player.wait().unwrap().success());
    desk.wait_for("samples of each instrument", |state| {
        let used = |k: usize| state["sensors"][k]["used"].as_u64().unwrap();
        // imu, gnss, dvl and depth; the reference is a sensor too
        used(0) > 2000 && used(1) > 20 && used(2) > 100 && used(3) > 80
    });
    stop(&live);
    let result = result(live.wait_with_output().unwrap());
    let error = result["horizontal_error_m"]["final"].as_f64().unwrap();
    assert!(error < 10.0, "{result}");

    display.set_nonblocking(true).unwrap();
    let mut datagram = [0; 2048];
    let length = display.recv(&mut datagram).unwrap();
    let estimate: serde_json::Value = serde_json::from_slice(&datagram[..length]).unwrap();
    let latitude = estimate["position_deg_deg_m"][0].as_f64().unwrap();
    assert!((latitude - 43.0).abs() < 1e-3, "{estimate}");
    assert!(estimate["position_sigma_ned_m"][0].as_f64().unwrap() > 0.0, "{estimate}");
}

#[cfg(unix)]
#[test]
fn a_serial_port_gives_the_estimates_of_the_offline_run() {
    let (mut instrument, port) = serialport::TTYPort::pair().unwrap();
    instrument.set_timeout(std::time::Duration::from_secs(30)).unwrap();
    let desk = Desk::new(&format!(
        "[link.serial]\ndevice = \"{}\"\nbaud = 115200\n",
        port.name().unwrap()
    ));
    drop(port); // the run opens it
    let live = desk.live(&["--speed", "inf"]);
    desk.wait_for("it listens", |_| true);
    // a serial port is slow: the run must not fall behind
    for part in dive().sentences.chunks(1024) {
        instrument.write_all(part).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(3));
    }
    desk.wait_for("all of it", |s| s["time_s"].as_f64().is_some_and(|t| t > 39.99));
    stop(&live);
    let mut result = result(live.wait_with_output().unwrap());
    assert_eq!(result["states"].take(), dive().states, "{}", warnings(&result));
}

#[cfg(unix)]
#[test]
fn a_recording_is_played_to_a_serial_port() {
    let (mut display, port) = serialport::TTYPort::pair().unwrap();
    display.set_timeout(std::time::Duration::from_secs(30)).unwrap();
    let desk = Desk::new("");
    let mut player = play(&desk, &format!("serial://{}@115200", port.name().unwrap()), "inf");
    let mut received = vec![0; dive().sentences.len()];
    display.read_exact(&mut received).unwrap();
    assert!(received == dive().sentences, "the bytes differ");
    assert!(player.wait().unwrap().success());
    let wrong = navfuse(&[
        "play",
        &desk.path("desk.toml").display().to_string(),
        "--to",
        "serial:///dev/ttyUSB0",
    ]);
    assert!(crate::common::stderr(&wrong).contains("give the port and its rate"), "{wrong:?}");
}
