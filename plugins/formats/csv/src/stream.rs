//! The samples of one file.

mod rows;
mod trailer;

use crate::bounded::{Bounded, Form};
use crate::cells::{ChannelCell, channel_cells, usual_header, without_column};
use crate::config::{Decimal, Delimiter, Disorder, FileConfig, Nan};
use crate::counter::Counter;
use crate::number;
use crate::spread::Spread;
use crate::stamp::TimeCell;
use crate::suffixes::Suffixes;
use crate::tail;
use crate::text::text;
use crate::time::{self, TimeError};
use crate::turned::Turned;
use crate::unused::{Status, Tally, Unused};
use crate::vectors::{Vectors, spread};
use csv::{ByteRecord, Reader, ReaderBuilder};
use navfuse_core::model::record::Level;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{StreamError, StreamErrorKind};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::validity::Judge;
use std::path::{Path, PathBuf};

/// Size of the read buffer in bytes.
const BUFFER: usize = 64 * 1024;
/// Time from which a clock counts from a date: ten years. A stamp of zero on it is none.
const DATED: Time = Time::from_nanos(315_576_000_000_000_000);

/// The absolute path, for messages about missing files.
pub fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// The kind of a row.
enum Row {
    Sample,
    /// The row has no channel of the sensor.
    Empty,
    Unused(Unused),
}

/// A problem of a row, and whether a cut-off file may be the cause.
struct Problem {
    kind: StreamErrorKind,
    text: String,
    cut: bool,
}

/// One file.
pub struct Stream {
    pub path: PathBuf,
    name: String,
    reader: Reader<Bounded>,
    record: ByteRecord,
    headings: Vec<String>,
    sensor: SensorId,
    time: TimeCell,
    pub channels: Vec<ChannelCell>,
    /// Texts of the cells that a row must have, by column.
    rows: Vec<(usize, String)>,
    judge: Judge,
    turned: Turned,
    suffixes: Suffixes,
    vectors: Vectors,
    status: Status,
    /// A note on the channels without a column.
    note: Option<(Level, String)>,
    disorder: Disorder,
    nan: Nan,
    counter: Counter,
    /// Set if a row that repeats the last sample is none, and this sample.
    changes_only: bool,
    /// Set if commas separate the cells.
    comma: bool,
    /// The samples of one stamp, if they are spread up to the next one.
    spread: Option<Spread>,
    last: Option<Sample>,
    end: Option<Time>,
    unused: Tally,
    cut: Option<String>,
}

fn builder(config: &FileConfig) -> ReaderBuilder {
    let mut builder = ReaderBuilder::new();
    // rows with too few or too many cells get a message of this crate
    builder.has_headers(false).flexible(true).buffer_capacity(BUFFER);
    builder.comment(u8::try_from(config.comment).ok()).delimiter(config.delimiter.byte());
    builder
}

/// The texts of the cells that a row must have, by column.
fn chosen(
    config: &FileConfig,
    headings: &[String],
    sensor: &str,
) -> Result<Vec<(usize, String)>, StreamError> {
    let column = |(heading, text): (&String, &String)| {
        let found = headings.iter().position(|h| h == heading);
        let missing = || {
            StreamError::format(format!("no column {heading:?}"))
                .with_remedy(format!("set files.{sensor}.rows"))
        };
        Ok((found.ok_or_else(missing)?, text.clone()))
    };
    config.rows.iter().map(column).collect()
}

