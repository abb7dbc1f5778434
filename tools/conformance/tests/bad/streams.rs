//! A source and a sink with a fault that the scenario names.

use navfuse_core::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

pub struct BadStreams;

impl Plugin for BadStreams {
    fn build(&self, registry: &mut Registry) {
        registry.source::<Rest>();
        registry.sink::<Last>();
    }
}

/// An IMU at rest for 20 s.
#[derive(Deserialize, JsonSchema)]
pub struct Rest {
    /// Name of the fault.
    fault: String,
}

impl SourceType for Rest {
    const TYPE: &'static str = "rest";
    fn open(self, _: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        Ok(vec![Box::new(AtRest { fault: self.fault, count: 0 })])
    }
}

struct AtRest {
    fault: String,
    count: i64,
}

impl Source for AtRest {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        self.count += 1;
        let odd = self.count == 150;
        if self.count > 200 || self.fault == "nothing" {
            return Ok(self.fault == "again" && self.count == 202);
        }
        let back = if odd && self.fault == "back" { 5 } else { 0 };
        let sensor = if odd && self.fault == "stranger" { 7 } else { 0 };
        *sample =
            Sample::empty(Time::from_nanos((self.count - back) * 100_000_000), SensorId(sensor));
        for (channel, value) in [0.0, 0.0, 0.0, 0.0, 0.0, -9.8].into_iter().enumerate() {
            sample.set(channel, if odd && self.fault == "nan" { f64::NAN } else { value });
        }
        if odd && self.fault == "channel" {
            sample.set(9, 1.0);
        }
        Ok(true)
    }

    fn end(&self) -> Option<Time> {
        Some(Time::from_nanos(if self.fault == "end" { 5_000_000_000 } else { 20_000_000_000 }))
    }
}

/// The time of the last estimate.
#[derive(Deserialize, JsonSchema)]
pub struct Last {
    /// Name of the fault.
    fault: String,
}

static RUNS: AtomicU32 = AtomicU32::new(0);

impl SinkType for Last {
    const TYPE: &'static str = "last";
    const DEFAULT: bool = false;
    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let path = context.output.join("last.txt");
        Ok(Box::new(Writing { fault: self.fault, path, last: Time::MIN }))
    }
}

struct Writing {
    fault: String,
    path: PathBuf,
    last: Time,
}

impl Sink for Writing {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        self.last = epoch.state.time;
        if self.fault == "full" { Err(StreamError::new("no space left")) } else { Ok(()) }
    }
    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        let text = match self.fault.as_str() {
            "clock" => format!("{} {}", self.last, RUNS.fetch_add(1, Ordering::Relaxed)),
            "empty" => String::new(),
            _ => self.last.to_string(),
        };
        if self.fault == "nowhere" {
            return Ok(Some("/nowhere/last.txt".into()));
        }
        if self.fault != "cut" || self.last >= Time::from_nanos(15_000_000_000) {
            std::fs::write(&self.path, text).map_err(|e| StreamError::write(&self.path, e))?;
        }
        Ok(Some(self.path.display().to_string()))
    }
}
