//! The pace of a filter: its driving sensor, and the measurements that wait for it.

use super::cadence::Cadence;
use crate::checkpoint::saved;
use crate::model::process::Input;
use crate::model::process::screening::Spread;
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::collections::VecDeque;
use std::ops::RangeBounds;

/// Largest number of measurements that wait for the driving sensor.
pub(in crate::filter) const MAX_PENDING: usize = 1024;

/// Time and cadence of the first driving sensor, and the measurements ahead of it.
#[derive(Clone)]
pub(in crate::filter) struct Pace {
    /// Time of the last driving sample.
    input: Option<Time>,
    cadence: Cadence,
    /// Measurements ahead of the driving sensor, in order of time.
    waiting: VecDeque<Sample>,
}

saved!(Pace { input, cadence, waiting });

impl Pace {
    pub(in crate::filter) fn new() -> Self {
        let waiting = VecDeque::with_capacity(MAX_PENDING);
        Self { input: None, cadence: Cadence::default(), waiting }
    }

    /// Time of the last driving sample.
    pub(in crate::filter) fn input(&self) -> Option<Time> {
        self.input
    }

    /// Notes that the filter has reached a driving sample.
    pub(in crate::filter) fn reach(&mut self, sample: &Sample) {
        self.input = Some(sample.time);
    }

    /// A driving sample as an input, with the time since the last one and the time that it covers.
    pub(in crate::filter) fn input_of<'a>(
        &mut self,
        sample: &'a Sample,
        spread: Option<&'a Spread>,
    ) -> Input<'a> {
        let duration = self.input.map_or(0.0, |before| sample.time.since(before));
        Input { sample, duration, usual: self.cadence.usual(duration), spread }
    }

    /// Number of intervals with missing samples, and the longest of them, s.
    pub(in crate::filter) fn missing(&self) -> (u64, f64) {
        (self.cadence.missing, self.cadence.longest)
    }

    /// Queues a measurement in order of time, after the measurements of the same time that are not
    /// `last`. Returns the oldest if too many wait.
    pub(in crate::filter) fn wait(
        &mut self,
        sample: &Sample,
        last: impl Fn(&Sample) -> bool,
    ) -> Option<Sample> {
        let full = self.waiting.len() == MAX_PENDING;
        let oldest = if full { self.waiting.pop_front() } else { None };
        let place = |s: &Sample| (s.time, last(s));
        let before = self.waiting.iter().rposition(|p| place(p) <= place(sample));
        self.waiting.insert(before.map_or(0, |before| before + 1), *sample);
        oldest
    }

    /// Removes the next measurement, if it is within a span of time.
    pub(in crate::filter) fn next_within(
        &mut self,
        span: &impl RangeBounds<Time>,
    ) -> Option<Sample> {
        let due = self.waiting.front().is_some_and(|waiting| span.contains(&waiting.time));
        if due { self.waiting.pop_front() } else { None }
    }

    /// Forgets the measurements before a time.
    pub(in crate::filter) fn forget_before(&mut self, time: Time) {
        self.waiting.retain(|waiting| waiting.time >= time);
    }

    /// Approximate size of the queue, bytes.
    pub(in crate::filter) fn size(&self) -> usize {
        self.waiting.len() * size_of::<Sample>()
    }
}
