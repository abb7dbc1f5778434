//! The source: the samples of a log, in the order in which they were recorded.

use crate::log::{LogInfo, parse, read_info, summary};
use crate::message::{MISSING, Stamp};
use crate::records::Records;
use crate::schema;
use crate::topics::RATES;
use mcap::records::{Record, op};
use navfuse_core::files::{numbered, part_of};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::units::sample::{Channel, MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::mcap::Chunks;
use re_cdr::{BigEndian, ByteOrder, CdrReader, LittleEndian};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Reads the samples of a log that navfuse recorded, exactly and in their order, or inertial
/// measurements from a log of ROS 2.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct McapLog {
    /// The log, relative to the folder of the scenario.
    pub path: PathBuf,
    /// Topics of type `sensor_msgs/msg/Imu`, by the sensor they belong to: `{ imu = "/imu/data" }`.
    /// Their axes count as forward, right, down; their times come from the header. Default: each
    /// sensor from `/sensor/NAME`.
    #[serde(default)]
    pub topics: BTreeMap<String, String>,
}

impl SourceType for McapLog {
    const TYPE: &'static str = "mcap";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let sensors = context.composition.sensors.iter().map(|s| s.info.clone()).collect();
        Ok(vec![Box::new(McapSource::open(&context.base.join(&self.path), sensors, self.topics)?)])
    }
}

/// The samples of a log.
pub struct McapSource {
    records: Records,
    router: Router,
    end: Option<Time>,
    last: Option<Time>,
    parts: Parts,
    /// Warnings about the files of the log before this one.
    earlier: Vec<String>,
}

impl McapSource {
    /// Opens a log for the sensors of a composition, in the order of their ids.
    ///
    /// # Errors
    /// When the file is missing or is not an MCAP file. If the log has a summary, also when it
    /// holds none of the sensors, or a sensor with other channels.
    pub fn open(
        path: &Path,
        sensors: Vec<SensorInfo>,
        topics: BTreeMap<String, String>,
    ) -> Result<Self, StreamError> {
        let info = read_info(path, true)?;
        let records = Records::open(path, Chunks::Unpacked)?;
        let mut source = Self {
            records,
            router: Router::new(sensors, topics),
            end: None,
            last: None,
            parts: Parts::from(path, info.as_ref()),
            earlier: Vec::new(),
        };
        source.router.check_topics().map_err(|e| e.in_file(path))?;
        if let Some(summary) = summary(path) {
            for (c, schema) in summary.channels.values() {
                let added = source.router.channel(c.id, &c.topic, schema, &c.message_encoding);
                added.map_err(|e| e.in_file(path))?;
            }
            source.router.check_matched().map_err(|e| e.in_file(path))?;
            let offset = info.as_ref().map_or(0, |i: &LogInfo| i.log_time_offset);
            source.end = (summary.end)
                .and_then(|end| i64::try_from(end).ok())
                .map(|end| Time::from_nanos(end.saturating_sub(offset)));
        }
        Ok(source)
    }
}

impl Source for McapSource {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            let found = self.records.find(|opcode, data| self.router.record(opcode, data))?;
            if let Some(found) = found {
                self.last = Some(found.time);
                self.parts.first.get_or_insert(found.time.nanos());
                *sample = found;
                return Ok(true);
            }
            let Some(next) = self.parts.next() else { break };
            self.earlier.extend(self.damage());
            self.records = Records::open(&next, Chunks::Unpacked)?;
            self.router.restart();
        }
        if let (None, Some(damage)) = (self.last, self.records.skipped()) {
            let none = format!("it has no intact sample: {damage}");
            return Err(StreamError::format(none).in_file(self.records.path()));
        }
        // a log that was cut off before its first topic is not an error
        if !self.records.is_damaged() || !self.router.others.is_empty() {
            self.router.check_matched().map_err(|e| e.in_file(self.records.path()))?;
        }
        Ok(false)
    }

    fn end(&self) -> Option<Time> {
        self.end
    }

    fn warning(&mut self) -> Option<String> {
        let mut warnings = std::mem::take(&mut self.earlier);
        warnings.extend(self.damage());
        (!warnings.is_empty()).then(|| warnings.join("; "))
    }
}

impl McapSource {
    /// What was wrong with this file.
    fn damage(&self) -> Option<String> {
        let before = " before the first sample".to_owned();
        let after = self.last.map_or(before, |t| format!(" after t = {t}"));
        let mut warnings = self.records.damage(&after);
        let unknown = &self.router.others;
        if !unknown.is_empty() && self.router.matched {
            warnings.push(format!(
                "samples of {} were skipped: the scenario has no such sensor",
                unknown.join(", ")
            ));
        }
        (!warnings.is_empty())
            .then(|| format!("{}: {}", self.records.path().display(), warnings.join("; ")))
    }
}

/// The files of a log that follow each other.
struct Parts {
    /// The path of the first one.
    base: PathBuf,
    /// Number of the file that is read.
    number: u32,
    /// Time of the run's first sample, ns.
    first: Option<i64>,
}

