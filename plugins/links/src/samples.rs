//! Samples from the sentences of a stream.

use crate::port::Remark;
use crate::sentence::{FRAMING, Sentence, command, is_command};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::{Count, Frames, Sentences, Zero};
use std::io::{self, ErrorKind, Read};
use std::path::PathBuf;
use std::sync::mpsc::Sender;

/// The samples of all sensors that a stream feeds.
pub struct Samples<R> {
    port: PathBuf,
    frames: Frames<R, Sentences>,
    sensors: Vec<SensorInfo>,
    /// Sensors that the scenario disables, whose samples are left out silently.
    disabled: Vec<String>,
    zero: Zero,
    /// Receives the commands, where the link may command.
    commands: Option<Sender<Remark>>,
    /// Sentences that are none of a sensor of the scenario.
    strange: Count,
    /// Commands that are unknown, or that the link may not give.
    refused: Count,
}

impl<R: Read> Samples<R> {
    /// The samples in the bytes of `reader`, the port of that name.
    pub fn new(
        port: PathBuf,
        reader: R,
        zero: Zero,
        commands: Option<Sender<Remark>>,
        context: &OpenContext<'_>,
    ) -> Self {
        Self {
            port,
            frames: Frames::new(reader, FRAMING),
            sensors: context.composition.sensors.iter().map(|s| s.info.clone()).collect(),
            disabled: context.disabled_sensors.clone(),
            zero,
            commands,
            strange: Count::default(),
            refused: Count::default(),
        }
    }

    /// Reads one sentence; `None` at the end of the stream.
    fn advance(&mut self) -> Result<Option<Option<Sample>>, StreamError> {
        let frame = self.frames.next().map_err(|e| StreamError::read(&self.port, e))?;
        let Some(frame) = frame else { return Ok(None) };
        let content = FRAMING.content(frame.bytes);
        if is_command(content) {
            let command = command(content, &self.sensors);
            match command.zip(self.commands.as_ref()) {
                // the feed that passes it on ends with this source
                Some((command, to)) => drop(to.send(Remark::Command(command))),
                None => self.refused.add(frame.offset),
            }
            // a command does not wait for the sample after it
            return Err(StreamError::read(&self.port, io::Error::from(ErrorKind::WouldBlock)));
        }
        let Some(sentence) = Sentence::parse(content) else {
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
        let what = match self.commands {
            Some(_) => "unknown or of no sensor of this scenario,",
            None => "refused, since the link has no `commands = true`,",
        };
        parts.extend(self.refused.describe("command", what));
        (!parts.is_empty()).then(|| format!("{}: {}", self.port.display(), parts.join("; ")))
    }
}
