//! The way from a topic to a sensor: what is read of its messages, and their clock.

use crate::bag::{Message, Topic};
use crate::config::{MessageField, Stamping, TopicConfig};
use crate::definition::{Definitions, Kind};
use crate::form::{Converter, Form, Unused};
use crate::program::{Program, SLOTS, Slots};
use crate::relative::Chain;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::parse_unit;
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::{Clock, Count, Stamp, Zero};
use std::fmt::Write;

/// Nanoseconds of a second.
const SECOND: i64 = 1_000_000_000;
/// Slots before those of the fields: the stamp.
const OWN: usize = 2;
/// Difference between stamp and time of receiving, in seconds, that is reported.
const FAR: f64 = 1.0;

/// A topic and its sensor, as the scenario names them.
#[derive(Debug)]
pub struct Route {
    pub sensor: SensorId,
    pub name: String,
    pub topic: String,
    stamping: Stamping,
    config: TopicConfig,
    channels: Vec<Channel>,
    /// Fields of this topic by channel; empty where the type decides.
    fields: Vec<(usize, MessageField)>,
    pub clock: Clock<(i64, Sample)>,
    delay: Delay,
    pub messages: u64,
    pub samples: u64,
    malformed: Count,
    first_malformed: Option<String>,
    unused: [Count; 4],
}

/// The time of a message.
#[derive(Clone, Copy, Debug)]
enum Clocked {
    /// It was received.
    Received,
    /// Seconds and nanoseconds since 1970.
    Stamped,
    /// One field with a unit, in nanoseconds.
    Counted(f64),
}

/// What is read of the messages of one type.
#[derive(Clone, Debug)]
pub struct Reading {
    program: Program,
    stamp: Clocked,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    /// The values of a known type, each with the channel of the sensor.
    Form(Converter, Vec<Option<usize>>),
    /// Fields: channel, factor and offset.
    Fields(Vec<(usize, f64, f64)>),
}

impl Reading {
    /// The chain of the poses that are read, if the sensor measures relative poses.
    pub fn chain(&self) -> Option<Chain> {
        match &self.content {
            Content::Form(converter, channels) => converter.chain(channels),
            Content::Fields(_) => None,
        }
    }
}

/// The time from the stamp of a message until it was received, s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Delay {
    count: f64,
    sum: f64,
    least: f64,
    most: f64,
}

impl Delay {
    pub fn add(&mut self, nanos: i64) {
        let delay = nanos as f64 * 1e-9;
        if self.count == 0.0 {
            (self.least, self.most) = (delay, delay);
        }
        self.count += 1.0;
        self.sum += delay;
        self.least = self.least.min(delay);
        self.most = self.most.max(delay);
    }

    /// The mean delay, s, if there was a message with a stamp.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }

    /// Describes the delay, if there was a message with a stamp.
    pub fn describe(&self) -> Option<String> {
        (self.count > 0.0).then(|| {
            format!(
                "received {:.4} s after the stamp on average, {:.4} s to {:.4} s",
                self.sum / self.count,
                self.least,
                self.most
            )
        })
    }
}

/// The path of the stamp of a type, if it has one.
pub fn stamp_path(definitions: &Definitions, kind: &str) -> Option<&'static str> {
    let fields = definitions.fields(kind).ok()?;
    fields.iter().find_map(|f| match (&f.kind, f.name.as_str()) {
        (Kind::Message(m), "header") if m == "std_msgs/Header" => Some("header.stamp"),
        (Kind::Message(m), "stamp") if m == "builtin_interfaces/Time" => Some("stamp"),
        _ => None,
    })
}

