//! The thread of a link.

use crate::port::Remark;
use navfuse_core::model::record::Level;
use navfuse_core::model::stream::{Feed, Inbox, Source, StreamError};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use std::error::Error;
use std::io::{self, ErrorKind};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Time between two reports of damage.
const BETWEEN_REPORTS: Duration = Duration::from_secs(10);

/// A feed of the samples that a port receives.
pub struct PortFeed {
    /// The samples in the bytes of the port.
    pub samples: Box<dyn Source>,
    /// Remarks of the port.
    pub remarks: Receiver<Remark>,
    /// Set for a port that makes its sender wait while the run is behind.
    pub waits: bool,
}

/// Tests whether a port has no byte yet.
fn is_waiting(error: &StreamError) -> bool {
    let cause = error.source().and_then(|cause| cause.downcast_ref::<io::Error>());
    cause.is_some_and(|cause| cause.kind() == ErrorKind::WouldBlock)
}

impl Feed for PortFeed {
    fn run(mut self: Box<Self>, inbox: &mut Inbox) {
        let (mut last, mut reported) = (None, Instant::now());
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while !inbox.is_closed() {
            let next = self.samples.next(&mut sample);
            for remark in self.remarks.try_iter() {
                match remark {
                    Remark::Report(level, text) => inbox.report(level, text),
                    Remark::Command(command) => inbox.command(command),
                }
            }
            match next {
                Ok(true) if self.waits => inbox.deliver(&sample),
                Ok(true) => {
                    inbox.offer(&sample);
                }
                Ok(false) => break,
                Err(error) if is_waiting(&error) => {}
                Err(error) => {
                    inbox.report(Level::Error, error.to_string());
                    if error.source().is_some_and(|cause| cause.is::<io::Error>()) {
                        break; // a port that never ends does not fail
                    }
                }
            }
            if reported.elapsed() > BETWEEN_REPORTS {
                reported = Instant::now();
                self.report_damage(&mut last, inbox);
            }
        }
        self.report_damage(&mut last, inbox);
    }
}

impl PortFeed {
    /// Reports what was wrong so far, once it changes.
    fn report_damage(&mut self, last: &mut Option<String>, inbox: &mut Inbox) {
        let warning = self.samples.warning();
        if let Some(text) = warning.as_ref().filter(|_| warning != *last) {
            inbox.report(Level::Warning, text.clone());
        }
        *last = warning;
    }
}
