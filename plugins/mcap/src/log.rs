//! The metadata of a log, and the reader of its records.

use mcap::records::{Metadata, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader};
use mcap::{McapError, Summary};
use navfuse_core::model::stream::StreamError;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};

/// The name of the metadata record.
pub const METADATA: &str = "navfuse";
/// The name of the metadata record with the verdict of the run.
pub const VERDICT: &str = "navfuse_verdict";
/// The entry of that record: the verdict as JSON.
pub const VERDICT_ENTRY: &str = "json";
/// The name of the attachment with the scenario.
pub const SCENARIO: &str = "scenario.toml";

/// Length in bytes above which a record counts as damaged, also one that a few bytes unpack to.
/// navfuse writes chunks of half a MiB; a buffer grows to twice the length of a record.
const LONGEST_RECORD: usize = 1 << 26;
/// Size in bytes of one read.
const BLOCK: usize = 1 << 16;

/// The reason why a log cannot be written, without the path of the log.
#[derive(Debug, thiserror::Error)]
pub enum StreamFailure {
    /// The disk is full, or the reader of a pipe has gone.
    #[error("{0}")]
    Io(std::io::Error),
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
    let mut records = Records::open(path, true)?;
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

/// The result of a search in a log.
#[derive(Debug, PartialEq)]
pub enum Step<T> {
    /// The search found something.
    Found(T),
    /// The log has ended.
    End,
    /// The log ends within a record.
    Cut,
}

/// The records of a file in their order, including those in chunks. The memory needed does not
/// depend on the length of the file.
pub struct Records {
    path: PathBuf,
    file: File,
    reader: LinearReader,
    /// Number of bytes that were read.
    pub position: u64,
    /// Set once a record was found, so that the file is an MCAP file.
    begun: bool,
}

impl Records {
    /// Opens a file; with `whole_chunks`, a chunk is one record.
    pub fn open(path: &Path, whole_chunks: bool) -> Result<Self, StreamError> {
        let file = File::open(path).map_err(|e| StreamError::open(path, e))?;
        let options = LinearReaderOptions::default()
            .with_emit_chunks(whole_chunks)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        let reader = LinearReader::new_with_options(options);
        Ok(Self { path: path.to_path_buf(), file, reader, position: 0, begun: false })
    }

    /// The path of this file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads records until `take` returns a result for one of them.
    pub fn find<T>(
        &mut self,
        mut take: impl FnMut(u8, &[u8]) -> Result<Option<T>, StreamError>,
    ) -> Result<Step<T>, StreamError> {
        loop {
            let want = match self.reader.next_event() {
                None => return Ok(Step::End),
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    self.begun = true;
                    match take(opcode, data).map_err(|e| e.in_file(&self.path))? {
                        Some(found) => return Ok(Step::Found(found)),
                        None => continue,
                    }
                }
                Some(Ok(LinearReadEvent::ReadRequest(n))) => n,
                Some(Err(McapError::UnexpectedEof))
                    if self.position >= mcap::MAGIC.len() as u64 =>
                {
                    return Ok(Step::Cut);
                }
                Some(Err(McapError::BadMagic | McapError::UnexpectedEof)) if !self.begun => {
                    return Err(StreamError::format("this is not an MCAP file")
                        .in_file(&self.path)
                        .with_remedy("a log of navfuse is called run.mcap"));
                }
                Some(Err(e)) => {
                    let cause = StreamFailure::from(e);
                    let message = format!("damaged at or before byte {}: {cause}", self.position);
                    return Err(StreamError::format(message)
                        .in_file(&self.path)
                        .with_source(cause));
                }
            };
            // blocks of a fixed size: a damaged length allocates no memory for bytes that do not
            // exist
            let buffer = self.reader.insert(want.clamp(BLOCK, 16 * BLOCK));
            let read = loop {
                match self.file.read(buffer) {
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    other => break other,
                }
            };
            let read = read.map_err(|e| StreamError::read(&self.path, e))?;
            self.reader.notify_read(read);
            self.position += read as u64;
        }
    }
}