/// The routes of one sensor.
///
/// # Errors
/// When its keys contradict each other or the sensor.
pub fn routes(
    stamp: Stamping,
    config: &TopicConfig,
    sensor: SensorId,
    info: &SensorInfo,
    zero: Zero,
) -> Result<Vec<Route>, StreamError> {
    let key = format!("sensors.{}", info.name);
    let fail =
        |text: String, part: &str| StreamError::scenario(text).at_key(format!("{key}{part}"));
    let mut topics: Vec<(String, Vec<(usize, MessageField)>)> = Vec::new();
    for (name, field) in &config.channels {
        let Some(channel) = info.position(name) else {
            let has: Vec<&str> = info.channels.iter().map(|c| &*c.name).collect();
            let text = format!("[sensor.{}] has the channels {}", info.name, has.join(", "));
            return Err(fail(text, &format!(".channels.{name}")));
        };
        let Some(topic) = field.topic.as_ref().or(config.topic.as_ref()) else {
            return Err(fail("the field needs a topic".to_owned(), &format!(".channels.{name}")));
        };
        let entry = (channel, field.clone());
        match topics.iter_mut().find(|(t, _)| t == topic) {
            Some((_, fields)) => fields.push(entry),
            None => topics.push((topic.clone(), vec![entry])),
        }
    }
    for topic in config.topic.iter().chain(&config.more) {
        if topics.iter().all(|(t, _)| t != topic)
            && (config.channels.is_empty() || config.more.contains(topic))
        {
            topics.push((topic.clone(), Vec::new()));
        }
    }
    if topics.is_empty() {
        return Err(fail("it needs a topic, such as topic = \"/imu/data\"".to_owned(), ""));
    }
    let route = |(topic, fields): (String, Vec<(usize, MessageField)>)| Route {
        sensor,
        name: info.name.clone(),
        topic,
        stamping: config.stamp.unwrap_or(stamp),
        config: config.clone(),
        channels: info.channels.clone(),
        fields,
        clock: Clock::new(zero),
        delay: Delay::default(),
        messages: 0,
        samples: 0,
        malformed: Count::default(),
        first_malformed: None,
        unused: [Count::default(); 4],
    };
    Ok(topics.into_iter().map(route).collect())
}

impl Route {
    /// Compiles what is read of the messages of a topic.
    ///
    /// # Errors
    /// When its type does not fit the sensor.
    pub fn reading(&self, topic: &Topic) -> Result<Reading, StreamError> {
        let key = format!("sensors.{}", self.name);
        let kind = topic.short_kind();
        let fail = |text: String| StreamError::scenario(text).at_key(key.clone());
        if !["", "cdr", "ros1"].contains(&topic.encoding.as_str()) {
            let text = format!("{} is encoded as {:?}; cdr is needed", topic.name, topic.encoding);
            return Err(fail(text));
        }
        let definitions = topic.definitions().map_err(|e| fail(format!("{}: {e}", topic.name)))?;
        let path = match self.stamping {
            Stamping::Header => stamp_path(&definitions, &kind),
            Stamping::Receive => None,
        };
        let (paths, stamp) = match (&self.config.time, path) {
            (Some(time), _) => {
                let second = parse_unit("s").ok().map(|unit| unit.exponents());
                let unit = parse_unit(&time.unit).ok();
                let Some(unit) = unit.filter(|unit| Some(unit.exponents()) == second) else {
                    return Err(fail(format!("time.unit: {:?} is no unit of time", time.unit)));
                };
                ([time.field.clone(), String::new()], Clocked::Counted(unit.to_si(1e9)))
            }
            (None, Some(path)) => {
                (["sec", "nanosec"].map(|part| format!("{path}.{part}")), Clocked::Stamped)
            }
            (None, None) => ([String::new(), String::new()], Clocked::Received),
        };
        let first: Vec<&str> = paths.iter().map(String::as_str).collect();
        if !self.fields.is_empty() {
            let mut paths = first;
            paths.extend(self.fields.iter().map(|(_, f)| f.field.as_str()));
            let program = Program::new(&definitions, &kind, &paths)
                .map_err(|e| fail(format!("{}: {e}", topic.name)))?;
            let fields = self.fields.iter().map(|(channel, f)| self.factor(*channel, f));
            let content = Content::Fields(fields.collect::<Result<_, _>>()?);
            return Ok(Reading { program, stamp, content });
        }
        let Some(form) = Form::of(&kind) else {
            return Err(fail(format!(
                "{} is of type {}, which has no known use",
                topic.name, topic.kind
            ))
            .with_remedy(
                "name its fields with `channels`, such as channels.speed = { field = \
                     \"twist.linear.x\" }",
            ));
        };
        let channels: Vec<Option<usize>> = (form.channels().iter())
            .map(|name| self.channels.iter().position(|c| &*c.name == *name))
            .collect();
        if channels.iter().all(Option::is_none) {
            let has: Vec<&str> = self.channels.iter().map(|c| &*c.name).collect();
            return Err(fail(format!(
                "{} of type {} has {}; [sensor.{}] needs {}",
                topic.name,
                topic.kind,
                form.channels().join(", "),
                self.name,
                has.join(", ")
            )));
        }
        let program = form
            .program(&definitions, &kind, &first)
            .map_err(|e| fail(format!("{}: {e}", topic.name)))?;
        let content = Content::Form(Converter::new(form, &self.config), channels);
        Ok(Reading { program, stamp, content })
    }