impl Stream {
    /// Opens a file; with `part`, the file is one of two and may lack channels of any sensor.
    ///
    /// # Errors
    /// When it cannot be read, or its columns do not fit.
    pub fn open(
        path: &Path,
        config: &FileConfig,
        (sensor, info): (SensorId, &SensorInfo),
        part: bool,
    ) -> Result<Self, StreamError> {
        let name = &info.name;
        let form = Form {
            joined: config.delimiter == Delimiter::Whitespace,
            decimal_comma: config.decimal == Decimal::Comma,
            until: config.until,
            skipped: (config.skip, u8::try_from(config.comment).unwrap_or(b'#')),
            labels: config.labels.then(|| config.headings.clone()).flatten(),
            each: config.each.clone(),
            beside: config.beside.clone(),
            stamps: config.stamps.clone().map(|mark| (mark, char::from(config.delimiter.byte()))),
            widths: config.widths.clone(),
            backwards: config.backwards.then(|| config.skip + u64::from(config.headings.is_none())),
        };
        if !config.beside.is_empty() && !config.labels {
            let text = format!("files.{name}.beside needs labels = true, and headings");
            return Err(StreamError::scenario(text));
        }
        if config.labels && config.headings.is_none() {
            let text = format!("files.{name}.labels needs the names of the values: set headings");
            return Err(StreamError::scenario(text));
        }
        let bytes = Bounded::open(path, BUFFER, form).map_err(|e| {
            StreamError::open(absolute(path), e)
                .of_sensor(name)
                .with_remedy(format!("set files.{name}.path, or the source's directory"))
        })?;
        let mut reader = builder(config).from_reader(bytes);
        let mut record = ByteRecord::new();
        let headings = match &config.headings {
            Some(headings) => headings.clone(),
            None => Self::read_headings(&mut reader, &mut record, path, config, info)?,
        };
        let vectors = Vectors::new(&headings, &config.vectors);
        let headings = spread(headings, &config.vectors);
        let time = TimeCell::find(info, config, &headings).map_err(|e| e.in_file(path))?;
        let channels = channel_cells(info, config, &headings, part).map_err(|e| e.in_file(path))?;
        let rows = chosen(config, &headings, name).map_err(|e| e.in_file(path))?;
        let status = Status::find(info, config, &headings).map_err(|e| e.in_file(path))?;
        let note = without_column(info, &time, &channels, &headings)
            .map(|(level, text)| (level, format!("{}: {text}", path.display())));
        let mut stream = Self {
            path: path.to_owned(),
            name: name.clone(),
            reader,
            record,
            headings,
            sensor,
            time,
            channels,
            rows,
            judge: Judge::new(info),
            turned: Turned::new(config, info),
            suffixes: Suffixes::new(&config.suffixes),
            vectors,
            status,
            note,
            disorder: config.disorder,
            nan: config.nan,
            counter: Counter::default(),
            changes_only: config.changes_only,
            comma: config.delimiter == Delimiter::default(),
            spread: (config.disorder == Disorder::Spread).then(Spread::default),
            last: None,
            end: None,
            unused: Tally::default(),
            cut: None,
        };
        stream.end = stream.last_time(config);
        Ok(stream)
    }

    /// The headings of the columns.
    pub fn headings(&self) -> &[String] {
        &self.headings
    }

    /// Reads the headings in the first line.
    fn read_headings(
        reader: &mut Reader<Bounded>,
        record: &mut ByteRecord,
        path: &Path,
        config: &FileConfig,
        info: &SensorInfo,
    ) -> Result<Vec<String>, StreamError> {
        let name = &info.name;
        let fail = |text: String| StreamError::format(text).in_file(path);
        if !reader.read_byte_record(record).map_err(|e| StreamError::read(path, e))? {
            return Err(fail(format!(
                "the file is empty; its first line must name the columns: {}",
                usual_header(info)
            )));
        }
        if record.as_slice().contains(&0) {
            return Err(fail(
                "the file is not UTF-8 text; if it is UTF-16, save it as UTF-8".into(),
            ));
        }
        let headings: Vec<String> =
            record.iter().map(|h| text(h.trim_ascii()).into_owned()).collect();
        if headings[0].parse::<f64>().is_ok() {
            return Err(fail(format!(
                "the first line must name the columns, such as {}; it starts with {:?}; for a file \
                 without headings, set files.{name}.headings",
                usual_header(info),
                headings[0]
            )));
        }
        if let [only] = headings.as_slice()
            && let Some(other) = [',', ';', '\t', '|']
                .into_iter()
                .find(|c| *c as u8 != config.delimiter.byte() && only.contains(*c))
        {
            return Err(fail(format!(
                "the columns seem to be separated by {other:?}: set files.{name}.delimiter = {:?}",
                other.to_string()
            )));
        }
        Ok(headings)
    }

