//! The datagrams of a socket as one stream.

use crate::port::{PATIENCE, Remark, is_worth_a_report};
use navfuse_core::model::record::Level;
use std::io::{ErrorKind, Read, Result};
use std::net::{SocketAddr, UdpSocket};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// Time between two looks at the datagrams that the system dropped.
const LOOK: Duration = Duration::from_secs(1);

/// The datagrams that arrive at an address. An empty one is no end.
pub struct Datagrams {
    socket: UdpSocket,
    remarks: Sender<Remark>,
    looked: Instant,
    dropped: u64,
}

impl Datagrams {
    /// Listens at an address.
    pub fn bind(place: SocketAddr, remarks: Sender<Remark>) -> Result<Self> {
        let socket = UdpSocket::bind(place)?;
        socket.set_read_timeout(Some(PATIENCE))?;
        Ok(Self { socket, remarks, looked: Instant::now(), dropped: 0 })
    }

    /// Reports the datagrams that the system dropped, as its buffer was full: at once, and again
    /// whenever their number has doubled.
    fn look(&mut self) {
        self.looked = Instant::now();
        let dropped = dropped(&self.socket).unwrap_or_default();
        if is_worth_a_report(self.dropped, dropped) {
            let text = format!("{dropped} datagrams dropped: they came faster than they were read");
            // the feed that logs it ends with this port
            self.remarks.send(Remark::Report(Level::Warning, text)).ok();
        }
        self.dropped = dropped;
    }
}

impl Read for Datagrams {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        if self.looked.elapsed() >= LOOK {
            self.look();
        }
        match self.socket.recv(out) {
            Ok(0) => Err(ErrorKind::WouldBlock.into()),
            received => received,
        }
    }
}

/// The number of datagrams for a socket that the system dropped, where it counts them: the last
/// column of its line in a table, which has the inode of the socket in another one.
#[cfg(target_os = "linux")]
fn dropped(socket: &UdpSocket) -> Option<u64> {
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::MetadataExt;
    let inode = std::fs::metadata(format!("/proc/self/fd/{}", socket.as_raw_fd())).ok()?.ino();
    let own = |table: &str| {
        let text = std::fs::read_to_string(table).ok()?;
        let columns = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let mut lines = text.lines().map(columns);
        let line = lines.find(|columns| columns.get(9).is_some_and(|c| *c == inode.to_string()))?;
        line.last()?.parse().ok()
    };
    own("/proc/net/udp").or_else(|| own("/proc/net/udp6"))
}

/// The system does not count them.
#[cfg(not(target_os = "linux"))]
fn dropped(_: &UdpSocket) -> Option<u64> {
    None
}
