//! The messages of a run, on the topics of a log or of a server.

use crate::chunk::{Definition, Definitions};
use crate::log::StreamFailure;
use crate::message::Stamp;
use crate::topics::Topics;
use crate::writer::{LogWriter, Outlet};
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::{Event, Record};
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::units::time::Time;
use std::io;

/// Turns the records of a run into messages.
#[derive(Debug)]
pub struct Messages {
    pub(crate) log: LogWriter,
    topics: Topics,
}

impl Messages {
    /// Opens the topics of a run whose messages go to an outlet, which `open` makes for them.
    ///
    /// # Errors
    /// Those of `open`.
    pub fn open(
        run: &RunInfo,
        begin: Time,
        open: impl FnOnce(&[Definition]) -> io::Result<Box<dyn Outlet>>,
    ) -> io::Result<Self> {
        Self::begin(run, begin, |definitions| Ok(LogWriter::to(open(&definitions.listed)?)))
    }

    /// Opens the topics of a run that begins at a time.
    pub(crate) fn begin(
        run: &RunInfo,
        begin: Time,
        open: impl FnOnce(Definitions) -> io::Result<LogWriter>,
    ) -> io::Result<Self> {
        let mut definitions = Definitions::default();
        let topics = Topics::open(&mut definitions, run);
        let mut log = open(definitions)?;
        log.latest = begin;
        Ok(Self { log, topics })
    }

    /// Sends the messages of a record. A finding is a warning, too.
    ///
    /// # Errors
    /// When a time does not fit a ROS time stamp, or the log cannot be written.
    pub fn send(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        self.take(record).map_err(|failure| match failure {
            StreamFailure::Content(error) => error,
            other => StreamError::format(other.to_string()).with_source(other),
        })
    }

    pub(crate) fn take(&mut self, record: &Record<'_>) -> Result<(), StreamFailure> {
        let Self { log, topics } = self;
        match *record {
            Record::Sample(sample) => {
                topics.sensors[sample.sensor.0].sample(log, sample)?;
                topics.lanes.sample(log, sample)
            }
            Record::Epoch(epoch) => {
                topics.estimate.epoch(log, epoch)?;
                topics.shown.epoch(log, epoch)?;
                topics.lanes.tick(log, epoch.state.time, false)
            }
            Record::Filtered(epoch) => {
                topics.filtered.epoch(log, epoch)?;
                topics.lanes.tick(log, epoch.state.time, true)
            }
            Record::Update(update) => {
                topics.sensors[update.sensor.0].update(log, update)?;
                topics.lanes.update(log, update)
            }
            Record::InputRejection(rejection) => {
                let sensor = &topics.sensors[rejection.sensor.0];
                topics.rejections.rejection(log, sensor, rejection)?;
                topics.lanes.reject(log, rejection.sensor, rejection.time)
            }
            Record::Derived(derived) => {
                let (time, stamp) = stamp(log, derived.time)?;
                log.send(&mut topics.derived, time, |m| m.derived(stamp, derived))
            }
            Record::Verdict(verdict) => {
                let at = stamp(log, Time::MIN)?;
                topics.shown.verdict(log, at, verdict)
            }
            Record::Event(event) => self.event(event),
            Record::Finding(finding) => self.finding(finding),
            _ => Ok(()),
        }
    }

    fn event(&mut self, event: &Event) -> Result<(), StreamFailure> {
        let (time, stamp) = stamp(&self.log, event.time)?;
        self.log.send(&mut self.topics.events, time, |m| m.log(stamp, event))
    }

    fn finding(&mut self, finding: &Finding) -> Result<(), StreamFailure> {
        self.event(&finding.event())?;
        let (time, stamp) = stamp(&self.log, finding.time)?;
        self.log.send(&mut self.topics.findings, time, |m| m.finding(stamp, finding))?;
        self.topics.lanes.finding(&mut self.log, finding)
    }
}

/// The time of a message, and its stamp: the latest logged time from before the clock was known.
fn stamp(log: &LogWriter, time: Time) -> Result<(Time, Stamp), StreamFailure> {
    let time = if time <= Time::MIN { log.latest } else { time };
    Ok((time, Stamp::new(time)?))
}