    /// The time of the last complete row; `None` where the end of the file cannot be read alone.
    fn last_time(&self, config: &FileConfig) -> Option<Time> {
        if self.reader.get_ref().is_changed() || !self.rows.is_empty() || config.until.is_some() {
            return None;
        }
        let mut record = ByteRecord::new();
        tail::last_lines(&self.path)?.iter_mut().find_map(|line| {
            if config.decimal == Decimal::Comma {
                line.iter_mut().filter(|b| **b == b',').for_each(|b| *b = b'.');
            }
            builder(config).from_reader(line.as_slice()).read_byte_record(&mut record).ok()?;
            self.vectors.spread(&mut record);
            let complete = record.len() == self.headings.len();
            complete.then(|| self.time.of(&record).ok()).flatten()
        })
    }

    /// The line of the row that was read last.
    fn line(&self) -> u64 {
        let position = self.reader.position();
        if self.reader.get_ref().is_changed() {
            // the line after the row, unless the file ends within it
            let ended = u64::from(!self.ends_within_line());
            return position.line().saturating_sub(ended).max(1);
        }
        tail::line_before(&self.path, position.byte())
    }

    /// Tests whether the file ends within the row that was read last.
    fn ends_within_line(&self) -> bool {
        let (byte, bytes) = (self.reader.position().byte(), self.reader.get_ref());
        if bytes.is_changed() {
            bytes.ends_within_line(byte)
        } else {
            tail::ends_within_line(&self.path, byte)
        }
    }

    /// Reads the row in the record into a sample.
    fn row(&mut self, sample: &mut Sample) -> Result<Row, Problem> {
        let (found, needed) = (self.record.len(), self.headings.len());
        if found == 1 && self.record[0].trim_ascii().is_empty() {
            // a line of spaces, or a comment without a line end at the end of the file
            return Ok(Row::Empty);
        }
        let cell = |k: usize| self.record.get(k).unwrap_or_default().trim_ascii();
        if self.rows.iter().any(|(k, text)| cell(*k) != text.as_bytes()) {
            return Ok(Row::Empty);
        }
        if found != needed {
            let text = format!("{found} cells, the header has {needed}");
            return Err(Problem { kind: StreamErrorKind::Format, text, cut: found < needed });
        }
        let time = match self.time.of(&self.record) {
            // a program that went on writing begins again with its headings
            Err(_) if cell(self.time.column) == self.headings[self.time.column].as_bytes() => {
                return Ok(Row::Empty);
            }
            // a row of another sensor, which has a stamp of its own
            Err(_) if self.has_nothing() => return Ok(Row::Empty),
            time => time.map_err(|e| self.no_time(e))?,
        };
        let (time, period) = self.counter.time(&self.time, time);
        *sample = Sample::empty(time, self.sensor);
        for channel in &self.channels {
            match channel.value(&self.record) {
                None => {}
                Some(value) if value.is_finite() => sample.set(channel.channel, value),
                Some(_) => self.no_number(channel.column)?,
            }
        }
        self.turned.apply(sample);
        if time.nanos() == 0 && self.end.is_some_and(|end| end > DATED) {
            return Ok(Row::Unused(Unused::NoStamp));
        }
        let empty = sample.present() == 0;
        match self.counter.before() {
            // a row of another sensor may have the time of the row before
            _ if empty => {}
            Some(before) if time == before && self.disorder == Disorder::Spread => {}
            Some(before) if time <= before => match self.disorder {
                Disorder::Skip | Disorder::Spread => return Ok(Row::Unused(Unused::Order)),
                Disorder::Error => return Err(self.out_of_order(before, time)),
            },
            _ => self.counter.go_on(time, period),
        }
        if self.status.refuses(&self.record) {
            return Ok(Row::Unused(Unused::Invalid));
        }
        if let Some(missing) = self.judge.refuses(sample) {
            return Ok(Row::Unused(missing.into()));
        }
        if empty || (self.changes_only && self.repeats(sample)) {
            return Ok(Row::Empty);
        }
        self.last = self.changes_only.then_some(*sample);
        Ok(Row::Sample)
    }

