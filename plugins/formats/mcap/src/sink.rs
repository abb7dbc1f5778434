//! The sink: every sample, estimate, innovation and event of a run in one MCAP file.

use crate::file::{Compression, LogFile};
use crate::layout;
use crate::log::{METADATA, SCENARIO, StreamFailure, VERDICT, VERDICT_ENTRY};
use crate::messages::Messages;
use crate::pause::Pause;
use crate::writer::LogWriter;
use navfuse_core::files::{WholeFile, numbered, part_of, write_whole};
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{Event, Level, Record};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::plugin::{OpenContext, SinkType};
use navfuse_core::run::background::Background;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::{Span, Time};
use navfuse_core::units::{Duration, Positive};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::error::Error;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

/// Records the run in an MCAP file, which `navfuse replay`, ROS 2 tools, Foxglove and rerun read:
/// every sample, the estimates of all states, innovations, events and the scenario.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mcap {
    /// The file, relative to the output folder of the run. Default: `run.mcap`.
    #[serde(default = "run_mcap")]
    pub path: PathBuf,
    /// `zstd` (default, smallest), `lz4` (faster) or `none` (fastest).
    #[serde(default)]
    pub compression: Compression,
    /// Begins a new file (`run-0002.mcap`) after this time, such as `1 h`; `navfuse replay` reads
    /// all from the first one on. Default: one file.
    pub rotate_every: Option<Positive<Duration>>,
    /// Begins a new file once one has this many MB. Default: one file.
    pub rotate_mb: Option<NonZeroU32>,
}

fn run_mcap() -> PathBuf {
    "run.mcap".into()
}

const SECOND: u64 = 1_000_000_000;
/// Most pauses of a log that its end lists.
const LISTED: usize = 8;

impl SinkType for Mcap {
    const TYPE: &'static str = "mcap";

    fn files(&self) -> Vec<PathBuf> {
        vec![self.path.clone(), layout::beside(&self.path)]
    }

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let mut sink = McapSink::create(&context.output.join(&self.path), self.compression)?;
        sink.limits = Limits {
            age: self.rotate_every.and_then(|age| Span::from_seconds(age.value().si())),
            bytes: self.rotate_mb.map(|mb| 1_000_000 * u64::from(mb.get())),
        };
        Ok(Box::new(Background::new(sink)))
    }
}

/// The age and the length beyond which a log goes on in a new file.
#[derive(Clone, Copy, Debug, Default)]
struct Limits {
    age: Option<Span>,
    bytes: Option<u64>,
}

/// A log that is being written.
///
/// Writing starts with the first sample: its time decides the offset of the log time.
#[derive(Debug)]
pub struct McapSink {
    path: PathBuf,
    compression: Compression,
    limits: Limits,
    file: Option<WholeFile>,
    run: Option<RunInfo>,
    /// Events before the first sample.
    held: Vec<Event>,
    recording: Option<Recording>,
    /// Time of the first sample, once there is one.
    first: Option<Time>,
    /// Number of the file that is being written, from 1.
    number: u32,
    /// Set while a log of several files cannot be written.
    pause: Option<Pause>,
    /// The pauses so far, in words.
    pauses: Vec<String>,
}

