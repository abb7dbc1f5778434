//! Merging the samples of all sources in order of time, or of their arrival.

use crate::model::record::Event;
use crate::model::sensor::{Purpose, Sensor};
use crate::model::stream::{NamedSource, StreamError};
use crate::session::RunError;
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

const NO_SAMPLE: Sample = Sample::empty(Time::MIN, SensorId(0));

/// The place of a waiting sample: its arrival, true for a reference that comes last, and its source.
type Place = (Time, bool, usize);

/// The sources of a run. A step costs the logarithm of their number.
pub(crate) struct Merge {
    sources: Vec<NamedSource>,
    /// The next sample of each source.
    samples: Vec<Sample>,
    /// The samples that wait, the first one on top.
    waiting: BinaryHeap<Reverse<Place>>,
    /// The sources whose samples were taken, and which are asked for another before the next choice.
    taken: Vec<usize>,
    /// True if the places are those of a running filter.
    running: bool,
    /// For each sensor, true for a reference.
    references: Vec<bool>,
    /// Names of the sensors.
    names: Vec<String>,
    /// For each sensor, the source that feeds it.
    feeders: Vec<Option<usize>>,
}

impl Merge {
    pub(crate) fn new(sources: Vec<NamedSource>, sensors: &[Sensor]) -> Self {
        Self {
            samples: vec![NO_SAMPLE; sources.len()],
            waiting: BinaryHeap::with_capacity(sources.len()),
            taken: (0..sources.len()).rev().collect(),
            running: false,
            feeders: vec![None; sensors.len()],
            names: sensors.iter().map(|s| s.info.name.clone()).collect(),
            references: sensors.iter().map(|s| s.info.purpose == Purpose::Reference).collect(),
            sources,
        }
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
        while let Some(k) = self.taken.last() {
            self.advance(*k)?;
            self.taken.pop();
        }
        if running != self.running {
            self.running = running;
            let waiting = std::mem::take(&mut self.waiting).into_vec();
            self.waiting =
                waiting.into_iter().map(|Reverse((at, _, k))| self.place(at, k)).collect();
        }
        let Some(Reverse((_, _, first))) = self.waiting.pop() else { return Ok(None) };
        self.taken.push(first);
        Ok(Some(self.samples[first]))
    }

    /// Reads the next sample of a source.
    fn advance(&mut self, k: usize) -> Result<(), RunError> {
        let ((name, source), sample) = (&mut self.sources[k], &mut self.samples[k]);
        *sample = NO_SAMPLE;
        let failed = |error| RunError::Source { source_name: name.clone(), error };
        let open = source.next(sample).map_err(failed)?;
        let (found, count) = (sample.sensor.0, self.references.len());
        if found >= count {
            return Err(failed(StreamError::format(format!(
                "a sample has the sensor number {found}, but the scenario has {count} sensors"
            ))));
        }
        if open {
            let arrival = source.arrival().unwrap_or(sample.time);
            self.feeds(k, found)?;
            self.waiting.push(self.place(arrival, k));
        }
        Ok(())
    }

    /// Takes note that a source feeds a sensor, which no other one does.
    fn feeds(&mut self, k: usize, sensor: usize) -> Result<(), RunError> {
        let Some(other) = self.feeders[sensor].replace(k).filter(|other| *other != k) else {
            return Ok(());
        };
        let [first, second] = [other, k].map(|k| self.sources[k].0.clone());
        let sensor = &self.names[sensor];
        let text = format!("[sensor.{sensor}] has samples from two sources, {first} and {second}");
        let remedy = "remove the sensor from one of them; [source.csv] reads NAME.csv of its folder \
                      for each sensor";
        let error = StreamError::scenario(text).with_remedy(remedy);
        Err(RunError::Source { source_name: second, error })
    }

    /// The place of the sample of a source; a sample arrives at its own time unless the source
    /// gives another. Among samples that arrive at the same time the first source wins,
    /// except that a running filter takes references last: the truth is compared with the estimate
    /// that has used every other sample of that time.
    fn place(&self, arrival: Time, k: usize) -> Reverse<Place> {
        Reverse((arrival, self.running && self.references[self.samples[k].sensor.0], k))
    }
}