    /// Tests whether the cells of the time and of all channels are empty.
    fn has_nothing(&self) -> bool {
        let mut columns = self.channels.iter().map(|c| c.column).chain([self.time.column]);
        columns.all(|k| self.record.get(k).unwrap_or_default().trim_ascii().is_empty())
    }

    /// Tests whether a sample has the values of the last one.
    fn repeats(&self, sample: &Sample) -> bool {
        let channels = || self.channels.iter().map(|c| c.channel);
        self.last.is_some_and(|last| channels().all(|k| last.get(k) == sample.get(k)))
    }

    /// The heading and the content of a cell, for a message.
    fn cell(&self, column: usize) -> String {
        let cell =
            String::from_utf8_lossy(self.record.get(column).unwrap_or_default().trim_ascii());
        let (heading, short) = (&self.headings[column], cell.chars().take(40).collect::<String>());
        format!("{heading} = {short:?}")
    }

    fn no_time(&self, error: TimeError) -> Problem {
        let cell = self.cell(self.time.column);
        let text = match error {
            TimeError::NotANumber => format!("{cell} is no time: {}", self.time.needs()),
            TimeError::TooLarge => {
                format!(
                    "{cell} is more than 73 years from zero; is its unit another? \
                     Set files.{}.time.unit",
                    self.name
                )
            }
        };
        Problem { kind: StreamErrorKind::Format, text, cut: false }
    }

    /// Accepts a cell without a finite number as a missing channel, or rejects it.
    fn no_number(&self, column: usize) -> Result<(), Problem> {
        let text = std::str::from_utf8(self.record.get(column).unwrap_or_default().trim_ascii());
        let text = text.ok();
        let absent =
            text.is_some_and(|t| t.parse::<f64>().is_ok()) || text.is_some_and(number::is_absent);
        if absent && self.nan == Nan::Missing {
            return Ok(());
        }
        let cell = self.cell(column);
        let text = match text {
            _ if absent => {
                format!(
                    "{cell} is not finite; leave such cells empty, \
                     or set files.{}.nan = \"missing\"",
                    self.name
                )
            }
            None => format!("{cell} is not UTF-8 text: the file is damaged or not text"),
            Some(t) if t.contains(',') => {
                format!("{cell} is no number: a decimal point is needed, not a comma")
            }
            Some(_) => format!("{cell} is no number; leave a cell empty where there is no value"),
        };
        // only the last cell can hold a cut-off number, such as "-9.81e-"
        let cut = column + 1 == self.headings.len();
        Err(Problem { kind: StreamErrorKind::Format, text, cut })
    }

    fn out_of_order(&self, before: Time, time: Time) -> Problem {
        let cell = self.cell(self.time.column);
        let what = if time == before {
            "is the time of a row before, too".to_owned()
        } else {
            let mut step = Vec::new();
            time::write_seconds((before - time).nanos(), &mut step);
            format!("goes back by {} s", String::from_utf8_lossy(&step))
        };
        let remedy = format!(
            "sort the file, or set files.{}.disorder = \"skip\" to leave such rows out",
            self.name
        );
        let text = format!("{cell} {what}; {remedy}");
        Problem { kind: StreamErrorKind::Order, text, cut: false }
    }
}
