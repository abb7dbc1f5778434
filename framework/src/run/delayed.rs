//! Sources whose samples arrive later than they are valid, or have other stamps: the keys `delay` and
//! `samples.clock` of a sensor.

use crate::compose::Composition;
use crate::model::record::Event;
use crate::model::sensor::Sensor;
use crate::model::sensor::delivery::Delay;
use crate::model::stream::{NamedSource, Source, StreamError};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::{Span, Time};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

/// Delivery of the samples of a sensor.
struct Delivery {
    /// Delay, and the purpose of its random numbers.
    delay: Option<(Delay, String)>,
    /// Time that was added to the stamps of the source.
    clock: Span,
}

impl Delivery {
    fn new(sensor: &Sensor) -> Self {
        let delay = sensor.delay.map(|delay| (delay, format!("delay of {}", sensor.info.name)));
        Self { delay, clock: sensor.conversion.as_ref().map_or(Span::ZERO, |c| c.clock) }
    }
}

/// Delays the samples of the sources as the scenario demands.
pub(crate) fn delayed(sources: Vec<NamedSource>, composition: &Composition) -> Vec<NamedSource> {
    let deliveries: Arc<[Delivery]> = composition.sensors.iter().map(Delivery::new).collect();
    if deliveries.iter().all(|d| d.delay.is_none() && d.clock == Span::ZERO) {
        return sources;
    }
    let seed = composition.seed;
    let back = deliveries.iter().map(|d| d.clock).min().unwrap_or_default().min(Span::ZERO);
    let wrap = |source| Delayed {
        source,
        deliveries: Arc::clone(&deliveries),
        back,
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
    deliveries: Arc<[Delivery]>,
    /// Largest time by which a clock goes back, at most zero.
    back: Span,
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
            let next = self.next.map(|sample| (sample, self.deliveries.get(sample.sensor.0)));
            // no later sample of the source arrives before this time: before its own, and one of a
            // clock that goes back before that
            let first = self.waiting.peek().map(|Reverse(w)| w.arrival);
            let earliest = next.map(|(sample, delivery)| {
                sample.time - delivery.map_or(Span::ZERO, |d| d.clock) + self.back
            });
            if first.is_some_and(|first| earliest.is_none_or(|earliest| first <= earliest))
                && let Some(Reverse(waiting)) = self.waiting.pop()
            {
                self.arrival = waiting.arrival;
                *sample = waiting.sample;
                return Ok(true);
            }
            let Some((next, delivery)) = next else { return Ok(false) };
            self.next = None;
            let delay = delivery.and_then(|d| d.delay.as_ref());
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
            deliveries: Arc::new([]),
            back: Span::ZERO,
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
