//! A dive of 40 s on the desk: its samples as sentences, and live runs on them.

use crate::common::{command, navfuse, stdout};
use serde_json::Value;
use std::io::Write;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::scope;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A vehicle with an IMU, a DVL, a pressure sensor and GNSS.
const VEHICLE: &str = r#"
name = "desk"
seed = 3
[estimator]
start = "2 s"
[process.ins]
attitude = { sigma = ["0.1 deg", "0.1 deg", "2 deg"] }
velocity = { sigma = "5 cm/s" }
position = { sigma = "5 m" }
gyro_bias = { sigma = "3 deg/h" }
accel_bias = { sigma = "500 ug" }
[sensor.imu]
gyro_noise = "3 deg/h/sqrt(Hz)"
accel_noise = "50 ug/sqrt(Hz)"
simulation = { rate = "100 Hz" }
[sensor.gnss]
horizontal_noise = "1 m"
vertical_noise = "2 m"
simulation = { rate = "1 Hz" }
[sensor.dvl]
noise = "1 cm/s"
simulation = { rate = "5 Hz" }
[sensor.depth]
noise = "5 cm"
simulation = { rate = "4 Hz" }
[sensor.reference]
simulation = { rate = "10 Hz" }
[source.simulation.start]
latitude = "43 deg"
longitude = "5 deg"
heading = "30 deg"
[[source.simulation.segments]]
type = "static"
duration = "5 s"
[[source.simulation.segments]]
type = "surge"
duration = "10 s"
speed = "2 m/s"
[[source.simulation.segments]]
type = "cruise"
duration = "25 s"
"#;

/// A folder with the scenario, its links, and a run of it.
pub struct Desk {
    folder: TempDir,
}

impl Desk {
    /// A desk whose vehicle has these links.
    pub fn new(links: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("desk.toml"), format!("{VEHICLE}{links}")).unwrap();
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// Starts a live run, whose standard input is the caller's.
    pub fn live(&self, arguments: &[&str]) -> Child {
        self.live_with(arguments, &[])
    }

    /// As [`Self::live`], with variables of the environment.
    pub fn live_with(&self, arguments: &[&str], environment: &[(&str, &Path)]) -> Child {
        command()
            .envs(environment.iter().copied())
            .args(["live", &self.text("desk.toml"), "--out", &self.text("live")])
            .args(["--format", "json"])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Passes sentences through a live run to its end.
    pub fn pass(&self, sentences: &[u8], arguments: &[&str]) -> Value {
        let mut live = self.live(arguments);
        // a run that ends early closes its end of the pipe
        live.stdin.take().unwrap().write_all(sentences).ok();
        result(live.wait_with_output().unwrap())
    }

    /// Waits until the state of the run fulfils a condition.
    pub fn wait_for(&self, what: &str, condition: impl Fn(&Value) -> bool) {
        let (begin, path) = (Instant::now(), self.path("live/live.json"));
        loop {
            let state = std::fs::read(&path).ok().and_then(|b| serde_json::from_slice(&b).ok());
            if state.as_ref().is_some_and(&condition) {
                return;
            }
            assert!(begin.elapsed() < Duration::from_secs(60), "{what}: {state:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Ends a run in order.
pub fn stop(live: &Child) {
    send("-TERM", live);
}

/// Sends a signal to a run.
pub fn send(signal: &str, live: &Child) {
    let sent = std::process::Command::new("kill").args([signal, &live.id().to_string()]).status();
    assert!(sent.unwrap().success());
}

/// The result of a command in JSON.
pub fn result(output: Output) -> Value {
    let text = stdout(&output);
    let parsed = serde_json::from_str(&text);
    parsed.unwrap_or_else(|e| panic!("{e}: {text}\n{}", String::from_utf8_lossy(&output.stderr)))
}

/// All warnings and errors of a result, a line for each.
pub fn warnings(result: &Value) -> String {
    let events = result["warnings"].as_array().unwrap();
    let line =
        |e: &Value| format!("{}: {}", e["about"].as_str().unwrap(), e["text"].as_str().unwrap());
    events.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The offline run of the dive, and its samples as sentences.
pub struct Dive {
    pub states: Value,
    pub sentences: Vec<u8>,
}

/// The dive, which all tests share.
pub fn dive() -> &'static Dive {
    static DIVE: OnceLock<Dive> = OnceLock::new();
    DIVE.get_or_init(|| {
        let desk = Desk::new("");
        let (scenario, out) = (desk.text("desk.toml"), desk.text("offline"));
        let run = navfuse(&["run", &scenario, "--out", &out, "--format", "json"]);
        let states = result(run)["states"].take();
        let log = Path::new(&out).join("run.mcap").display().to_string();
        let played = navfuse(&["play", &log, "--speed", "inf"]);
        Dive { states, sentences: played.stdout }
    })
}

/// The sentences of the dive, each with its sensor and its time, s.
pub fn sentences() -> impl Iterator<Item = (&'static str, f64, &'static str)> {
    let text = std::str::from_utf8(&dive().sentences).unwrap();
    text.lines().map(|line| {
        let mut fields = line.split(',').skip(1);
        (fields.next().unwrap(), fields.next().unwrap().parse().unwrap(), line)
    })
}

/// A sentence with other content and the checksum that belongs to it.
pub fn sealed(content: &str) -> String {
    let sum = content.bytes().fold(0, |sum, b| sum ^ b);
    format!("${content}*{sum:02X}\r\n")
}

/// A sentence whose time is shifted.
pub fn shifted(line: &str, seconds: f64) -> String {
    let content = line.trim_start_matches('$').split('*').next().unwrap();
    let fields: Vec<&str> = content.splitn(4, ',').collect();
    let time: f64 = fields[2].parse().unwrap();
    sealed(&format!("{},{},{:.9},{}", fields[0], fields[1], time + seconds, fields[3]))
}

/// All datagrams of a live run on these sentences, for each of its sinks.
pub fn datagrams<const N: usize>(
    sinks: [&str; N],
    tables: &str,
    sentences: &[u8],
) -> [Vec<Vec<u8>>; N] {
    let sockets = sinks.map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
    let table = |(k, sink): (usize, &str)| {
        let address = sockets[k].local_addr().unwrap();
        format!("[sink.s{k}]\ntype = \"udp\"\naddress = \"{address}\"\n{sink}\n")
    };
    let sinks: String = sinks.into_iter().enumerate().map(table).collect();
    let desk = Desk::new(&format!("{tables}{sinks}"));
    let over = AtomicBool::new(false);
    scope(|threads| {
        let receivers = sockets.map(|socket| {
            socket.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
            threads.spawn(|| receive(socket, &over))
        });
        desk.pass(sentences, &["--speed", "inf"]);
        over.store(true, Ordering::Relaxed);
        receivers.map(|receiver| receiver.join().unwrap())
    })
}

/// The datagrams of a socket until the run is over.
fn receive(socket: UdpSocket, over: &AtomicBool) -> Vec<Vec<u8>> {
    let (mut received, mut datagram) = (Vec::new(), [0; 4096]);
    loop {
        match socket.recv(&mut datagram) {
            Ok(size) => received.push(datagram[..size].to_vec()),
            Err(_) if over.load(Ordering::Relaxed) => return received,
            Err(_) => {}
        }
    }
}
