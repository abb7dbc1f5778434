//! A port that is opened again after it was lost, with a back-off.

use navfuse_core::model::record::Level;
use navfuse_core::model::stream::Command;
use std::io::{Error, ErrorKind, Read, Result};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// Time for which a port waits for bytes, so that its thread notices the end of the run, and an
/// epoch of NMEA its pause.
pub const PATIENCE: Duration = Duration::from_millis(50);
/// Pauses between two attempts to open a port: the first one, and the longest.
const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];

/// Opens a port, which may make remarks. Its reads wait for at most [`PATIENCE`].
pub type Open = Box<dyn FnMut(&Sender<Remark>) -> Result<Box<dyn Read + Send>> + Send>;

/// Whether a count of losses that has grown is worth a report: the first loss is, and each doubling.
pub fn is_worth_a_report(before: u64, now: u64) -> bool {
    now.saturating_add(1).ilog2() > before.saturating_add(1).ilog2()
}

/// A remark of a port beside its samples.
#[derive(Clone, Debug, PartialEq)]
pub enum Remark {
    /// For the log.
    Report(Level, String),
    /// To the run.
    Command(Command),
}

/// A reader that never ends: without bytes it fails with `WouldBlock`.
pub struct Port {
    name: String,
    open: Open,
    port: Option<Box<dyn Read + Send>>,
    pause: Duration,
    /// The next attempt to open the port.
    next: Instant,
    remarks: Sender<Remark>,
}

impl Port {
    /// A port that the first read opens.
    pub fn new(name: String, open: Open, remarks: Sender<Remark>) -> Self {
        Self { name, open, port: None, pause: PAUSES[0], next: Instant::now(), remarks }
    }

    fn remark(&self, level: Level, text: &str) {
        // the feed that logs it ends with this port
        self.remarks.send(Remark::Report(level, format!("{}: {text}", self.name))).ok();
    }

    /// Opens the port where an attempt is due; waits for a moment otherwise.
    fn connect(&mut self) -> Result<()> {
        let wait = self.next.saturating_duration_since(Instant::now());
        if !wait.is_zero() {
            std::thread::sleep(wait.min(PATIENCE));
            return Ok(());
        }
        match (self.open)(&self.remarks) {
            Ok(port) => {
                self.remark(Level::Info, "open");
                self.port = Some(port);
            }
            Err(error) => {
                if self.pause == PAUSES[0] {
                    self.remark(Level::Warning, &format!("not open: {error}; trying again"));
                }
                self.back_off();
            }
        }
        Ok(())
    }

    fn back_off(&mut self) {
        self.next = Instant::now() + self.pause;
        self.pause = (2 * self.pause).min(PAUSES[1]);
    }

    fn lose(&mut self, why: &str) {
        self.port = None;
        self.remark(Level::Warning, &format!("lost: {why}; opening it again"));
        self.back_off();
    }
}

impl Read for Port {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        if self.port.is_none() {
            self.connect()?;
        }
        let nothing = Err(Error::from(ErrorKind::WouldBlock));
        let Some(port) = &mut self.port else { return nothing };
        match port.read(out) {
            Ok(0) => self.lose("the other side closed it"),
            Ok(count) => {
                self.pause = PAUSES[0];
                return Ok(count);
            }
            Err(e) => match e.kind() {
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => {}
                _ => self.lose(&e.to_string()),
            },
        }
        nothing
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn losses_are_reported_at_the_first_and_whenever_their_number_has_doubled() {
        let reported = |k: &u64| is_worth_a_report(k - 1, *k);
        assert_eq!((1..100).filter(reported).collect::<Vec<_>>(), [1, 3, 7, 15, 31, 63]);
        assert!(is_worth_a_report(0, u64::MAX) && !is_worth_a_report(5, 5));
    }

    #[test]
    fn a_port_that_is_lost_is_opened_again_and_the_attempts_become_rarer() {
        let (to, remarks) = channel();
        let mut attempts = 0;
        let open: Open = Box::new(move |_| {
            attempts += 1;
            match attempts {
                1 => Ok(Box::new(&b"first"[..])),
                2 | 3 => Err(Error::from(ErrorKind::ConnectionRefused)),
                _ => Ok(Box::new(&b"again"[..])),
            }
        });
        let mut port = Port::new("tcp".to_owned(), open, to);
        let (mut read, mut out) = (Vec::new(), [0; 16]);
        while read.len() < 10 {
            match port.read(&mut out) {
                Ok(count) => read.extend_from_slice(&out[..count]),
                Err(e) => assert_eq!(e.kind(), ErrorKind::WouldBlock),
            }
        }
        assert_eq!(read, b"firstagain");
        let text = |remark| match remark {
            Remark::Report(_, text) => text,
            Remark::Command(command) => panic!("{command:?}"),
        };
        let texts: Vec<String> = remarks.try_iter().map(text).collect();
        assert_eq!(texts.len(), 3, "open, lost, open again: {texts:?}");
        assert!(texts[1].starts_with("tcp: lost: the other side closed it"), "{texts:?}");
    }
}
