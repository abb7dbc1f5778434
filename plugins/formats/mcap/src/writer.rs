//! The messages of a log, in chunks.

use crate::background::Background;
use crate::chunk::{Chunk, Definitions, LENGTH, Topic};
use crate::file::{Compression, LogFile};
use crate::log::StreamFailure;
use crate::message::Encoder;
use navfuse_core::files::WholeFile;
use navfuse_core::units::time::Time;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::io;

/// Takes messages that go elsewhere than into a file.
///
/// ```
/// /// Counts the bytes of all messages.
/// #[derive(Debug)]
/// struct Bytes(usize);
///
/// impl navfuse_mcap::Outlet for Bytes {
///     fn message(&mut self, _channel: u16, _log_time: u64, message: &[u8]) {
///         self.0 += message.len();
///     }
/// }
/// ```
pub trait Outlet: Debug + Send {
    /// Takes a message of a channel, in the order of the definitions; the time is in ns.
    fn message(&mut self, channel: u16, log_time: u64, message: &[u8]);
}

/// Where messages go.
#[derive(Debug)]
enum Way {
    /// The file, and the chunk that is being filled.
    File(Background, Chunk),
    /// An outlet, and the message that is being encoded.
    Outlet(Box<dyn Outlet>, Vec<u8>),
}

/// The way of the messages, and their times.
#[derive(Debug)]
pub(crate) struct LogWriter {
    way: Way,
    /// Log time minus run time, ns.
    offset: i64,
    /// The latest time that was logged.
    pub(crate) latest: Time,
}

impl LogWriter {
    /// Begins a file whose log times are those of the run plus an offset in ns; `head` writes what
    /// stands before the messages.
    pub(crate) fn begin(
        file: WholeFile,
        compression: Compression,
        version: &str,
        definitions: Definitions,
        offset: i64,
        head: impl FnOnce(&mut LogFile<WholeFile>) -> io::Result<()>,
    ) -> io::Result<Self> {
        let mut chunk = Chunk::default();
        chunk.records.extend_from_slice(&definitions.schemas);
        chunk.records.extend_from_slice(&definitions.channels);
        let library = format!("navfuse {version}");
        let mut file = LogFile::begin(file, compression, &library, definitions)?;
        head(&mut file)?;
        let file = Background::start(file)?;
        Ok(Self { way: Way::File(file, chunk), offset, latest: Time::MIN })
    }

    /// Sends messages to an outlet, with the times of the run.
    pub(crate) fn to(outlet: Box<dyn Outlet>) -> Self {
        Self { way: Way::Outlet(outlet, Vec::new()), offset: 0, latest: Time::MIN }
    }

    /// The log time of a time of the run, in ns; zero for an earlier one.
    pub(crate) fn log_time(&self, time: Time) -> u64 {
        u64::try_from(time.nanos().saturating_add(self.offset)).unwrap_or(0)
    }

    /// Length of the file so far, without the messages that wait.
    pub(crate) fn length(&self) -> u64 {
        match &self.way {
            Way::File(file, _) => file.written(),
            Way::Outlet(..) => 0,
        }
    }

    /// Completes the file, which then takes its name.
    pub(crate) fn finish(&mut self) -> Result<(), StreamFailure> {
        self.write_chunk()?;
        match &mut self.way {
            Way::File(file, _) => file.finish(),
            Way::Outlet(..) => Ok(()),
        }
    }

    /// Writes a message.
    pub(crate) fn send(
        &mut self,
        topic: &mut Topic,
        time: Time,
        encode: impl FnOnce(Encoder<'_>),
    ) -> Result<(), StreamFailure> {
        let log_time = self.log_time(time);
        self.latest = self.latest.max(time);
        let whole = match &mut self.way {
            Way::File(_, chunk) => {
                chunk.message(topic, log_time, |out| encode(Encoder::new(out)));
                chunk.records.len() >= LENGTH
            }
            Way::Outlet(outlet, message) => {
                message.clear();
                encode(Encoder::new(message));
                outlet.message(topic.channel, log_time, message);
                false
            }
        };
        topic.sequence = topic.sequence.wrapping_add(1);
        if whole { self.write_chunk() } else { Ok(()) }
    }

    /// Writes texts by their names, after all messages so far.
    pub(crate) fn metadata(
        &mut self,
        name: &'static str,
        entries: BTreeMap<String, String>,
    ) -> Result<(), StreamFailure> {
        self.write_chunk()?;
        match &mut self.way {
            Way::File(file, _) => file.metadata(name, entries),
            Way::Outlet(..) => Ok(()),
        }
    }

    fn write_chunk(&mut self) -> Result<(), StreamFailure> {
        match &mut self.way {
            Way::File(file, chunk) if !chunk.records.is_empty() => file.write(chunk),
            Way::File(..) | Way::Outlet(..) => Ok(()),
        }
    }
}

impl Drop for LogWriter {
    /// Writes the messages so far: a run that was aborted leaves them in the part of the file.
    fn drop(&mut self) {
        self.write_chunk().ok();
    }
}
