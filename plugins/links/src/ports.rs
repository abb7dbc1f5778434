//! The types of links.

use crate::config::{DvlFormat, Format, NmeaFormat, TimeOfSample};
use crate::datagrams::Datagrams;
use crate::feed::PortFeed;
use crate::port::{Open, PATIENCE, Port, Remark};
use navfuse_core::model::stream::{Feed, StreamError};
use navfuse_core::plugin::{LinkType, OpenContext};
use navfuse_frames::TimeConfig;
use navfuse_vehicle_logs::ConnectedUnit;
use schemars::JsonSchema;
use serde::Deserialize;
use socket2::{SockRef, TcpKeepalive};
use std::io::{self, Read};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// Questions to a silent server whether the connection is there: without an answer it is lost after
/// 9 s.
const ALIVE: TcpKeepalive = TcpKeepalive::new()
    .with_time(Duration::from_secs(5))
    .with_interval(Duration::from_secs(1))
    .with_retries(4);
/// Longest time for which a server may take to answer.
const CONNECT: Duration = Duration::from_secs(1);

/// Receives datagrams of UDP at an address. Without `nmea`, `dvl` or `unit` they hold sentences of samples.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Udp {
    /// Address at which it listens, such as `127.0.0.1:5005`; `0.0.0.0:5005` takes datagrams of
    /// every computer that reaches this one.
    pub address: String,
    /// The bytes are sentences of NMEA 0183.
    pub nmea: Option<NmeaFormat>,
    /// The bytes are messages of a Doppler velocity log.
    pub dvl: Option<DvlFormat>,
    /// The bytes are messages of an autopilot (MAVLink), an inertial unit or a receiver.
    pub unit: Option<ConnectedUnit>,
    /// Time of a sample: `header`, its own stamp, or `arrival`. Default: `header`.
    #[serde(default)]
    pub time: TimeOfSample,
    /// The clock of the stamps.
    #[serde(default)]
    pub clock: TimeConfig,
    /// Obeys sentences with commands, such as a reset. Default: false.
    #[serde(default)]
    pub commands: bool,
}

/// Connects to a server by TCP, and again whenever the connection is lost. Without `nmea`, `dvl` or `unit`
/// the server sends sentences of samples.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tcp {
    /// Address of the server, such as `192.168.194.95:16171`, a Water Linked A50 as delivered.
    pub address: String,
    /// The bytes are sentences of NMEA 0183.
    pub nmea: Option<NmeaFormat>,
    /// The bytes are messages of a Doppler velocity log.
    pub dvl: Option<DvlFormat>,
    /// The bytes are messages of an autopilot (MAVLink), an inertial unit or a receiver.
    pub unit: Option<ConnectedUnit>,
    /// Time of a sample: `header`, its own stamp, or `arrival`. Default: `header`.
    #[serde(default)]
    pub time: TimeOfSample,
    /// The clock of the stamps.
    #[serde(default)]
    pub clock: TimeConfig,
    /// Obeys sentences with commands, such as a reset. Default: false.
    #[serde(default)]
    pub commands: bool,
}

/// Reads standard input to its end. Without `nmea`, `dvl` or `unit` it holds sentences of samples.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StandardInput {
    /// The bytes are sentences of NMEA 0183.
    pub nmea: Option<NmeaFormat>,
    /// The bytes are messages of a Doppler velocity log.
    pub dvl: Option<DvlFormat>,
    /// The bytes are messages of an autopilot (MAVLink), an inertial unit or a receiver.
    pub unit: Option<ConnectedUnit>,
    /// Time of a sample: `header`, its own stamp, or `arrival`. Default: `header`.
    #[serde(default)]
    pub time: TimeOfSample,
    /// The clock of the stamps.
    #[serde(default)]
    pub clock: TimeConfig,
    /// Obeys sentences with commands, such as a reset. Default: false.
    #[serde(default)]
    pub commands: bool,
}

impl LinkType for Udp {
    const TYPE: &'static str = "udp";

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError> {
        let Self { address, nmea, dvl, unit, time, clock, commands } = self;
        let place = resolve(&address)?;
        let open = move |remarks: &Sender<Remark>| {
            let datagrams = Datagrams::bind(place, remarks.clone())?;
            Ok(Box::new(datagrams) as Box<dyn Read + Send>)
        };
        let name = format!("udp {address}");
        lasting(
            name,
            Box::new(open),
            Format { nmea, dvl, unit, time, clock, commands },
            (false, context),
        )
    }
}

impl LinkType for Tcp {
    const TYPE: &'static str = "tcp";

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError> {
        let Self { address, nmea, dvl, unit, time, clock, commands } = self;
        let place = resolve(&address)?;
        let open = move |_: &Sender<Remark>| Ok(Box::new(connect(place)?) as Box<dyn Read + Send>);
        let name = format!("tcp {address}");
        lasting(
            name,
            Box::new(open),
            Format { nmea, dvl, unit, time, clock, commands },
            (true, context),
        )
    }
}

impl LinkType for StandardInput {
    const TYPE: &'static str = "stdin";

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError> {
        let Self { nmea, dvl, unit, time, clock, commands } = self;
        let format = Format { nmea, dvl, unit, time, clock, commands };
        let (to, remarks) = channel();
        let samples = format.samples("standard input", io::stdin(), &to, context)?;
        Ok(Box::new(PortFeed { samples, remarks, waits: true }))
    }
}

/// Connects to a server. A connection that is gone without a word, since the server lost its power or the
/// network is cut, fails within 10 s.
fn connect(place: SocketAddr) -> io::Result<TcpStream> {
    let stream = TcpStream::connect_timeout(&place, CONNECT)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    SockRef::from(&stream).set_tcp_keepalive(&ALIVE)?;
    Ok(stream)
}

/// The feed of a port that is opened again whenever it is lost.
pub fn lasting(
    name: String,
    open: Open,
    format: Format,
    (waits, context): (bool, &OpenContext<'_>),
) -> Result<Box<dyn Feed>, StreamError> {
    let (to, remarks) = channel();
    let port = Port::new(name.clone(), open, to.clone());
    let samples = format.samples(&name, port, &to, context)?;
    Ok(Box::new(PortFeed { samples, remarks, waits }))
}

pub fn resolve(address: &str) -> Result<SocketAddr, StreamError> {
    let wrong = |text: String| {
        StreamError::network(text)
            .at_key("address")
            .with_remedy("give a host and a port, such as 127.0.0.1:5005")
    };
    let found = address.to_socket_addrs();
    let mut found = found.map_err(|e| wrong(format!("{address:?} is no address: {e}")))?;
    found.next().ok_or_else(|| wrong(format!("{address:?} is the address of no host")))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn a_connection_asks_whether_a_silent_server_is_there() {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = connect(server.local_addr().unwrap()).unwrap();
        assert!(SockRef::from(&stream).keepalive().unwrap());
    }
}
