//! The messages of a log, in chunks.

use crate::background::Background;
use crate::chunk::{Chunk, Definitions, LENGTH, Topic};
use crate::file::{Compression, LogFile};
use crate::log::StreamFailure;
use crate::message::Encoder;
use navfuse_core::files::WholeFile;
use navfuse_core::units::time::Time;
use std::collections::BTreeMap;
use std::io;

/// The file, and the chunk that is being filled.
#[derive(Debug)]
pub(crate) struct LogWriter {
    file: Background,
    chunk: Chunk,
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
        Ok(Self { file, chunk, offset, latest: Time::MIN })
    }

    /// The log time of a time of the run, in ns; zero for an earlier one.
    pub(crate) fn log_time(&self, time: Time) -> u64 {
        u64::try_from(time.nanos().saturating_add(self.offset)).unwrap_or(0)
    }

    /// Length of the file so far, without the messages that wait.
    pub(crate) fn length(&self) -> u64 {
        self.file.written()
    }

    /// Completes the file, which then takes its name.
    pub(crate) fn finish(&mut self) -> Result<(), StreamFailure> {
        self.write_chunk()?;
        self.file.finish()
    }

    /// Writes a message.
    pub(crate) fn send(
        &mut self,
        topic: &mut Topic,
        time: Time,
        encode: impl FnOnce(Encoder<'_>),
    ) -> Result<(), StreamFailure> {
        let log_time = self.log_time(time);
        self.chunk.message(topic, log_time, |out| encode(Encoder::new(out)));
        topic.sequence = topic.sequence.wrapping_add(1);
        self.latest = self.latest.max(time);
        if self.chunk.records.len() < LENGTH { Ok(()) } else { self.write_chunk() }
    }

    /// Writes texts by their names, after all messages so far.
    pub(crate) fn metadata(
        &mut self,
        name: &'static str,
        entries: BTreeMap<String, String>,
    ) -> Result<(), StreamFailure> {
        self.write_chunk()?;
        self.file.metadata(name, entries)
    }

    fn write_chunk(&mut self) -> Result<(), StreamFailure> {
        if self.chunk.records.is_empty() { Ok(()) } else { self.file.write(&mut self.chunk) }
    }
}

impl Drop for LogWriter {
    /// Writes the messages so far: a run that was aborted leaves them in the part of the file.
    fn drop(&mut self) {
        self.write_chunk().ok();
    }
}
