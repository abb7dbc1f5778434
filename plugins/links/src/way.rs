//! The ways by which estimates leave: datagrams, and a serial port.

use crate::ports::resolve;
use crate::serial::shared_port;
use navfuse_core::model::stream::StreamError;
use std::io::{ErrorKind, Write};
use std::net::{SocketAddr, UdpSocket};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::Builder;
use std::time::{Duration, Instant};

/// Messages that wait for a serial port: a few seconds at 10 Hz.
const QUEUE: usize = 64;
/// Longest time for which a serial port may take to accept a message.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two attempts to open a serial port.
const PAUSE: Duration = Duration::from_secs(1);

/// A way out, which never makes the filter wait.
pub(crate) trait Way: Send {
    /// Sends the bytes of one estimate.
    ///
    /// # Errors
    /// When no estimate can ever leave by this way. A receiver that is not there loses the estimate.
    fn send(&mut self, bytes: &[u8]) -> Result<(), StreamError>;

    /// The place to which the estimates went, and how many were dropped.
    fn place(&self) -> String;
}

/// Datagrams of UDP.
pub struct Datagrams {
    socket: UdpSocket,
    place: SocketAddr,
    address: String,
}

impl Datagrams {
    /// Datagrams to an address.
    ///
    /// # Errors
    /// When there is no such address.
    pub fn to(address: String) -> Result<Self, StreamError> {
        let failed = |e: std::io::Error| {
            StreamError::network(format!("{address:?}: {e}"))
                .at_key("address")
                .with_remedy("give a host and a port, such as 127.0.0.1:5006")
        };
        let place = resolve(&address)?;
        let own = if place.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(own).map_err(failed)?;
        // a full buffer of the network loses a datagram, and does not make the filter wait
        socket.set_nonblocking(true).map_err(failed)?;
        Ok(Self { socket, place, address })
    }
}

impl Way for Datagrams {
    fn send(&mut self, bytes: &[u8]) -> Result<(), StreamError> {
        match self.socket.send_to(bytes, self.place) {
            // nobody listens yet, or the network is gone for a while
            Err(e) if e.kind() == ErrorKind::InvalidInput => {
                Err(StreamError::network(format!("{}: {e}", self.address)))
            }
            _ => Ok(()),
        }
    }

    fn place(&self) -> String {
        format!("udp://{}", self.address)
    }
}

/// A serial port, which a thread of its own writes and opens again.
pub struct SerialOut {
    device: String,
    to: SyncSender<Vec<u8>>,
    dropped: u64,
}

impl SerialOut {
    /// Starts the thread of a port.
    ///
    /// # Errors
    /// When the system cannot start a thread.
    pub fn start(device: String, baud: u32) -> Result<Self, StreamError> {
        let (to, messages) = sync_channel(QUEUE);
        let name = device.clone();
        let work = move || write(&messages, &name, baud);
        let thread = Builder::new().name("serial out".to_owned()).spawn(work);
        // the thread ends with the sink
        drop(
            thread
                .map_err(|e| StreamError::new("the system cannot start a thread").with_source(e))?,
        );
        Ok(Self { device, to, dropped: 0 })
    }
}

/// Writes messages to a port until the sink is gone. While the port is away they are lost.
fn write(messages: &Receiver<Vec<u8>>, device: &str, baud: u32) {
    let mut port: Option<Box<dyn serialport::SerialPort>> = None;
    let mut tried: Option<Instant> = None;
    for message in messages {
        if port.is_none() && tried.is_none_or(|last| last.elapsed() >= PAUSE) {
            tried = Some(Instant::now());
            port = shared_port(device, baud, PATIENCE).ok();
        }
        if port.as_mut().is_some_and(|port| port.write_all(&message).is_err()) {
            port = None;
        }
    }
}

impl Way for SerialOut {
    fn send(&mut self, bytes: &[u8]) -> Result<(), StreamError> {
        self.dropped += u64::from(self.to.try_send(bytes.to_vec()).is_err());
        Ok(())
    }

    fn place(&self) -> String {
        let Self { device, dropped, .. } = self;
        match dropped {
            0 => format!("serial {device}"),
            n => format!("serial {device}, but {n} messages were dropped: it is too slow"),
        }
    }
}
