//! The samples that one sensor receives from the sentences of a stream.

use crate::config::Nmea;
use crate::epoch::{Dates, Epoch, Gatherer};
use crate::sentence::Sentence;
use crate::target::Target;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use navfuse_frames::{Clock, Count, Stamp, TimeConfig};

/// Makes the samples of one sensor.
pub struct Receiver {
    pub target: Target,
    pub gatherer: Gatherer,
    clock: Clock<Epoch>,
    config: TimeConfig,
    checked: bool,
    estimated: Count,
}

impl Receiver {
    /// A receiver of the sentences since a date.
    pub fn new(target: Target, config: &Nmea, dates: Dates) -> Result<Self, StreamError> {
        Ok(Self {
            gatherer: Gatherer::new(target.part, config.estimated, dates),
            target,
            clock: Clock::new(config.time.zero()?),
            config: config.time,
            checked: false,
            estimated: Count::default(),
        })
    }

    /// Takes the next sentence.
    pub fn take(&mut self, offset: u64, sentence: &Sentence) -> Result<(), StreamError> {
        let done = self.gatherer.take(offset, sentence);
        self.push(done)
    }

    /// Takes a pause: no further sentence of the present epoch comes.
    pub fn pause(&mut self) -> Result<(), StreamError> {
        let done = self.gatherer.finish();
        self.push(done)
    }

    /// Takes the end of the stream.
    pub fn finish(&mut self) -> Result<(), StreamError> {
        self.pause()?;
        self.clock.finish();
        Ok(())
    }

    fn push(&mut self, done: Option<(Stamp, Epoch)>) -> Result<(), StreamError> {
        let Some((stamp, epoch)) = done else { return Ok(()) };
        if !self.checked {
            self.checked = true;
            self.config.check(stamp)?;
        }
        self.clock.push(stamp, epoch.offset, epoch);
        Ok(())
    }

    /// The next sample.
    pub fn pop(&mut self) -> Option<Sample> {
        while let Some((nanos, epoch)) = self.clock.pop() {
            if epoch.estimated {
                self.estimated.add(epoch.offset);
            }
            let sample = self.target.sample(Time::from_nanos(nanos), &epoch);
            if sample.is_some() {
                return sample;
            }
        }
        None
    }

    /// All that was left out so far.
    pub fn warnings(&self) -> Vec<String> {
        let mut parts = Vec::new();
        parts.extend(self.clock.describe("epoch"));
        let estimated = "with a position that is not from satellites, set `estimated` to use it,";
        parts.extend(self.estimated.describe("epoch", estimated));
        let magnetic = "without a variation, set `declination` to use it,";
        parts.extend(self.gatherer.unreferenced.describe("magnetic heading", magnetic));
        let vessel = "left out, without a position, or for heading up a heading, of the vessel,";
        parts.extend(self.gatherer.unplaced.describe("acoustic position", vessel));
        parts
    }
}
