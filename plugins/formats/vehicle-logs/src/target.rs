//! The sensors that receive messages, and the fields that fill their channels.

use crate::config::{SensorConfig, VehicleLog};
use crate::known;
use crate::record::Topic;
use crate::term::Term;
use navfuse_core::document::did_you_mean;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_core::units::{Unit, parse_unit};
use navfuse_frames::validity::Judge;

/// Largest number of fields that a message lists.
const LISTED: usize = 40;

/// A sensor with the description of its message.
#[derive(Clone, Debug)]
pub struct Target {
    pub name: String,
    pub sensor: SensorId,
    pub config: SensorConfig,
    info: SensorInfo,
}

/// A channel and the number that fills it.
#[derive(Clone, Copy, Debug)]
struct Filled {
    channel: usize,
    term: Term<usize>,
    factor: f64,
    offset: f64,
    absent: Option<f64>,
}

/// The channels that a topic fills.
#[derive(Clone, Debug)]
pub struct Filling {
    filled: Vec<Filled>,
    /// Fields with the least value that they must have.
    least: Option<(usize, f64)>,
    /// Fields with the value that they must have.
    only: Vec<(usize, f64)>,
    judge: Judge,
}

/// Finds the sensors that the parameters name.
///
/// # Errors
/// When there is no such sensor.
pub fn targets(config: &VehicleLog, context: &OpenContext<'_>) -> Result<Vec<Target>, StreamError> {
    let mut targets = Vec::new();
    for (name, config) in &config.sensors {
        let sensor = context.sensor(name).map_err(|e| e.at_key(format!("sensors.{name}")))?;
        targets.extend(sensor.map(|(sensor, info)| Target {
            name: name.clone(),
            sensor,
            config: config.clone(),
            info: info.clone(),
        }));
    }
    if config.sensors.is_empty() {
        let message = "it names no sensor";
        return Err(StreamError::scenario(message).at_key("sensors").with_remedy(
            "name the message of each sensor, such as sensors.imu = { message = \"sensor_combined\" }",
        ));
    }
    Ok(targets)
}

impl Target {
    /// The fields of a topic that fill the sensor's channels: those of the scenario, or those of a
    /// known message.
    ///
    /// # Errors
    /// When a field or a unit does not exist, or no channel can be filled.
    pub fn filling(&self, topic: &Topic) -> Result<Filling, StreamError> {
        let place = |name: &str| topic.fields.iter().position(|f| f == name);
        let channel = |name: &str| self.info.position(name);
        let missing = |name: &str, key: String| {
            let near = did_you_mean(name, topic.fields.iter().map(String::as_str))
                .map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
            let list: Vec<&str> = topic.fields.iter().take(LISTED).map(String::as_str).collect();
            let message =
                format!("{} has no field {name:?}{near} (fields: {})", topic.name, list.join(", "));
            StreamError::scenario(message).at_key(key)
        };
        let primary = topic.name == self.config.message;
        let judge = Judge::new(&self.info);
        let mut filling = Filling { filled: Vec::new(), least: None, only: Vec::new(), judge };
        if primary {
            for (name, value) in &self.config.only {
                let key = format!("sensors.{}.only", self.name);
                filling.only.push((place(name).ok_or_else(|| missing(name, key))?, *value));
            }
        }
        if primary && !self.config.channels.is_empty() {
            for (name, field) in &self.config.channels {
                let key = format!("sensors.{}.channels.{name}", self.name);
                let index = channel(name).ok_or_else(|| self.no_channel(name, &key))?;
                let at = place(&field.field).ok_or_else(|| missing(&field.field, key.clone()))?;
                let unit = self.unit(index, field.unit.as_deref(), &key)?;
                filling.filled.push(Filled {
                    channel: index,
                    term: Term::Field(at),
                    factor: unit * field.scale,
                    offset: field.offset,
                    absent: None,
                });
            }
            return Ok(filling);
        }
        for known in known::of(&topic.name) {
            let entries = known.entries.iter().filter_map(|entry| {
                let channel = channel(entry.channel)?;
                let term = entry.term.map(place)?;
                let (factor, offset, absent) = (entry.factor, entry.offset, entry.absent);
                Some(Filled { channel, term, factor, offset, absent })
            });
            filling.filled = entries.collect();
            if !filling.filled.is_empty() {
                filling.least = known.valid.and_then(|(name, least)| Some((place(name)?, least)));
                return Ok(filling);
            }
        }
        let has: Vec<&str> = self.info.channels.iter().map(|c| &*c.name).collect();
        let message = format!(
            "{} is not known to fill the channels {} of [sensor.{}]",
            topic.name,
            has.join(", "),
            self.name
        );
        let fields: Vec<&str> = topic.fields.iter().take(LISTED).map(String::as_str).collect();
        let remedy = format!(
            "name the field of each channel, such as channels.{} = {{ field = {:?} }} (fields: {})",
            has.first().unwrap_or(&"NAME"),
            topic.fields.first().map_or("NAME", String::as_str),
            fields.join(", ")
        );
        let key = format!("sensors.{}.{}", self.name, if primary { "message" } else { "with" });
        Err(StreamError::scenario(message).at_key(key).with_remedy(remedy))
    }

    fn no_channel(&self, name: &str, key: &str) -> StreamError {
        let has: Vec<&str> = self.info.channels.iter().map(|c| &*c.name).collect();
        let near = did_you_mean(name, has.iter().copied())
            .map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        let message =
            format!("[sensor.{}] has no channel {name:?}{near} ({})", self.name, has.join(", "));
        StreamError::scenario(message).at_key(key)
    }

    /// The factor of a unit, which must have the dimension of the channel.
    fn unit(&self, channel: usize, unit: Option<&str>, key: &str) -> Result<f64, StreamError> {
        let Some(text) = unit else { return Ok(1.0) };
        let unit = parse_unit(text)
            .map_err(|e| StreamError::scenario(e.to_string()).at_key(format!("{key}.unit")))?;
        let channel = &self.info.channels[channel];
        if channel.unit.exponents() == unit.exponents() {
            return Ok(unit.to_si(1.0));
        }
        let (name, si) = (&channel.name, channel.unit.suffix());
        let message = format!("{text:?} is no unit of the channel {name}, {si}");
        Err(StreamError::scenario(message).at_key(format!("{key}.unit")))
    }

    /// Returns `true` where a channel is an angle, which is interpolated along the shorter way.
    pub fn is_angle(&self, channel: usize) -> bool {
        self.info.channels.get(channel).is_some_and(|c| c.unit == Unit::RADIAN)
    }
}

impl Filling {
    /// The sample of a message, without a sensor and a time; `None` if the message gives none.
    pub fn sample(&self, values: &[f64]) -> Option<Sample> {
        let at = |k: usize| values.get(k).copied().unwrap_or(f64::NAN);
        let least = self.least.is_none_or(|(k, least)| at(k) >= least);
        if !least || !self.only.iter().all(|(k, value)| at(*k) == *value) {
            return None;
        }
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        for filled in &self.filled {
            let raw = filled.term.value(values);
            let absent = filled.absent.is_some_and(|absent| match filled.term {
                Term::Component(_, a, b, _) => at(a) == absent || at(b) == absent,
                _ => raw == absent,
            });
            let value = raw * filled.factor + filled.offset;
            if !absent && value.is_finite() && sample.get(filled.channel).is_none() {
                sample.set(filled.channel, value);
            }
        }
        let refused = self.judge.refuses(&mut sample).is_some();
        (sample.present() != 0 && !refused).then_some(sample)
    }
}
