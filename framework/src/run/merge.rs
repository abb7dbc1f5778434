//! Merging the samples of all sources in order of time, or of their arrival.

use crate::model::record::Event;
use crate::model::sensor::{Purpose, Sensor};
use crate::model::stream::{NamedSource, StreamError};
use crate::session::RunError;
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;

const NO_SAMPLE: Sample = Sample::empty(Time::MIN, SensorId(0));

/// The sources of a run.
pub(crate) struct Merge {
    sources: Vec<NamedSource>,
    heads: Vec<Head>,
    /// For each sensor, true for a reference.
    references: Vec<bool>,
}

/// The next sample of a source.
#[derive(Clone)]
struct Head {
    sample: Sample,
    arrival: Time,
    state: HeadState,
}

#[derive(Clone, Copy, PartialEq)]
enum HeadState {
    /// The sample was taken, and the source is asked for the next one before the next choice.
    Taken,
    Waiting,
    Ended,
}

impl Merge {
    pub(crate) fn new(sources: Vec<NamedSource>, sensors: &[Sensor]) -> Self {
        let references = sensors.iter().map(|s| s.info.purpose == Purpose::Reference).collect();
        let head = Head { sample: NO_SAMPLE, arrival: Time::MIN, state: HeadState::Taken };
        Self { heads: vec![head; sources.len()], sources, references }
    }

    /// The events that the sources announce.
    pub(crate) fn schedule(&self) -> Vec<Event> {
        self.sources.iter().flat_map(|(_, s)| s.schedule()).collect()
    }

    /// The time of the last sample, where a source knows it.
    pub(crate) fn end(&self) -> Option<Time> {
        self.sources.iter().filter_map(|(_, s)| s.end()).max()
    }

    /// The warnings that the sources give after their last sample, each with the source's name.
    pub(crate) fn warnings(&mut self) -> Vec<(String, String)> {
        let sources = self.sources.iter_mut();
        sources.filter_map(|(name, s)| Some((name.clone(), s.warning()?))).collect()
    }

    /// The sample that arrives next; `None` after the last one. Only sources whose samples have been
    /// taken are asked for another, and only now.
    ///
    /// # Errors
    /// When a source fails.
    pub(crate) fn next(&mut self, running: bool) -> Result<Option<Sample>, RunError> {
        for k in 0..self.heads.len() {
            if self.heads[k].state == HeadState::Taken {
                self.advance(k)?;
            }
        }
        let Some(first) = self.first(running) else { return Ok(None) };
        let head = &mut self.heads[first];
        head.state = HeadState::Taken;
        Ok(Some(head.sample))
    }

    /// Reads the next sample of a source.
    fn advance(&mut self, k: usize) -> Result<(), RunError> {
        let ((name, source), head) = (&mut self.sources[k], &mut self.heads[k]);
        head.sample = NO_SAMPLE;
        let failed = |error| RunError::Source { source_name: name.clone(), error };
        let open = source.next(&mut head.sample).map_err(failed)?;
        let (found, count) = (head.sample.sensor.0, self.references.len());
        if found >= count {
            return Err(failed(StreamError::format(format!(
                "a sample has the sensor number {found}, but the scenario has {count} sensors"
            ))));
        }
        head.state = if open { HeadState::Waiting } else { HeadState::Ended };
        head.arrival = source.arrival().unwrap_or(head.sample.time);
        Ok(())
    }

    /// The source whose sample arrives first; a sample arrives at its own time unless the source
    /// gives another. Among samples that arrive at the same time the first source wins,
    /// except that a running filter takes references last: the truth is compared with the estimate
    /// that has used every other sample of that time.
    fn first(&self, running: bool) -> Option<usize> {
        let waiting = |(_, head): &(usize, &Head)| head.state == HeadState::Waiting;
        let order = |(_, head): &(usize, &Head)| {
            (head.arrival, running && self.references[head.sample.sensor.0])
        };
        self.heads.iter().enumerate().filter(waiting).min_by_key(order).map(|(k, _)| k)
    }
}
