//! Reads a log without composing its scenario, for reports and tables.

use crate::log::{LogInfo, VERDICT, VERDICT_ENTRY, parse, read_info};
use crate::message::Stamp;
use crate::records::Records;
use crate::schema;
use crate::source::{read_imu, read_sample, read_time};
use crate::topics::{KIND, PURPOSE, RATES, purpose};
use mcap::records::{Record, op};
use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{Derived, Event, Level};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::Mode;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::mcap::Chunks;
use re_cdr::{CdrReader, LittleEndian};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// An entry of a log.
#[derive(Clone, Debug)]
pub enum Entry<'a> {
    /// A sensor; ids count from 0 in the order of these entries.
    Sensor(SensorEntry<'a>),
    /// A sample with the id of its sensor, and its columns, such as `vel_x_mps`.
    Sample(Sample, Vec<&'a str>),
    /// The estimate of one block at one epoch.
    Block(BlockEntry<'a>),
    /// The filter's own estimate of one block in a run that is smoothed.
    Filtered(BlockEntry<'a>),
    /// The use of a sample of a measuring sensor.
    Innovation(InnovationEntry<'a>),
    /// A rejected sample of a driving sensor.
    Rejection(RejectionEntry<'a>),
    /// An event. Each finding is among them, as a warning.
    Event(Event),
    /// A fault that was found.
    Finding(Finding),
    /// A derived quantity.
    Derived(Derived),
    /// The verdict of the run, at its end.
    Verdict(Verdict),
}

/// A sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorEntry<'a> {
    /// Name of the sensor in the scenario.
    pub name: &'a str,
    /// Registered type of the sensor; `None` in a log of a version that did not record it.
    pub kind: Option<&'a str>,
    /// Purpose of the sensor; `None` as above.
    pub purpose: Option<Purpose>,
}

/// The estimate of one block: the message `navfuse_msgs/BlockState`.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockEntry<'a> {
    /// The epoch.
    pub time: Time,
    /// `owner.name`, such as `dvl.scale`.
    pub name: &'a str,
    /// Treatment of the block by the filter.
    pub mode: Mode,
    /// Names of the components.
    pub components: Vec<&'a str>,
    /// Set if the estimate is latitude and longitude (deg) and height (m).
    pub geodetic: bool,
    /// Unit of sigma and error, and of the estimate unless geodetic; empty for a ratio.
    pub unit: &'a str,
    /// Estimates of the components.
    pub estimate: Vec<f64>,
    /// 1-sigma; zero for a fixed block. The components of a position are north, east, down.
    pub sigma: Vec<f64>,
    /// Estimate minus truth; empty where the truth is not known.
    pub error: Vec<f64>,
}

/// The use of a sample: the message `navfuse_msgs/Innovation`.
#[derive(Clone, Debug, PartialEq)]
pub struct InnovationEntry<'a> {
    /// The sample's time.
    pub time: Time,
    /// The sensor's name.
    pub sensor: &'a str,
    /// `accepted`, `gated`, or `rejected: ` and the reason.
    pub outcome: &'a str,
    /// Normalised innovation squared; NaN where none was computed.
    pub nis: f64,
    /// The gate's threshold on it; infinite where the gate is off.
    pub threshold: f64,
    /// The channels that were used.
    pub channels: Vec<&'a str>,
    /// Sample minus prediction, SI.
    pub innovation: Vec<f64>,
    /// 1-sigma of the innovation, SI.
    pub sigma: Vec<f64>,
}

/// A rejected sample of a driving sensor: the message `navfuse_msgs/Rejection`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RejectionEntry<'a> {
    /// The sample's time.
    pub time: Time,
    /// The sensor's name.
    pub sensor: &'a str,
    /// The reason.
    pub reason: &'a str,
}

/// Reads a log from its beginning to its end.
pub struct LogReader {
    records: Records,
    info: LogInfo,
    length: u64,
    schemas: BTreeMap<u16, String>,
    topics: BTreeMap<u16, Kind>,
    sensors: usize,
}

/// The kind of the messages of a topic.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Imu(SensorId),
    Sample(SensorId),
    Block,
    Filtered,
    Innovation,
    Rejection,
    Event,
    Finding,
    Derived,
}

impl LogReader {
    /// Opens a log that navfuse recorded.
    ///
    /// # Errors
    /// When the file cannot be read, is not an MCAP file, or was not recorded by navfuse.
    pub fn open(path: &Path) -> Result<Self, StreamError> {
        let records = Records::open(path, Chunks::Unpacked)?;
        let length = std::fs::metadata(path).map_or(0, |m| m.len());
        let info = read_info(path, true)?.ok_or_else(|| {
            StreamError::format("navfuse did not record it: it holds no scenario")
                .in_file(path)
                .with_remedy("a log of navfuse is called run.mcap")
        })?;
        let (schemas, topics) = Default::default();
        Ok(Self { records, info, length, schemas, topics, sensors: 0 })
    }

