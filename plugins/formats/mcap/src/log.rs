//! The metadata of a log, and its summary.

use crate::records::Records;
use mcap::McapError;
use mcap::records::{self, Metadata, Record, op};
use navfuse_core::model::stream::StreamError;
use navfuse_frames::mcap::{Chunks, Fields, HEAD, LONGEST, MAGIC, is_sound, whole_head};
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
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
    Io(#[source] std::io::Error),
    /// The content violates the format.
    #[error("{0}")]
    Format(McapError),
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
    /// Of a log in several files: the time of the run's first sample, ns, and the number of this file.
    pub part: Option<(i64, u32)>,
}

impl LogInfo {
    fn new(record: Metadata) -> Option<Self> {
        let mut entries = record.metadata;
        let part = entries.remove("part").and_then(|number| number.parse().ok());
        let first = entries.remove("run_first_ns").and_then(|time| time.parse().ok());
        Some(Self {
            name: entries.remove("name")?,
            scenario: entries.remove("scenario")?,
            description: entries.remove("description"),
            seed: entries.remove("seed").and_then(|seed| seed.parse().ok()),
            simulated: entries.remove("simulated").is_some_and(|text| text == "true"),
            version: entries.remove("version")?,
            log_time_offset: entries.remove("log_time_offset_ns")?.parse().ok()?,
            part: first.zip(part),
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
        op::METADATA => Ok(match parse(opcode, data) {
            Ok(Record::Metadata(m)) if m.name == METADATA => Some(LogInfo::new(m)),
            _ => None,
        }),
        op::CHUNK | op::MESSAGE if at_start => Ok(Some(None)),
        _ => Ok(None),
    })?;
    Ok(found.flatten())
}

/// Reads a record, once its texts are known to be as long as they claim.
///
/// # Errors
/// When the record does not follow the format.
pub(crate) fn parse(opcode: u8, data: &[u8]) -> Result<Record<'_>, StreamError> {
    if !is_sound(opcode, data) {
        return Err(damaged(McapError::UnexpectedEof));
    }
    mcap::parse_record(opcode, data).map_err(damaged)
}

/// What the summary at the end of a log states.
#[derive(Debug, Default)]
pub(crate) struct Summary {
    /// The channels in the order of their ids, each with the name of its schema.
    pub channels: BTreeMap<u16, (records::Channel, String)>,
    /// Log time of the last message, ns; none in a log without messages.
    pub end: Option<u64>,
}

/// The summary at the end of a file; `None` if the file was cut off.
pub(crate) fn summary(path: &Path) -> Option<Summary> {
    /// Number of bytes of a footer and of the mark at the end.
    const TAIL: usize = HEAD + 20 + MAGIC.len();
    let mut file = navfuse_core::input::open(path).ok()?;
    let from = file.seek(SeekFrom::End(-(TAIL as i64))).ok()?;
    let mut tail = [0; TAIL];
    file.read_exact(&mut tail).ok()?;
    let (op::FOOTER, 20) = whole_head(&tail)? else { return None };
    let start = Fields(&tail[HEAD..]).u64().filter(|at| (1..=from).contains(at))?;
    let length = usize::try_from(from - start).ok().filter(|n| *n <= LONGEST)?;
    file.seek(SeekFrom::Start(start)).ok()?;
    let mut section = vec![0; length];
    file.read_exact(&mut section).ok()?;
    let (mut rest, mut found, mut schemas) = (&section[..], Summary::default(), BTreeMap::new());
    while !rest.is_empty() {
        let (opcode, length) = whole_head(rest)?;
        let (content, later) = rest[HEAD..].split_at_checked(length)?;
        rest = later;
        // the index, which a reader from front to back does not need, is passed over
        if ![op::SCHEMA, op::CHANNEL, op::STATISTICS].contains(&opcode) {
            continue;
        }
        match parse(opcode, content).ok()? {
            Record::Schema { header, .. } => drop(schemas.insert(header.id, header.name)),
            Record::Channel(channel) => {
                let schema = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                found.channels.insert(channel.id, (channel, schema));
            }
            Record::Statistics(s) if s.message_count > 0 => found.end = Some(s.message_end_time),
            _ => {}
        }
    }
    Some(found)
}
