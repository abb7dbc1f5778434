//! A run that is watched over the WebSocket protocol of Foxglove.
#![cfg(feature = "server")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use navfuse_core::document::Document;
use navfuse_core::model::record::Record;
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::plugin::{OpenContext, Registry, SinkType};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::{Assembly, Scenario};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{scope, sleep};
use std::time::Duration;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// A vehicle at rest for 6 s, with an estimate each 0.2 s: few enough messages for any client.
const SCENARIO: &str = r#"
name = "watched"
seed = 3

[estimator]
output_rate = "5 Hz"

[process.ins]
attitude = { sigma = ["0.01 deg", "0.01 deg", "0.1 deg"] }
velocity = { sigma = "5 mm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "0.01 deg/h" }
accel_bias = { sigma = "50 ug" }

[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "20 Hz" }

[sensor.dvl]
noise = "2 cm/s"
simulation = { rate = "5 Hz" }

[sensor.depth]
noise = "5 cm"
simulation = { rate = "2 Hz" }

[sensor.reference]
simulation = { rate = "10 Hz" }

[source.simulation.start]
latitude = "30 deg"
height = "0 m"

[[source.simulation.segments]]
type = "static"
duration = "6 s"
"#;

/// The time at which the run waits for its viewer.
const PAUSE: f64 = 3.0;

/// The two ends at which the run waits: it says that it has come, and is let go.
static PAUSED: Mutex<Option<(Sender<()>, Receiver<()>)>> = Mutex::new(None);

/// A sink at which the run waits once.
#[derive(Deserialize, JsonSchema)]
struct Pause {}

impl SinkType for Pause {
    const TYPE: &'static str = "pause";
    const DEFAULT: bool = false;
    fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        Ok(Box::new(self))
    }
}

impl Sink for Pause {
    fn start(&mut self, _: &RunInfo) -> Result<(), StreamError> {
        Ok(())
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Record::Sample(sample) = record
            && sample.time.seconds() >= PAUSE
            && let Some((here, go)) = PAUSED.lock().unwrap().take()
        {
            here.send(()).unwrap();
            go.recv().unwrap();
        }
        Ok(())
    }
}

fn run(folder: &Path, port: u16) {
    let text = format!(
        "{SCENARIO}[sink.pause]\n[sink.mcap]\n[sink.foxglove]\naddress = \"127.0.0.1:{port}\"\n"
    );
    let finished = runner::run(assemble(&text, folder).unwrap(), &AtomicBool::new(false), |_| ());
    assert!(finished.error.is_none(), "{:?}", finished.error);
}

fn assemble(text: &str, folder: &Path) -> Result<Assembly, String> {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_simulation::SimulationPlugin)
        .add(&navfuse_mcap::McapPlugin)
        .add(&navfuse_foxglove::FoxglovePlugin);
    registry.sink::<Pause>();
    let document = Document::parse("watched.toml", text).unwrap();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    scenario.assemble(Some(folder)).map_err(|e| e.to_string())
}

/// A message by topic, time and bytes.
type Sent = (String, u64, Vec<u8>);

/// A client of the protocol.
struct Client {
    socket: WebSocket<TcpStream>,
    /// Names of the topics by the number of the subscription.
    topics: BTreeMap<u32, String>,
}

impl Client {
    fn connect(port: u16) -> Self {
        let address = format!("127.0.0.1:{port}");
        let mut request = format!("ws://{address}/").into_client_request().unwrap();
        let protocol = "foxglove.sdk.v1".parse().unwrap();
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        let stream = TcpStream::connect(address).unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        Self { socket, topics: BTreeMap::new() }
    }

    fn next(&mut self) -> Option<Message> {
        self.socket.read().ok().filter(|message| !message.is_close())
    }