    /// The metadata of the run.
    pub fn info(&self) -> &LogInfo {
        &self.info
    }

    /// Number of bytes read, and length of the file.
    pub fn progress(&self) -> [u64; 2] {
        [self.records.position().min(self.length), self.length]
    }

    /// Passes the next entry to `take`; returns `false` at the end.
    ///
    /// # Errors
    /// When the log cannot be read, or an intact record contradicts itself. Damaged parts are
    /// skipped, and [`Self::warning`] reports them.
    pub fn next(&mut self, mut take: impl FnMut(Entry<'_>)) -> Result<bool, StreamError> {
        let (schemas, topics, sensors) = (&mut self.schemas, &mut self.topics, &mut self.sensors);
        let found = self.records.find(|opcode, data| {
            if ![op::SCHEMA, op::CHANNEL, op::MESSAGE, op::METADATA].contains(&opcode) {
                return Ok(None);
            }
            match parse(opcode, data)? {
                Record::Schema { header, .. } => {
                    schemas.insert(header.id, header.name);
                    Ok(None)
                }
                // the summary repeats the channels
                Record::Channel(c) if !topics.contains_key(&c.id) => {
                    let schema = schemas.get(&c.schema_id).map_or("", String::as_str);
                    let Some(kind) = kind(&c.topic, schema, SensorId(*sensors)) else {
                        return Ok(None);
                    };
                    topics.insert(c.id, kind);
                    if !matches!(kind, Kind::Imu(_) | Kind::Sample(_)) {
                        return Ok(None);
                    }
                    *sensors += 1;
                    take(Entry::Sensor(SensorEntry {
                        name: c.topic.strip_prefix(SENSOR).unwrap_or_default(),
                        kind: c.metadata.get(KIND).map(String::as_str),
                        purpose: c.metadata.get(PURPOSE).and_then(|word| purpose(word)),
                    }));
                    Ok(Some(()))
                }
                Record::Message { header, data } => {
                    let Some(kind) = topics.get(&header.channel_id) else { return Ok(None) };
                    let Some((&[0, 1, 0, 0], body)) = data.split_first_chunk::<4>() else {
                        return Err(StreamError::format(format!(
                            "message {}: its encoding is not the one of navfuse",
                            header.sequence
                        )));
                    };
                    let entry = entry(*kind, &mut CdrReader::new(body));
                    take(entry.map_err(|e| {
                        StreamError::format(format!("message {}: {e}", header.sequence))
                            .with_source(e)
                    })?);
                    Ok(Some(()))
                }
                Record::Metadata(m) if m.name == VERDICT => {
                    // a verdict of a later version, which this one cannot read, counts as none
                    let json = m.metadata.get(VERDICT_ENTRY);
                    let Some(verdict) = json.and_then(|j| serde_json::from_str(j).ok()) else {
                        return Ok(None);
                    };
                    take(Entry::Verdict(verdict));
                    Ok(Some(()))
                }
                _ => Ok(None),
            }
        })?;
        Ok(found.is_some())
    }

    /// A warning at the end, if parts of the log could not be read.
    pub fn warning(&self) -> Option<String> {
        self.records
            .is_damaged()
            .then(|| format!("the log: {}", self.records.damage("").join("; ")))
    }
}

const SENSOR: &str = "/sensor/";
const FILTERED: &str = "/filtered/";

fn kind(topic: &str, schema: &str, next: SensorId) -> Option<Kind> {
    if topic.starts_with(SENSOR) && schema == schema::IMU.name {
        Some(Kind::Imu(next))
    } else if topic.starts_with(SENSOR) && schema == schema::SAMPLE.name {
        Some(Kind::Sample(next))
    } else if schema == schema::BLOCK.name {
        Some(if topic.starts_with(FILTERED) { Kind::Filtered } else { Kind::Block })
    } else if schema == schema::INNOVATION.name {
        Some(Kind::Innovation)
    } else if schema == schema::REJECTION.name {
        Some(Kind::Rejection)
    } else if schema == schema::FINDING.name {
        Some(Kind::Finding)
    } else if schema == schema::DERIVED.name {
        Some(Kind::Derived)
    } else {
        (schema == schema::LOG.name).then_some(Kind::Event)
    }
}

type Reader<'a> = CdrReader<'a, LittleEndian>;

fn entry<'a>(kind: Kind, r: &mut Reader<'a>) -> re_cdr::Result<Entry<'a>> {
    Ok(match kind {
        Kind::Imu(sensor) => Entry::Sample(read_imu(r, sensor)?, IMU_COLUMNS.to_vec()),
        Kind::Sample(sensor) => {
            let mut names = [""; MAX_CHANNELS];
            let (sample, count) = read_sample(r, sensor, &mut names)?;
            Entry::Sample(sample, names[..count].to_vec())
        }
        Kind::Block => Entry::Block(block(r)?),
        Kind::Filtered => Entry::Filtered(block(r)?),
        Kind::Innovation => Entry::Innovation(innovation(r)?),
        Kind::Rejection => {
            let time = Stamp { sec: r.read_i32()?, nanosec: r.read_u32()? }.time();
            let (sensor, reason) = (r.read_str()?, r.read_str()?);
            Entry::Rejection(RejectionEntry { time, sensor, reason })
        }
        Kind::Event => Entry::Event(event(r)?),
        Kind::Finding => Entry::Finding(finding(r)?),
        Kind::Derived => Entry::Derived(derived(r)?),
    })
}

