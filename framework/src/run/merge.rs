//! Merging the samples of all sources in order of time, or of their arrival.

use crate::model::record::{Event, Level, Observer};
use crate::model::sensor::{Purpose, SensorInfo};
use crate::model::stream::{NamedSource, StreamError};
use crate::run::outputs::Outputs;
use crate::run::runner::RunError;
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;

const NO_SAMPLE: Sample = Sample::empty(Time::MIN, SensorId(0));

/// The sources of a run.
pub(crate) struct Merge {
    sources: Vec<NamedSource>,
    heads: Vec<Head>,
    /// Events that the sources announced, the last one first.
    schedule: Vec<Event>,
    /// For each sensor, true for a reference.
    references: Vec<bool>,
}

/// The next sample of a source.
#[derive(Clone)]
struct Head {
    sample: Sample,
    arrival: Time,
    /// Set while the source has samples.
    open: bool,
}

impl Merge {
    pub(crate) fn new(sources: Vec<NamedSource>, sensors: &[SensorInfo]) -> Self {
        let mut schedule: Vec<Event> = sources.iter().flat_map(|(_, s)| s.schedule()).collect();
        schedule.sort_by_key(|e| std::cmp::Reverse(e.time));
        let references = sensors.iter().map(|s| s.purpose == Purpose::Reference).collect();
        let head = Head { sample: NO_SAMPLE, arrival: Time::MIN, open: false };
        Self { heads: vec![head; sources.len()], sources, schedule, references }
    }

    /// Logs the scheduled events up to a time.
    pub(crate) fn log_schedule(&mut self, now: Time, outputs: &mut Outputs) {
        while self.schedule.last().is_some_and(|e| e.time <= now) {
            if let Some(mut event) = self.schedule.pop() {
                // an event without a time belongs to the beginning
                if event.time == Time::MIN {
                    event.time = now;
                }
                outputs.event(event);
            }
        }
    }

    /// The time of the last sample, where a source knows it.
    pub(crate) fn end(&self) -> Option<Time> {
        self.sources.iter().filter_map(|(_, s)| s.end()).max()
    }

    /// Reads the first sample of every source.
    pub(crate) fn fill(&mut self) -> Result<(), RunError> {
        (0..self.sources.len()).try_for_each(|k| self.advance(k))
    }

    /// Reads the next sample of a source.
    pub(crate) fn advance(&mut self, k: usize) -> Result<(), RunError> {
        let ((name, source), head) = (&mut self.sources[k], &mut self.heads[k]);
        head.sample = NO_SAMPLE;
        let failed = |error| RunError::Source { source_name: name.clone(), error };
        head.open = source.next(&mut head.sample).map_err(failed)?;
        let (found, count) = (head.sample.sensor.0, self.references.len());
        if found >= count {
            return Err(failed(StreamError::format(format!(
                "a sample has the sensor number {found}, but the scenario has {count} sensors"
            ))));
        }
        head.arrival = source.arrival().unwrap_or(head.sample.time);
        Ok(())
    }

    /// The source whose sample arrives first; a sample arrives at its own time unless the source
    /// gives another. Among samples that arrive at the same time the first source wins,
    /// except that a running filter takes references last: the truth is compared with the estimate
    /// that has used every other sample of that time.
    pub(crate) fn first(&self, running: bool) -> Option<usize> {
        let mut first = None;
        for (k, head) in self.heads.iter().enumerate().filter(|(_, head)| head.open) {
            let order = (head.arrival, running && self.references[head.sample.sensor.0]);
            if first.is_none_or(|(least, _)| order < least) {
                first = Some((order, k));
            }
        }
        first.map(|(_, k)| k)
    }

    /// The next sample of a source.
    pub(crate) fn sample(&self, source: usize) -> Sample {
        self.heads[source].sample
    }

    /// Logs the warnings that the sources give after their last sample.
    pub(crate) fn log_warnings(&mut self, time: Time, outputs: &mut Outputs) {
        for (name, source) in &mut self.sources {
            if let Some(text) = source.warning() {
                outputs.event(Event { time, level: Level::Warning, about: name.clone(), text });
            }
        }
    }
}