    /// Subscribes to every topic that the server announces, and returns the announcement.
    fn subscribe(&mut self) -> Vec<Value> {
        loop {
            let Some(Message::Text(text)) = self.next() else { panic!("no announcement") };
            let said: Value = serde_json::from_str(&text).unwrap();
            if said["op"] != "advertise" {
                continue;
            }
            let channels = said["channels"].as_array().unwrap();
            for channel in channels {
                let id = u32::try_from(channel["id"].as_u64().unwrap()).unwrap();
                self.topics.insert(id, channel["topic"].as_str().unwrap().to_owned());
            }
            let all: Vec<_> =
                self.topics.keys().map(|id| json!({ "id": id, "channelId": id })).collect();
            let wanted = json!({ "op": "subscribe", "subscriptions": all }).to_string();
            self.socket.send(Message::text(wanted)).unwrap();
            return channels.clone();
        }
    }

    /// The next message of a topic; `None` once the server has closed the connection.
    fn message(&mut self) -> Option<Sent> {
        loop {
            // a byte of the kind, the subscription, the time, and the message itself
            let Message::Binary(bytes) = self.next()? else { continue };
            let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
            let time = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
            let topic = self.topics[&subscription].clone();
            return Some((topic, time, bytes[13..].to_vec()));
        }
    }
}

fn logged(path: &Path) -> Vec<Sent> {
    let bytes = std::fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    messages.map(|m| (m.channel.topic.clone(), m.log_time, m.data.to_vec())).collect()
}

/// Whoever connects in the middle of a run gets the newest message of each topic, among them the frames
/// that were sent once, and then all that follow: the bytes of the log with its times.
#[test]
fn a_viewer_that_comes_late_sees_the_newest_message_of_each_topic_and_then_those_of_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let (here, arrived) = channel();
    let (go, released) = channel();
    *PAUSED.lock().unwrap() = Some((here, released));
    let mut seen = Vec::new();
    scope(|scope| {
        scope.spawn(|| run(folder.path(), port));
        arrived.recv_timeout(Duration::from_secs(60)).unwrap();
        let mut client = Client::connect(port);
        let announced = client.subscribe();
        let odometry = announced.iter().find(|c| c["topic"] == "/estimate/odometry").unwrap();
        assert_eq!(odometry["encoding"], "cdr");
        assert_eq!(odometry["schemaName"], "nav_msgs/msg/Odometry");
        assert_eq!(odometry["schemaEncoding"], "ros2msg");
        while !seen.iter().any(|(topic, ..): &Sent| topic == "/tf_static") {
            seen.extend(Some(client.message().unwrap()));
        }
        // the newest messages of the other topics are on the way, too
        sleep(Duration::from_millis(500));
        go.send(()).unwrap();
        seen.extend(std::iter::from_fn(|| client.message()));
    });
    let log = logged(&folder.path().join("run.mcap"));
    let pause = (PAUSE * 1e9) as u64;
    let (before, after): (Vec<_>, Vec<_>) = log.into_iter().partition(|(_, time, _)| *time < pause);
    let mut newest = BTreeMap::new();
    newest.extend(before.into_iter().map(|sent| (sent.0.clone(), sent)));
    let expected: BTreeSet<Sent> = newest.into_values().chain(after).collect();
    let seen: BTreeSet<Sent> = seen.into_iter().collect();
    let name = |sent: &&Sent| (sent.0.clone(), sent.1);
    let missed: Vec<_> = expected.difference(&seen).map(|s| name(&s)).collect();
    let other: Vec<_> = seen.difference(&expected).map(|s| name(&s)).collect();
    assert!(missed.is_empty() && other.is_empty(), "missed {missed:?}, not logged {other:?}");
    let topics: BTreeSet<&str> = seen.iter().map(|sent| sent.0.as_str()).collect();
    for topic in ["/estimate/odometry", "/tf_static", "/innovation/dvl", "/verdict"] {
        assert!(topics.contains(topic), "{topic}: {topics:?}");
    }
}

/// A port that another program uses is named with its key and a remedy.
#[test]
fn a_port_in_use_is_an_error_that_names_the_key() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let text = format!("{SCENARIO}[sink.foxglove]\naddress = \"{address}\"\n");
    let folder = tempfile::tempdir().unwrap();
    let error = assemble(&text, folder.path()).err().unwrap();
    for part in ["address", &address.to_string(), "give another address and port"] {
        assert!(error.contains(part), "{error}");
    }
}