/// The columns of [`RATES`].
const IMU_COLUMNS: [&str; RATES.len()] = [
    "gyro_x_radps",
    "gyro_y_radps",
    "gyro_z_radps",
    "accel_x_mps2",
    "accel_y_mps2",
    "accel_z_mps2",
];

fn block<'a>(r: &mut Reader<'a>) -> re_cdr::Result<BlockEntry<'a>> {
    let time = read_time(r)?;
    let name = r.read_str()?;
    let mode = match r.read_str()? {
        "fixed" => Mode::Fixed,
        "consider" => Mode::Consider,
        _ => Mode::Estimate,
    };
    let components = texts(r)?;
    let units = texts(r)?;
    let estimate = numbers(r)?;
    let unit = r.read_str()?;
    let geodetic = units.first() == Some(&"deg") && unit == "m";
    let (sigma, error) = (numbers(r)?, numbers(r)?);
    let n = estimate.len();
    if components.len() != n || sigma.len() != n || ![0, n].contains(&error.len()) {
        return Err(re_cdr::Error::Custom(format!("the components of {name} differ in number")));
    }
    Ok(BlockEntry { time, name, mode, components, geodetic, unit, estimate, sigma, error })
}

fn innovation<'a>(r: &mut Reader<'a>) -> re_cdr::Result<InnovationEntry<'a>> {
    let time = Stamp { sec: r.read_i32()?, nanosec: r.read_u32()? }.time();
    let sensor = r.read_str()?;
    let outcome = r.read_str()?;
    let (nis, threshold) = (r.read_f64()?, r.read_f64()?);
    r.read_u32()?; // the number of channels
    let channels = texts(r)?;
    let (innovation, sigma) = (numbers(r)?, numbers(r)?);
    if innovation.len() != channels.len() || sigma.len() != channels.len() {
        return Err(re_cdr::Error::Custom(format!("the channels of {sensor} differ in number")));
    }
    Ok(InnovationEntry { time, sensor, outcome, nis, threshold, channels, innovation, sigma })
}

fn event(r: &mut Reader<'_>) -> re_cdr::Result<Event> {
    let time = Stamp { sec: r.read_i32()?, nanosec: r.read_u32()? }.time();
    let level = match r.read_u8()? {
        40 => Level::Error,
        30 => Level::Warning,
        _ => Level::Info,
    };
    Ok(Event { time, level, about: r.read_str()?.to_owned(), text: r.read_str()?.to_owned() })
}

fn finding(r: &mut Reader<'_>) -> re_cdr::Result<Finding> {
    let unknown = |word: &str| re_cdr::Error::Custom(format!("{word} is unknown"));
    let time = Stamp { sec: r.read_i32()?, nanosec: r.read_u32()? }.time();
    let about = r.read_str()?.to_owned();
    let severity = r.read_str()?;
    let severity = Severity::ALL.into_iter().find(|s| s.name() == severity);
    let severity = severity.ok_or_else(|| unknown("the severity"))?;
    let basis = r.read_str()?;
    let basis = Basis::ALL.into_iter().find(|b| b.name() == basis);
    let basis = basis.ok_or_else(|| unknown("the basis"))?;
    let (text, remedy) = (r.read_str()?.to_owned(), r.read_str()?.to_owned());
    Ok(Finding { time, about, severity, basis, text, remedy })
}

fn derived(r: &mut Reader<'_>) -> re_cdr::Result<Derived> {
    let time = Stamp { sec: r.read_i32()?, nanosec: r.read_u32()? }.time();
    let (name, unit): (Arc<str>, Arc<str>) = (r.read_str()?.into(), r.read_str()?.into());
    let names = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect();
    let (rows, columns): (Arc<[String]>, Arc<[String]>) = (names(texts(r)?), names(texts(r)?));
    let values = numbers(r)?;
    if values.len() != rows.len() * columns.len() {
        return Err(re_cdr::Error::Custom(format!("the values of {name} differ in number")));
    }
    Ok(Derived { time, name, unit, rows, columns, values })
}

fn texts<'a>(r: &mut Reader<'a>) -> re_cdr::Result<Vec<&'a str>> {
    let length = r.read_sequence_length()?;
    (0..length).map(|_| r.read_str()).collect()
}

fn numbers(r: &mut Reader<'_>) -> re_cdr::Result<Vec<f64>> {
    let length = r.read_sequence_length()?;
    (0..length).map(|_| r.read_f64()).collect()
}
