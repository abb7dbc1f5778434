//! Samples in order of time, where messages were received in another order.

use navfuse_core::units::sample::{MAX_CHANNELS, Sample};
use navfuse_core::units::time::Time;
use navfuse_frames::Count;
use std::collections::BTreeMap;

/// Largest number of samples that wait.
const MOST: usize = 1 << 16;

/// A sample that waits for earlier ones.
#[derive(Debug)]
struct Waiting {
    received: i64,
    offset: u64,
    sample: Sample,
}

/// Puts samples in order. Each waits until messages are received that are later by a window.
#[derive(Debug)]
pub struct Order {
    /// Nanoseconds.
    window: i64,
    /// By time and order of arrival.
    waiting: BTreeMap<(Time, u64), Waiting>,
    arrivals: u64,
    newest: i64,
    last: Option<Time>,
    ended: bool,
    /// Samples that came too late.
    pub late: Count,
}

impl Order {
    /// Samples in order within a window in nanoseconds.
    pub fn new(window: i64) -> Self {
        Self {
            window,
            waiting: BTreeMap::new(),
            arrivals: 0,
            newest: i64::MIN,
            last: None,
            ended: false,
            late: Count::default(),
        }
    }

    /// Takes a sample, with the time at which its message was received.
    pub fn push(&mut self, received: i64, offset: u64, sample: Sample) {
        self.now(received);
        let key = (sample.time, self.arrivals);
        self.arrivals += 1;
        self.waiting.insert(key, Waiting { received, offset, sample });
    }

    /// Takes the time of a message without a sample.
    pub fn now(&mut self, received: i64) {
        self.newest = self.newest.max(received);
    }

    /// Takes the end.
    pub fn finish(&mut self) {
        self.ended = true;
    }

    /// The next sample in order, if it need not wait.
    pub fn pop(&mut self) -> Option<Sample> {
        loop {
            let (_, first) = self.waiting.first_key_value()?;
            let due = first.received.saturating_add(self.window) <= self.newest;
            if !due && !self.ended && self.waiting.len() < MOST {
                return None;
            }
            let (_, Waiting { mut sample, offset, .. }) = self.waiting.pop_first()?;
            if self.last.is_some_and(|last| sample.time < last) {
                self.late.add(offset);
                continue;
            }
            self.last = Some(sample.time);
            // two topics of one sensor with the same stamp are one sample
            while let Some(next) = self.waiting.first_entry() {
                let other = &next.get().sample;
                let same = other.time == sample.time && other.sensor == sample.sensor;
                if !same || other.present() & sample.present() != 0 {
                    break;
                }
                let other = next.remove().sample;
                for k in 0..MAX_CHANNELS {
                    if let Some(value) = other.get(k) {
                        sample.set(k, value);
                    }
                }
            }
            return Some(sample);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::units::sample::SensorId;

    fn sample(time: i64, sensor: usize, channel: usize) -> Sample {
        let mut sample = Sample::empty(Time::from_nanos(time), SensorId(sensor));
        sample.set(channel, time as f64);
        sample
    }

    fn drain(order: &mut Order) -> Vec<(i64, usize)> {
        std::iter::from_fn(|| order.pop()).map(|s| (s.time.nanos(), s.sensor.0)).collect()
    }

    #[test]
    fn messages_that_were_delayed_by_less_than_the_window_come_in_order() {
        let mut order = Order::new(10);
        let mut out = Vec::new();
        for k in 0..50 {
            order.push(k, 0, sample(k, 0, 0));
            if k % 5 == 4 {
                order.push(k, 0, sample(k - 4, 1, 0));
            }
            out.extend(drain(&mut order));
        }
        order.finish();
        out.extend(drain(&mut order));
        assert_eq!(out.len(), 60);
        assert!(out.is_sorted(), "{out:?}");
        assert!(order.late.is_zero());
    }

    #[test]
    fn a_message_that_comes_too_late_is_counted_and_left_out() {
        let mut order = Order::new(10);
        (0..30).for_each(|k| order.push(k, 0, sample(k, 0, 0)));
        assert_eq!(drain(&mut order).last(), Some(&(19, 0)));
        order.push(30, 77, sample(5, 1, 0));
        order.finish();
        assert_eq!(drain(&mut order).first(), Some(&(20, 0)));
        let text = order.late.describe("message", "late");
        assert_eq!(text.as_deref(), Some("1 message late at byte 77"));
    }

    #[test]
    fn two_topics_of_a_sensor_with_one_stamp_are_one_sample() {
        let mut order = Order::new(10);
        order.push(0, 0, sample(3, 0, 0));
        order.push(0, 0, sample(3, 0, 4));
        order.push(0, 0, sample(3, 0, 4));
        order.finish();
        let first = order.pop().map(|s| s.present());
        assert_eq!(first, Some(1 | 1 << 4));
        assert_eq!(order.pop().map(|s| s.present()), Some(1 << 4));
    }

    #[test]
    fn the_number_of_samples_that_wait_is_bounded() {
        let mut order = Order::new(i64::MAX);
        let mut longest = 0;
        for k in 0..2 * MOST as i64 {
            order.push(0, 0, sample(k, 0, 0));
            while order.pop().is_some() {}
            longest = longest.max(order.waiting.len());
        }
        assert!(longest < MOST);
    }
}