    /// Factor and offset that turn a field into SI.
    fn factor(
        &self,
        channel: usize,
        field: &MessageField,
    ) -> Result<(usize, f64, f64), StreamError> {
        let own = &self.channels[channel];
        let fail = |text: String| {
            let key = format!("sensors.{}.channels.{}.unit", self.name, own.name);
            StreamError::scenario(text).at_key(key)
        };
        let mut scale = field.scale.unwrap_or(1.0);
        if let Some(text) = &field.unit {
            let unit = parse_unit(text).map_err(|e| fail(e.to_string()))?;
            if own.unit.exponents() != unit.exponents() {
                return Err(fail(format!("{text:?} is no unit of the channel, {}", own.column())));
            }
            scale *= unit.factor();
        }
        Ok((channel, scale, field.offset.unwrap_or(0.0)))
    }

    /// Takes a message, whose sample leaves by the clock.
    pub fn take(&mut self, reading: &Reading, message: &Message<'_>) {
        if let Some((stamp, sample)) = self.read(reading, message) {
            self.clock.push(stamp, message.offset, (message.received, sample));
        }
    }

    /// The sample of a message by its own stamp, whatever came before.
    pub fn sample_now(&mut self, reading: &Reading, message: &Message<'_>) -> Option<Sample> {
        let (stamp, mut sample) = self.read(reading, message)?;
        sample.time = Time::from_nanos(self.clock.at_once(stamp, message.offset)?);
        self.samples += 1;
        Some(sample)
    }

    /// The stamp and the sample of a message.
    fn read(&mut self, reading: &Reading, message: &Message<'_>) -> Option<(Stamp, Sample)> {
        self.messages += 1;
        let mut slots: Slots = [f64::NAN; SLOTS];
        if let Err(error) = reading.program.read(message.data, &mut slots) {
            self.malformed.add(message.offset);
            self.first_malformed.get_or_insert_with(|| error.to_string());
            return None;
        }
        let received = message.received;
        let stamp = match reading.stamp {
            Clocked::Received => Stamp::Date(received),
            Clocked::Counted(unit) => Stamp::Date((slots[0] * unit) as i64),
            // a stamp of zero was never set
            Clocked::Stamped if slots[0] == 0.0 && slots[1] == 0.0 => Stamp::Missing,
            Clocked::Stamped => {
                let stamp = slots[0] as i64 * SECOND + slots[1] as i64;
                self.delay.add(received.saturating_sub(stamp));
                Stamp::Date(stamp)
            }
        };
        let mut sample = Sample::empty(Time::MIN, self.sensor);
        if let Err(why) = reading.content.fill(&slots[OWN..], &mut sample) {
            self.unused[why as usize].add(message.offset);
            return None;
        }
        Some((stamp, sample))
    }

    /// Describes what was wrong with the messages.
    pub fn describe(&self) -> Option<String> {
        let mut parts = Vec::new();
        if let Some(mut text) = self.malformed.describe("message", "left out, malformed,") {
            let _ = write!(text, " ({})", self.first_malformed.as_deref().unwrap_or_default());
            parts.push(text);
        }
        parts.extend(self.clock.describe("message"));
        let words = [
            (Unused::NoFix, "without a fix"),
            (Unused::Invalid, "whose velocity is invalid"),
            (Unused::OtherTrack, "over the bottom or through the water, as `track` excludes,"),
            (Unused::Empty, "without a number for the sensor"),
        ];
        for (why, words) in words {
            parts.extend(self.unused[why as usize].describe("message", words));
        }
        if self.delay.least.abs().max(self.delay.most.abs()) > FAR {
            parts.extend(self.delay.describe());
        }
        (!parts.is_empty()).then(|| format!("{}: {}", self.topic, parts.join("; ")))
    }
}

impl Content {
    /// Fills the channels of a sample.
    fn fill(&self, slots: &[f64], sample: &mut Sample) -> Result<(), Unused> {
        let mut set = |channel: usize, value: f64| {
            if value.is_finite() {
                sample.set(channel, value);
            }
        };
        match self {
            Self::Form(converter, channels) => {
                let values = converter.values(slots)?;
                for (channel, value) in channels.iter().zip(values) {
                    if let Some(channel) = channel {
                        set(*channel, value);
                    }
                }
            }
            Self::Fields(fields) => {
                for ((channel, scale, offset), value) in fields.iter().zip(slots) {
                    set(*channel, value * scale + offset);
                }
            }
        }
        if sample.present() == 0 { Err(Unused::Empty) } else { Ok(()) }
    }
}
