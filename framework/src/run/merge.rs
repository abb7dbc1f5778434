//! Merging the samples of all sources in order of time, or of their arrival.

use crate::model::record::Event;
use crate::model::sensor::{Purpose, Sensor};
use crate::model::stream::{NamedSource, StreamError};
use crate::session::RunError;
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

const NO_SAMPLE: Sample = Sample::empty(Time::MIN, SensorId(0));

/// The place of a waiting sample: its arrival, and the number of its source. A reference that comes
/// last has the number of sources added.
type Place = (Time, usize);

/// The sources of a run. A step costs the logarithm of their number.
pub(crate) struct Merge {
    sources: Vec<NamedSource>,
    /// The next sample of each source.
    samples: Vec<Sample>,
    /// The samples of the sources, the first one on top.
    waiting: BinaryHeap<Reverse<Place>>,
    /// Number of sources that were asked for their first sample.
    asked: usize,
    /// True once the sample on top was taken: its source is asked for another before the next choice.
    taken: bool,
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
            asked: 0,
            taken: false,
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
    pub(crate) fn next(&mut self, running: bool) -> Result<Option<&Sample>, RunError> {
        while self.asked < self.sources.len() {
            let first = self.read(self.asked)?;
            self.waiting.extend(first);
            self.asked += 1;
        }
        if self.taken
            && let Some(last) = self.first()
        {
            let next = self.read(last)?;
            self.taken = false;
            match (next, self.waiting.peek_mut()) {
                (Some(place), Some(mut top)) => *top = place,
                (_, top) => _ = top.map(PeekMut::pop),
            }
        }
        if running != self.running {
            self.running = running;
            let waiting = std::mem::take(&mut self.waiting).into_vec();
            let again =
                waiting.iter().map(|Reverse(place)| self.place(place.0, self.source(place)));
            self.waiting = again.collect();
        }
        let first = self.first();
        self.taken = first.is_some();
        Ok(first.map(|k| &self.samples[k]))
    }

    /// The source of the sample on top.
    fn first(&self) -> Option<usize> {
        self.waiting.peek().map(|Reverse(place)| self.source(place))
    }

    /// The source of a place.
    fn source(&self, place: &Place) -> usize {
        place.1 % self.sources.len()
    }

    /// Reads the next sample of a source, and returns its place; `None` after the last one.
    fn read(&mut self, k: usize) -> Result<Option<Reverse<Place>>, RunError> {
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
        if !open {
            return Ok(None);
        }
        let arrival = source.arrival().unwrap_or(sample.time);
        self.feeds(k, found)?;
        Ok(Some(self.place(arrival, k)))
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
        let last = self.running && self.references[self.samples[k].sensor.0];
        Reverse((arrival, if last { k + self.sources.len() } else { k }))
    }
}
