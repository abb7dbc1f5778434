//! Sources whose samples arrive later than they are valid: the key `delay` of a sensor.

use crate::compose::Composition;
use crate::model::record::Event;
use crate::model::sensor::delivery::Delay;
use crate::model::stream::{NamedSource, Source, StreamError};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

/// Delay of each sensor and the purpose of its random numbers, for a scenario where some sensor has
/// a delay.
type Delays = Arc<[Option<(Delay, String)>]>;

/// Delays the samples of the sources as the scenario demands.
pub(crate) fn delayed(sources: Vec<NamedSource>, composition: &Composition) -> Vec<NamedSource> {
    let sensors = composition.sensors.iter();
    let delays: Delays = sensors
        .map(|s| s.delay.map(|delay| (delay, format!("delay of {}", s.info.name))))
        .collect();
    if delays.iter().all(Option::is_none) {
        return sources;
    }
    let seed = composition.seed;
    let wrap = |source| Delayed {
        source,
        delays: Arc::clone(&delays),
        seed,
        next: None,
        ended: false,
        waiting: BinaryHeap::new(),
        count: 0,
        arrival: Time::MIN,
    };
    sources.into_iter().map(|(name, s)| (name, Box::new(wrap(s)) as Box<dyn Source>)).collect()
}

/// A source whose samples are given in order of arrival.
struct Delayed {
    source: Box<dyn Source>,
    delays: Delays,
    seed: u64,
    /// Sample of the source that is not delivered yet.
    next: Option<Sample>,
    ended: bool,
    /// Samples on their way, the one that arrives first on top.
    waiting: BinaryHeap<Reverse<Waiting>>,
    count: u64,
    /// Arrival of the sample that was given last.
    arrival: Time,
}

/// A sample on its way. Among samples that arrive at the same time, the source's order holds.
struct Waiting {
    arrival: Time,
    count: u64,
    sample: Sample,
}

impl Waiting {
    fn place(&self) -> (Time, u64) {
        (self.arrival, self.count)
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.place() == other.place()
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.place().cmp(&other.place())
    }
}

impl Source for Delayed {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            if self.next.is_none() && !self.ended {
                let mut next = Sample::empty(Time::MIN, SensorId(0));
                self.ended = !self.source.next(&mut next)?;
                self.next = (!self.ended).then_some(next);
            }
            // no later sample of the source arrives before its own time
            let first = self.waiting.peek().map(|Reverse(w)| w.arrival);
            if first.is_some_and(|first| self.next.is_none_or(|next| first <= next.time))
                && let Some(Reverse(waiting)) = self.waiting.pop()
            {
                self.arrival = waiting.arrival;
                *sample = waiting.sample;
                return Ok(true);
            }
            let Some(next) = self.next.take() else { return Ok(false) };
            let delay = self.delays.get(next.sensor.0).and_then(Option::as_ref);
            let arrival = delay
                .map_or(next.time, |(delay, purpose)| delay.arrival(self.seed, purpose, next.time));
            self.count += 1;
            self.waiting.push(Reverse(Waiting { arrival, count: self.count, sample: next }));
        }
    }

    fn arrival(&self) -> Option<Time> {
        Some(self.arrival)
    }

    fn end(&self) -> Option<Time> {
        self.source.end()
    }

    fn schedule(&self) -> Vec<Event> {
        self.source.schedule()
    }

    fn warning(&mut self) -> Option<String> {
        self.source.warning()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log that was cut off.
    struct CutOff;

    impl Source for CutOff {
        fn next(&mut self, _: &mut Sample) -> Result<bool, StreamError> {
            Ok(false)
        }
        fn end(&self) -> Option<Time> {
            Some(Time::MAX)
        }
        fn warning(&mut self) -> Option<String> {
            Some("the last row is cut off".to_owned())
        }
    }

    #[test]
    fn a_source_with_a_delay_keeps_its_end_and_its_warning() {
        let mut delayed = Delayed {
            source: Box::new(CutOff),
            delays: Arc::new([]),
            seed: 1,
            next: None,
            ended: false,
            waiting: BinaryHeap::new(),
            count: 0,
            arrival: Time::MIN,
        };
        assert_eq!(delayed.end(), Some(Time::MAX));
        assert_eq!(delayed.warning().as_deref(), Some("the last row is cut off"));
    }
}