impl McapSink {
    /// Creates the part of the file; the file takes its name when the log is whole. A program that
    /// is reading an older log of the same name still reads it to the end.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(path: &Path, compression: Compression) -> Result<Self, StreamError> {
        let file = WholeFile::create(path).map_err(|e| StreamError::sink(Mcap::TYPE, path, e))?;
        let path = path.to_path_buf();
        Ok(Self {
            path,
            compression,
            limits: Limits::default(),
            file: Some(file),
            run: None,
            held: Vec::new(),
            recording: None,
            first: None,
            number: 1,
            pause: None,
            pauses: Vec::new(),
        })
    }

    /// The recording, which starts now unless it has started before.
    fn recording(&mut self, now: Time) -> Result<&mut Recording, StreamError> {
        let recording = match self.recording.take() {
            Some(recording) => recording,
            None => {
                let (Some(file), Some(run)) = (self.file.take(), &self.run) else {
                    return Err(failure(&self.path, "it is closed"));
                };
                let part = (*self.first.get_or_insert(now), self.number);
                let mut recording = Recording::begin(file, self.compression, run, now, part)
                    .map_err(|e| failure(&self.path, e))?;
                for event in std::mem::take(&mut self.held) {
                    let event = Record::Event(&event);
                    recording.messages.take(&event).map_err(|e| failure(&self.path, e))?;
                }
                recording
            }
        };
        Ok(self.recording.insert(recording))
    }

    fn record(
        &mut self,
        now: Time,
        write: impl FnOnce(&mut Messages) -> Result<(), StreamFailure>,
    ) -> Result<(), StreamError> {
        if self.pause.is_some() {
            return Ok(());
        }
        let recorded = match self.recording(now) {
            Ok(recording) => write(&mut recording.messages).map_err(|e| failure(&self.path, e)),
            Err(error) => Err(error),
        };
        recorded.or_else(|error| self.fail(now, error))
    }

    /// Ends a log that cannot be written. One of several files goes on in a new one.
    fn fail(&mut self, now: Time, error: StreamError) -> Result<(), StreamError> {
        // a log with a hole never takes its name
        self.recording = None;
        if self.limits.age.is_none() && self.limits.bytes.is_none() {
            return Err(error);
        }
        self.pause = Some(Pause::begin(now, error));
        Ok(())
    }

    /// Creates the next file of a log that could not be written, once there is room.
    fn resume(&mut self, now: Time) {
        if self.pause.is_none() {
            return; // the path takes longer than the question
        }
        let path = numbered(&self.path, self.number);
        let Some(pause) = self.pause.take_if(|pause| pause.is_over(&path)) else { return };
        // the file of this run that got no byte
        let part = part_of(&path);
        if std::fs::metadata(&part).is_ok_and(|m| m.is_file() && m.len() == 0) {
            std::fs::remove_file(part).ok();
        }
        let Ok(file) = WholeFile::create(&path) else {
            self.pause = Some(pause);
            return;
        };
        self.file = Some(file);
        let text = pause.describe(now);
        if self.pauses.len() < LISTED {
            self.pauses.push(text.clone());
        }
        let (level, about) = (Level::Warning, Mcap::TYPE.into());
        self.held.push(Event { time: now, level, about, text });
    }
}

impl McapSink {
    /// Takes a sample, with which a new file may begin.
    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        self.resume(sample.time);
        let Limits { age, bytes } = self.limits;
        let due = self.recording.as_ref().is_some_and(|r| {
            age.is_some_and(|age| sample.time - r.begin >= age)
                || bytes.is_some_and(|bytes| r.messages.log.length() >= bytes)
        });
        if due && let Err(error) = self.next_file() {
            return self.fail(sample.time, error);
        }
        self.write(sample.time, &Record::Sample(sample))
    }

    /// Completes the file, and creates the next one; no file without a sample is completed.
    fn next_file(&mut self) -> Result<(), StreamError> {
        let Some(mut recording) = self.recording.take() else { return Ok(()) };
        recording.messages.log.finish().map_err(|e| failure(&self.path, e))?;
        self.number += 1;
        let path = numbered(&self.path, self.number);
        let file = WholeFile::create(&path).map_err(|e| StreamError::sink(Mcap::TYPE, path, e))?;
        self.file = Some(file);
        Ok(())
    }
}

/// An error of writing the log, with its remedy.
fn failure(path: &Path, cause: impl Into<Box<dyn Error + Send + Sync>>) -> StreamError {
    let error = StreamError::sink(Mcap::TYPE, path, cause);
    let part = part_of(path);
    if part.is_file() {
        error.with_remedy(format!("`navfuse replay {}` reads what was written", part.display()))
    } else {
        error
    }
}

