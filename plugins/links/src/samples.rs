//! Samples from the sentences of a stream.

use crate::sentence::{FRAMING, Sentence};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::{Count, Frames, Sentences, Zero};
use std::io::Read;
use std::path::PathBuf;

/// The samples of all sensors that a stream feeds.
pub struct Samples<R> {
    port: PathBuf,
    frames: Frames<R, Sentences>,
    sensors: Vec<SensorInfo>,
    /// Sensors that the scenario disables, whose samples are left out silently.
    disabled: Vec<String>,
    zero: Zero,
    /// Sentences that are none of a sensor of the scenario.
    strange: Count,
}

impl<R: Read> Samples<R> {
    /// The samples in the bytes of `reader`, the port of that name.
    pub fn new(port: PathBuf, reader: R, zero: Zero, context: &OpenContext<'_>) -> Self {
        Self {
            port,
            frames: Frames::new(reader, FRAMING),
            sensors: context.composition.sensors.iter().map(|s| s.info.clone()).collect(),
            disabled: context.disabled_sensors.clone(),
            zero,
            strange: Count::default(),
        }
    }

    /// Reads one sentence; `None` at the end of the stream.
    fn advance(&mut self) -> Result<Option<Option<Sample>>, StreamError> {
        let frame = self.frames.next().map_err(|e| StreamError::read(&self.port, e))?;
        let Some(frame) = frame else { return Ok(None) };
        let Some(sentence) = Sentence::parse(FRAMING.content(frame.bytes)) else {
            self.strange.add(frame.offset);
            return Ok(Some(None));
        };
        if self.disabled.iter().any(|name| name == sentence.sensor) {
            return Ok(Some(None));
        }
        let sample = sample(&self.sensors, &self.zero, sentence);
        if sample.is_none() {
            self.strange.add(frame.offset);
        }
        Ok(Some(sample))
    }
}

/// The sample of a sentence; `None` if it does not fit the sensors of the scenario.
fn sample(sensors: &[SensorInfo], zero: &Zero, sentence: Sentence<'_>) -> Option<Sample> {
    let index = sensors.iter().position(|info| info.name == sentence.sensor)?;
    let nanos = zero.arrival.map(|now| now()).or(sentence.nanos)?;
    let time = Time::from_nanos(nanos - zero.origin + zero.offset);
    let mut sample = Sample::empty(time, SensorId(index));
    sentence.fill(&sensors[index], &mut sample)?;
    Some(sample)
}

impl<R: Read + Send> Source for Samples<R> {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            match self.advance()? {
                Some(Some(next)) => {
                    *sample = next;
                    return Ok(true);
                }
                Some(None) => {}
                None => return Ok(false),
            }
        }
    }

    fn warning(&mut self) -> Option<String> {
        let mut parts: Vec<String> =
            self.frames.damage().describe("sentence").into_iter().collect();
        let what = "left out without a sensor, a time or channels of this scenario,";
        parts.extend(self.strange.describe("sentence", what));
        (!parts.is_empty()).then(|| format!("{}: {}", self.port.display(), parts.join("; ")))
    }
}