impl Parts {
    fn from(path: &Path, info: Option<&LogInfo>) -> Self {
        let Some((first, number)) = info.and_then(|info| info.part) else {
            return Self { base: path.to_owned(), number: 1, first: None };
        };
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let base = path.with_file_name(name.replacen(&format!("-{number:04}"), "", 1));
        Self { base, number, first: Some(first) }
    }

    /// The path of the next file of the same run, if it is there.
    fn next(&mut self) -> Option<PathBuf> {
        let path = numbered(&self.base, self.number + 1);
        let path = [part_of(&path), path].into_iter().rev().find(|path| path.is_file())?;
        let info = read_info(&path, true).ok()??;
        let follows = info.part == Some((self.first?, self.number + 1));
        self.number += u32::from(follows);
        follows.then_some(path)
    }
}

/// The destination of the messages of a channel.
#[derive(Clone, Copy, Debug)]
enum Route {
    /// Nowhere.
    Skip,
    /// A `navfuse_msgs/Sample` of the sensor.
    Sample(SensorId),
    /// A `sensor_msgs/Imu` of the sensor.
    Imu(SensorId),
}

/// Finds the sensor of each message.
struct Router {
    /// Name and columns of each sensor.
    sensors: Vec<(String, Vec<String>)>,
    /// Topics of other programs by sensor.
    topics: BTreeMap<String, String>,
    schemas: BTreeMap<u16, String>,
    routes: BTreeMap<u16, Route>,
    /// Recorded sensors that are not in the scenario.
    others: Vec<String>,
    /// Set once a channel belongs to a sensor.
    matched: bool,
}

impl Router {
    fn new(sensors: Vec<SensorInfo>, topics: BTreeMap<String, String>) -> Self {
        let columns = |s: &SensorInfo| s.channels.iter().map(Channel::column).collect();
        Self {
            sensors: sensors.into_iter().map(|s| (s.name.clone(), columns(&s))).collect(),
            topics,
            schemas: BTreeMap::new(),
            routes: BTreeMap::new(),
            others: Vec::new(),
            matched: false,
        }
    }

    /// Forgets the channels of a file.
    fn restart(&mut self) {
        self.schemas.clear();
        self.routes.clear();
        self.others.clear();
    }

    fn names(&self) -> String {
        self.sensors.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn check_topics(&self) -> Result<(), StreamError> {
        match self.topics.keys().find(|name| self.sensors.iter().all(|(n, _)| n != *name)) {
            Some(name) => Err(StreamError::scenario(format!(
                "topics names {name:?}, which is no sensor of the scenario ({})",
                self.names()
            ))),
            None => Ok(()),
        }
    }

    fn check_matched(&self) -> Result<(), StreamError> {
        if self.matched {
            return Ok(());
        }
        let recorded =
            if self.others.is_empty() { "none".to_owned() } else { self.others.join(", ") };
        let names = self.names();
        Err(StreamError::scenario(format!(
            "it holds none of the scenario's sensors ({names}); recorded sensors: {recorded}"
        ))
        .with_remedy(
            "or give a topic of type sensor_msgs/msg/Imu with topics = { imu = \"/TOPIC\" }",
        ))
    }

    /// Finds the route of a channel.
    fn channel(
        &mut self,
        id: u16,
        topic: &str,
        schema: &str,
        encoding: &str,
    ) -> Result<(), StreamError> {
        if self.routes.contains_key(&id) {
            return Ok(());
        }
        let foreign = self.topics.iter().find(|(_, t)| *t == topic).map(|(name, _)| name.clone());
        let readable =
            [schema::IMU.name, schema::SAMPLE.name].contains(&schema) && encoding == "cdr";
        let name = match foreign {
            Some(_) if !readable => {
                return Err(StreamError::format(format!(
                    "the topic {topic} is of type {schema:?} in {encoding:?}; {} in cdr is needed",
                    schema::IMU.name
                )));
            }
            Some(name) => Some(name),
            None => (topic
                .strip_prefix("/sensor/")
                .filter(|n| readable && !self.topics.contains_key(*n)))
            .map(str::to_owned),
        };
        let sensor =
            name.as_ref().and_then(|name| self.sensors.iter().position(|(n, _)| n == name));
        let route = match (name, sensor) {
            (Some(_), Some(k)) => {
                self.matched = true;
                if schema == schema::IMU.name {
                    let rates = Channel::all(RATES).map(|c| c.column());
                    self.check_columns(k, rates.iter().map(String::as_str))?;
                    Route::Imu(SensorId(k))
                } else {
                    Route::Sample(SensorId(k))
                }
            }
            (Some(name), None) => {
                self.others.push(name);
                Route::Skip
            }
            (None, _) => Route::Skip,
        };
        self.routes.insert(id, route);
        Ok(())
    }

    /// Checks that a sensor was recorded with the channels that it has in the scenario.
    fn check_columns<'a>(
        &self,
        sensor: usize,
        recorded: impl Iterator<Item = &'a str> + Clone,
    ) -> Result<(), StreamError> {
        let (name, columns) = &self.sensors[sensor];
        if recorded.clone().eq(columns.iter().map(String::as_str)) {
            return Ok(());
        }
        let (recorded, wanted) = (recorded.collect::<Vec<_>>().join(" "), columns.join(" "));
        Err(StreamError::scenario(format!(
            "{name} is recorded with the channels {recorded}; \
             [sensor.{name}] of the scenario has {wanted}"
        )))
    }

