//! The metadata of a log, and its summary.

use crate::records::{Chunks, Records, Step};
use mcap::records::{Metadata, Record, op};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader};
use mcap::{McapError, Summary};
use navfuse_core::model::stream::StreamError;
use navfuse_frames::mcap::ChunkError;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

/// The name of the metadata record.
pub const METADATA: &str = "navfuse";
/// The name of the metadata record with the verdict of the run.
pub const VERDICT: &str = "navfuse_verdict";
/// The entry of that record: the verdict as JSON.
pub const VERDICT_ENTRY: &str = "json";
/// The name of the attachment with the scenario.
pub const SCENARIO: &str = "scenario.toml";

/// The reason why a log cannot be written, without the path of the log.
#[derive(Debug, thiserror::Error)]
pub enum StreamFailure {
    /// The disk is full, or the reader of a pipe has gone.
    #[error("{0}")]
    Io(std::io::Error),
    /// The content violates the format.
    #[error("{0}")]
    Format(McapError),
    /// A chunk cannot be unpacked.
    #[error(transparent)]
    Chunk(#[from] ChunkError),
    /// The message cannot be encoded.
    #[error(transparent)]
    Content(#[from] StreamError),
}

impl From<std::io::Error> for StreamFailure {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<McapError> for StreamFailure {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(io) => Self::Io(io),
            other => Self::Format(other),
        }
    }
}

/// The error of a record that does not follow the format.
pub(crate) fn damaged(error: McapError) -> StreamError {
    let cause = StreamFailure::from(error);
    StreamError::format(format!("damaged record: {cause}")).with_source(cause)
}

/// The metadata of the run in a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogInfo {
    /// The scenario's name.
    pub name: String,
    /// The scenario in TOML, as it was run.
    pub scenario: String,
    /// Description of the scenario.
    pub description: Option<String>,
    /// Seed of the run.
    pub seed: Option<u64>,
    /// True for a run whose samples were simulated; false also for a log without this entry.
    pub simulated: bool,
    /// Version of the program that recorded it.
    pub version: String,
    /// Log time minus run time, ns.
    pub log_time_offset: i64,
}

impl LogInfo {
    fn new(record: Metadata) -> Option<Self> {
        let mut entries = record.metadata;
        Some(Self {
            name: entries.remove("name")?,
            scenario: entries.remove("scenario")?,
            description: entries.remove("description"),
            seed: entries.remove("seed").and_then(|seed| seed.parse().ok()),
            simulated: entries.remove("simulated").is_some_and(|text| text == "true"),
            version: entries.remove("version")?,
            log_time_offset: entries.remove("log_time_offset_ns")?.parse().ok()?,
        })
    }
}

/// Reads the metadata of the run. They are at the beginning of the file, so that a log that was cut
/// off has them too.
///
/// # Errors
/// When the file cannot be read, is not an MCAP file, or was not recorded by navfuse.
pub fn read_scenario(path: &Path) -> Result<LogInfo, StreamError> {
    read_info(path, false)?.ok_or_else(|| {
        let why = "navfuse did not record it, or it was cut off at its beginning";
        StreamError::format(format!("it holds no scenario: {why}"))
            .in_file(path)
            .with_remedy("give one with --scenario")
    })
}

/// Reads the metadata of the run, if there are any; with `at_start` only before the first message.
pub(crate) fn read_info(path: &Path, at_start: bool) -> Result<Option<LogInfo>, StreamError> {
    let mut records = Records::open(path, Chunks::Passed)?;
    let found = records.find(|opcode, data| match opcode {
        op::METADATA => Ok(match mcap::parse_record(opcode, data) {
            Ok(Record::Metadata(m)) if m.name == METADATA => Some(LogInfo::new(m)),
            _ => None,
        }),
        op::CHUNK | op::MESSAGE if at_start => Ok(Some(None)),
        _ => Ok(None),
    })?;
    Ok(if let Step::Found(info) = found { info } else { None })
}

/// The summary at the end of a file; `None` if the file was cut off.
pub fn summary(path: &Path) -> Option<Summary> {
    let mut file = File::open(path).ok()?;
    let mut reader = SummaryReader::new();
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            SummaryReadEvent::ReadRequest(n) => {
                let read = file.read(reader.insert(n)).ok()?;
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(file.seek(to).ok()?),
        }
    }
    reader.finish()
}
