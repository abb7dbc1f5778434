//! Samples in memory: the rows of a table or an array, and a source that gives them to a run.

use crate::error::exception;
use navfuse_core::compose::Composition;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, Registry, SourceType};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_core::units::{Unit, column_suffix};
use pyo3::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

/// Samples that Python gives: `Scenario.with_samples`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Memory {}

impl SourceType for Memory {
    const TYPE: &'static str = "memory";

    /// The run adds the samples: [`Rows::source`].
    fn open(self, _: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        Ok(Vec::new())
    }
}

/// Registers the type of source `memory`.
pub fn register(registry: &mut Registry) {
    registry.source::<Memory>();
}

/// The setting that makes the samples in memory those of a scenario.
pub const SOURCE: &str = "source={memory={}}";

/// Numbers in the bytes of a buffer of numpy.
fn numbers<'a, const N: usize, T: 'a>(
    bytes: &'a [u8],
    of: fn([u8; N]) -> T,
) -> impl Iterator<Item = T> + 'a {
    bytes.as_chunks::<N>().0.iter().map(move |bytes| of(*bytes))
}

/// Times in nanoseconds as whole numbers, or in seconds.
///
/// # Errors
/// When a time is not finite or beyond 73 years.
pub fn times(bytes: &[u8], nanos: bool) -> PyResult<Vec<Time>> {
    if nanos {
        return Ok(numbers(bytes, i64::from_ne_bytes).map(Time::from_nanos).collect());
    }
    let time = |seconds: f64| {
        Time::from_seconds(seconds).ok_or_else(|| {
            let message = format!("the time {seconds} s is not finite or beyond 73 years");
            let remedy = "give seconds, or whole numbers of nanoseconds";
            exception(StreamError::format(message).with_remedy(remedy))
        })
    };
    numbers(bytes, f64::from_ne_bytes).map(time).collect()
}

/// Numbers of a buffer.
pub fn values(bytes: &[u8]) -> impl Iterator<Item = f64> + '_ {
    numbers(bytes, f64::from_ne_bytes)
}

/// A sample of the numbers in the order of the channels; NaN is a missing channel.
pub fn sample(time: Time, sensor: SensorId, values: impl Iterator<Item = f64>) -> Sample {
    let mut sample = Sample::empty(time, sensor);
    for (channel, value) in values.enumerate().filter(|(_, value)| !value.is_nan()) {
        sample.set(channel, value);
    }
    sample
}

/// The samples of a sensor.
#[derive(Debug)]
pub struct Rows {
    sensor: String,
    times: Vec<Time>,
    /// A column for each channel of the sensor, in SI; empty without a column.
    columns: Vec<Vec<f64>>,
}

impl Rows {
    /// The samples of a sensor in the columns of a table, one after the other in `bytes`.
    ///
    /// # Errors
    /// When no column belongs to a channel, or a sensor that drives a process lacks one.
    pub fn new(
        info: &SensorInfo,
        times: Vec<Time>,
        headings: &[String],
        bytes: &[u8],
    ) -> PyResult<Self> {
        let length = size_of::<f64>() * times.len();
        let column = |channel: &Channel| {
            let (index, unit) =
                headings.iter().enumerate().find_map(|(k, h)| Some((k, unit(channel, h)?)))?;
            let bytes = bytes.get(index * length..(index + 1) * length)?;
            Some(values(bytes).map(|value| unit.to_si(value)).collect())
        };
        let columns: Vec<Option<Vec<f64>>> = info.channels.iter().map(column).collect();
        let missing: Vec<&str> = info
            .channels
            .iter()
            .zip(&columns)
            .filter(|(_, c)| c.is_none())
            .map(|(c, _)| &*c.name)
            .collect();
        let all = info.purpose == Purpose::Input;
        if (all && !missing.is_empty()) || missing.len() == columns.len() {
            return Err(lacks(info, &missing, headings));
        }
        let columns = columns.into_iter().map(Option::unwrap_or_default).collect();
        Ok(Self { sensor: info.name.clone(), times, columns })
    }

    /// Samples of a sensor with a column for each of its channels, in SI.
    pub fn of(sensor: &str, times: Vec<Time>, columns: Vec<Vec<f64>>) -> Self {
        Self { sensor: sensor.to_owned(), times, columns }
    }

    /// A source of these samples.
    pub fn source(self: &Arc<Self>, composition: &Composition) -> Option<Box<dyn Source>> {
        let sensor = SensorId(composition.sensor(&self.sensor)?);
        Some(Box::new(Reader { rows: Arc::clone(self), sensor, next: 0 }))
    }
}

/// The unit of a column if it is that of a channel: `vel_x` in SI, or `vel_x_cmps`.
fn unit(channel: &Channel, heading: &str) -> Option<Unit> {
    let rest = heading.strip_prefix(&*channel.name)?;
    if rest.is_empty() || heading == channel.column() {
        return Some(channel.unit);
    }
    let unit = column_suffix(rest.strip_prefix('_')?)?;
    (unit.exponents() == channel.unit.exponents()).then_some(unit)
}

fn lacks(info: &SensorInfo, missing: &[&str], headings: &[String]) -> PyErr {
    let wanted: Vec<String> = info.channels.iter().map(Channel::column).collect();
    let message = format!("[sensor.{}] has no column for {}", info.name, missing.join(", "));
    let remedy =
        format!("name the columns {}; there are {}", wanted.join(", "), headings.join(", "));
    exception(StreamError::scenario(message).with_remedy(remedy))
}

/// Gives the samples of a sensor in their order.
struct Reader {
    rows: Arc<Rows>,
    sensor: SensorId,
    next: usize,
}

impl Source for Reader {
    fn next(&mut self, into: &mut Sample) -> Result<bool, StreamError> {
        let Some(time) = self.rows.times.get(self.next) else { return Ok(false) };
        let value = |column: &Vec<f64>| column.get(self.next).copied().unwrap_or(f64::NAN);
        *into = sample(*time, self.sensor, self.rows.columns.iter().map(value));
        self.next += 1;
        Ok(true)
    }

    fn end(&self) -> Option<Time> {
        self.rows.times.last().copied()
    }
}