    /// Registers a record; returns the sample if the record is one.
    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<Option<Sample>, StreamError> {
        if ![op::SCHEMA, op::CHANNEL, op::MESSAGE].contains(&opcode) {
            return Ok(None);
        }
        match parse(opcode, data)? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(c) => {
                let schema = self.schemas.get(&c.schema_id).cloned().unwrap_or_default();
                self.channel(c.id, &c.topic, &schema, &c.message_encoding)?;
            }
            Record::Message { header, data } => {
                let route = self.routes.get(&header.channel_id).copied().unwrap_or(Route::Skip);
                return self.message(route, &data).map_err(|e| {
                    let time = Time::from_nanos(i64::try_from(header.log_time).unwrap_or(i64::MAX));
                    StreamError::of(
                        e.kind(),
                        format!("message {} at log time {time}: {e}", header.sequence),
                    )
                    .with_source(e)
                });
            }
            _ => {}
        }
        Ok(None)
    }

    fn message(&self, route: Route, data: &[u8]) -> Result<Option<Sample>, StreamError> {
        let sensor = match route {
            Route::Skip => return Ok(None),
            Route::Sample(sensor) | Route::Imu(sensor) => sensor,
        };
        let Some((&[_, encoding, _, _], body)) = data.split_first_chunk::<4>() else {
            return Err(StreamError::format("shorter than its header"));
        };
        let imu = matches!(route, Route::Imu(_));
        match encoding {
            0 => self.decode(sensor, imu, CdrReader::<BigEndian>::new(body)),
            1 => self.decode(sensor, imu, CdrReader::<LittleEndian>::new(body)),
            other => Err(StreamError::format(format!(
                "encapsulation {other}; plain CDR (0 or 1) is needed"
            ))),
        }
        .map(Some)
    }

    fn decode<O: ByteOrder>(
        &self,
        sensor: SensorId,
        imu: bool,
        mut r: CdrReader<'_, O>,
    ) -> Result<Sample, StreamError> {
        if imu {
            return read_imu(&mut r, sensor).map_err(malformed);
        }
        let mut names = [""; MAX_CHANNELS];
        let (sample, n) = read_sample(&mut r, sensor, &mut names).map_err(malformed)?;
        self.check_columns(sensor.0, names[..n].iter().copied())?;
        Ok(sample)
    }
}

/// The error of a message that does not follow CDR.
fn malformed(cause: re_cdr::Error) -> StreamError {
    StreamError::format(cause.to_string()).with_source(cause)
}

pub(crate) fn read_time<O: ByteOrder>(r: &mut CdrReader<'_, O>) -> re_cdr::Result<Time> {
    let stamp = Stamp { sec: r.read_i32()?, nanosec: r.read_u32()? };
    r.read_str()?; // the frame
    Ok(stamp.time())
}

pub(crate) fn read_imu<O: ByteOrder>(
    r: &mut CdrReader<'_, O>,
    sensor: SensorId,
) -> re_cdr::Result<Sample> {
    let mut sample = Sample::empty(read_time(r)?, sensor);
    let skip = |r: &mut CdrReader<'_, O>, n: usize| (0..n).try_for_each(|_| r.read_f64().map(drop));
    skip(r, 4 + 9)?; // orientation and its covariance
    for first in [0, 3] {
        for i in first..first + 3 {
            let value = r.read_f64()?;
            if value.to_bits() != MISSING {
                sample.set(i, value);
            }
        }
        skip(r, 9)?; // covariance
    }
    Ok(sample)
}

/// Reads a sample and the number of its channels; writes the names of its channels to `names`.
pub(crate) fn read_sample<'a, O: ByteOrder>(
    r: &mut CdrReader<'a, O>,
    sensor: SensorId,
    names: &mut [&'a str; MAX_CHANNELS],
) -> re_cdr::Result<(Sample, usize)> {
    let mut sample = Sample::empty(read_time(r)?, sensor);
    let n = channels(r)?;
    for name in &mut names[..n] {
        *name = r.read_str()?;
    }
    if channels(r)? != n {
        return Err(re_cdr::Error::Custom("channels and values differ in number".into()));
    }
    for i in 0..n {
        sample.set(i, r.read_f64()?);
    }
    let present = r.read_u16()?;
    (0..n).filter(|i| present >> i & 1 == 0).for_each(|i| sample.clear(i));
    Ok((sample, n))
}

fn channels<O: ByteOrder>(r: &mut CdrReader<'_, O>) -> re_cdr::Result<usize> {
    match r.read_sequence_length()? {
        n if n <= MAX_CHANNELS => Ok(n),
        n => {
            Err(re_cdr::Error::Custom(format!("{n} channels; at most {MAX_CHANNELS} fit a sample")))
        }
    }
}