impl Sink for McapSink {
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.run = Some(run.clone());
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Sample(sample) => self.sample(sample),
            Record::Event(event) => self.event(event),
            Record::Verdict(verdict) => self.verdict(verdict),
            Record::Epoch(epoch) | Record::Filtered(epoch) => self.write(epoch.state.time, record),
            Record::Update(update) => self.write(update.time, record),
            Record::InputRejection(rejection) => self.write(rejection.time, record),
            Record::Finding(finding) => self.write(finding.time, record),
            Record::Derived(derived) => self.write(derived.time, record),
            _ => Ok(()),
        }
    }

    fn reopen(&mut self) -> Result<(), StreamError> {
        self.next_file()
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        if let Some(pause) = self.pause.take() {
            return Err(pause.cause);
        }
        self.recording(Time::default())?;
        if let Some(mut recording) = self.recording.take() {
            recording.messages.log.finish().map_err(|e| failure(&self.path, e))?;
        }
        if let Some(run) = &self.run {
            let path = layout::beside(&self.path);
            let layout = format!("{:#}\n", layout::layout(run));
            write_whole(&path, layout.as_bytes())
                .map_err(|e| StreamError::sink(Mcap::TYPE, path, e))?;
        }
        let path = self.path.display();
        let files = match self.number {
            1 => path.to_string(),
            _ => format!("{path} to {}", numbered(&self.path, self.number).display()),
        };
        let pauses = self.pauses.iter().map(|pause| format!(", but {pause}"));
        Ok(Some(pauses.fold(files, |text, pause| text + &pause)))
    }
}

impl McapSink {
    /// Writes the messages of a record.
    fn write(&mut self, now: Time, record: &Record<'_>) -> Result<(), StreamError> {
        self.record(now, |messages| messages.take(record))
    }

    fn event(&mut self, event: &Event) -> Result<(), StreamError> {
        if self.recording.is_none() {
            if self.pause.is_none() {
                self.held.push(event.clone());
            }
            return Ok(());
        }
        self.write(event.time, &Record::Event(event))
    }

    fn verdict(&mut self, verdict: &Verdict) -> Result<(), StreamError> {
        let json = serde_json::to_string(verdict).map_err(|e| failure(&self.path, e))?;
        let metadata = BTreeMap::from([(VERDICT_ENTRY.to_owned(), json)]);
        self.record(Time::default(), |messages| {
            messages.take(&Record::Verdict(verdict))?;
            messages.log.metadata(VERDICT, metadata)
        })
    }
}

/// A log to which messages are being written.
#[derive(Debug)]
struct Recording {
    messages: Messages,
    begin: Time,
}

impl Recording {
    fn begin(
        file: WholeFile,
        compression: Compression,
        run: &RunInfo,
        begin: Time,
        (first, number): (Time, u32),
    ) -> Result<Self, StreamFailure> {
        // whole seconds, so that log times and stamps have the same fraction of a second
        let offset = (-first.nanos()).max(0).unsigned_abs().div_ceil(SECOND) * SECOND;
        let offset = i64::try_from(offset).unwrap_or(0);
        let mut entries = vec![
            ("name", run.name.clone()),
            ("version", run.version.clone()),
            ("seed", run.seed.to_string()),
            ("simulated", run.simulated.to_string()),
            ("log_time_offset_ns", offset.to_string()),
            ("scenario", run.scenario.clone()),
        ];
        entries.extend(run.description.clone().map(|text| ("description", text)));
        if number > 1 {
            entries.push(("part", number.to_string()));
            entries.push(("run_first_ns", first.nanos().to_string()));
        }
        let metadata = entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        let start = u64::try_from(begin.nanos().saturating_add(offset)).unwrap_or(0);
        let head = |file: &mut LogFile<WholeFile>| {
            file.metadata(METADATA, &metadata)?;
            file.attach(SCENARIO, "application/toml", start, run.scenario.as_bytes())
        };
        let messages = Messages::begin(run, begin, |definitions| {
            LogWriter::begin(file, compression, &run.version, definitions, offset, head)
        })?;
        Ok(Self { messages, begin })
    }
}
