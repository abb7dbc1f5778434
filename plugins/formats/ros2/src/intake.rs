//! The way of messages to the sensors of a scenario: out of a bag, or as they arrive.

use crate::bag::{Message, Topic};
use crate::config::{Stamping, TopicConfig};
use crate::relative::Chains;
use crate::route::{Reading, Route, routes};
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::Sample;
use navfuse_frames::Zero;
use std::collections::{BTreeMap, VecDeque};

/// The topics of all sensors.
pub struct Intake {
    pub routes: Vec<Route>,
    /// For each topic that was added, the routes from it and how its messages are read.
    readings: Vec<Vec<(usize, Reading)>>,
    pub chains: Chains,
}

impl Intake {
    /// The topics that a scenario names.
    ///
    /// # Errors
    /// When a key contradicts another, or the sensors.
    pub fn new(
        sensors: &BTreeMap<String, TopicConfig>,
        stamp: Stamping,
        zero: Zero,
        context: &OpenContext<'_>,
    ) -> Result<Self, StreamError> {
        let mut all = Vec::new();
        for (name, config) in sensors {
            let sensor = context.sensor(name).map_err(|e| e.at_key(format!("sensors.{name}")))?;
            if let Some((sensor, info)) = sensor {
                all.extend(routes(stamp, config, sensor, info, zero)?);
            }
        }
        if all.is_empty() && context.disabled_sensors.is_empty() {
            let message = "no sensor receives a topic";
            return Err(StreamError::scenario(message)
                .at_key("sensors")
                .with_remedy("name them, such as sensors.imu = { topic = \"/imu/data\" }"));
        }
        Ok(Self { routes: all, readings: Vec::new(), chains: Chains::default() })
    }

    /// Number of topics that were added.
    pub fn added(&self) -> usize {
        self.readings.len()
    }

    /// Finds the routes of the next topic.
    ///
    /// # Errors
    /// When its type does not fit a sensor.
    pub fn add(&mut self, topic: &Topic) -> Result<(), StreamError> {
        let mut found = Vec::new();
        let own = self.routes.iter().enumerate().filter(|(_, route)| route.topic == topic.name);
        for (k, route) in own {
            let reading = route.reading(topic)?;
            if let Some(chain) = reading.chain() {
                self.chains.add(route.sensor, &topic.name, chain).map_err(|other| {
                    let text =
                        format!("the poses of {other} and {} have no motion in common", topic.name);
                    StreamError::scenario(text)
                        .at_key(format!("sensors.{}.more", route.name))
                        .with_remedy("give each topic a sensor of its own")
                })?;
            }
            found.push((k, reading));
        }
        self.readings.push(found);
        Ok(())
    }

    /// The routes of a topic with their readings.
    pub fn of(&mut self, topic: usize) -> impl Iterator<Item = (&mut Route, &Reading)> {
        let readings = self.readings.get(topic).map_or(&[][..], Vec::as_slice);
        let find = |k: usize| readings.iter().find(move |(route, _)| *route == k);
        self.routes
            .iter_mut()
            .enumerate()
            .filter_map(move |(k, route)| find(k).map(|(_, reading)| (route, reading)))
    }

    /// Describes what was wrong with the messages.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        self.routes.iter().filter_map(Route::describe)
    }
}

/// The samples in messages that arrive one after the other, as a network brings them.
pub struct Messages {
    intake: Intake,
    /// Bytes so far.
    bytes: u64,
}

impl Messages {
    /// The messages of the topics that a scenario names.
    ///
    /// # Errors
    /// When a key contradicts another, or the sensors.
    pub fn new(
        sensors: &BTreeMap<String, TopicConfig>,
        stamp: Stamping,
        zero: Zero,
        context: &OpenContext<'_>,
    ) -> Result<Self, StreamError> {
        Ok(Self { intake: Intake::new(sensors, stamp, zero, context)?, bytes: 0 })
    }

    /// The topics, in the order of their names.
    pub fn topics(&self) -> Vec<String> {
        let mut names: Vec<_> = self.intake.routes.iter().map(|r| r.topic.clone()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Takes the next topic and the type of its messages, one of the built-in ones, such as
    /// `sensor_msgs/msg/Imu`.
    ///
    /// # Errors
    /// When the type does not fit a sensor.
    pub fn add(&mut self, name: &str, kind: &str) -> Result<(), StreamError> {
        let (name, kind) = (name.to_owned(), kind.to_owned());
        self.intake.add(&Topic { name, kind, encoding: "cdr".to_owned(), definition: None })
    }

    /// Appends the samples in a message of a topic, which is counted in the order of [`Self::add`].
    /// The message is in CDR and was received at a time in nanoseconds since 1970.
    pub fn take(&mut self, topic: usize, received: i64, data: &[u8], out: &mut VecDeque<Sample>) {
        let message = Message { topic, received, offset: self.bytes, data };
        self.bytes += data.len() as u64;
        let first = out.len();
        for (route, reading) in self.intake.of(topic) {
            out.extend(route.sample_now(reading, &message));
        }
        let mut samples = out.split_off(first);
        samples.retain_mut(|sample| self.intake.chains.increment(sample));
        out.append(&mut samples);
    }

    /// Describes what was wrong with the messages so far.
    pub fn warning(&self) -> Option<String> {
        let parts: Vec<String> = self.intake.warnings().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
