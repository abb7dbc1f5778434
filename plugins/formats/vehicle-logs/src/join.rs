//! Samples of one message with channels of another, interpolated to the times of the first.

use navfuse_core::units::sample::{MAX_CHANNELS, Sample};
use navfuse_frames::{Clock, Count, Stamp};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Longest interval between two second messages that is interpolated, in nanoseconds.
const LONGEST: i64 = 1_000_000_000;
/// Largest number of samples that wait for a second message.
const WAITING: usize = 1024;

/// Fills the channels that a first message lacks.
#[derive(Debug, Default)]
pub struct Join {
    /// The second message before, with its time.
    before: Option<(i64, Sample)>,
    /// Samples of the first message with time and offset.
    waiting: VecDeque<(i64, u64, Sample)>,
    /// Samples without second messages around them.
    pub alone: Count,
}

impl Join {
    /// Takes the first message.
    pub fn first(&mut self, nanos: i64, offset: u64, sample: Sample, clock: &mut Clock<Sample>) {
        if self.waiting.len() >= WAITING {
            self.release(clock);
        }
        self.waiting.push_back((nanos, offset, sample));
    }

    /// Takes the second message.
    pub fn second(
        &mut self,
        nanos: i64,
        sample: Sample,
        is_angle: impl Fn(usize) -> bool,
        clock: &mut Clock<Sample>,
    ) {
        while let Some((time, offset, mut first)) =
            self.waiting.pop_front_if(|(time, ..)| *time <= nanos)
        {
            match self.before.filter(|(before, _)| *before <= time && nanos - before <= LONGEST) {
                Some((before, from)) => {
                    let share = match nanos - before {
                        0 => 1.0,
                        interval => (time - before) as f64 / interval as f64,
                    };
                    fill(&mut first, &from, &sample, share, &is_angle);
                }
                None => self.alone.add(offset),
            }
            clock.push(Stamp::Date(time), offset, first);
        }
        self.before = Some((nanos, sample));
    }

    /// Takes the end of the file.
    pub fn finish(&mut self, clock: &mut Clock<Sample>) {
        while !self.waiting.is_empty() {
            self.release(clock);
        }
    }

    /// Gives the oldest sample as it is.
    fn release(&mut self, clock: &mut Clock<Sample>) {
        if let Some((time, offset, sample)) = self.waiting.pop_front() {
            self.alone.add(offset);
            clock.push(Stamp::Date(time), offset, sample);
        }
    }
}

/// Fills the channels that a sample lacks by those between two others.
fn fill(
    sample: &mut Sample,
    from: &Sample,
    to: &Sample,
    share: f64,
    is_angle: &impl Fn(usize) -> bool,
) {
    for k in 0..MAX_CHANNELS {
        if let (None, Some(a), Some(b)) = (sample.get(k), from.get(k), to.get(k)) {
            let change = if is_angle(k) { (b - a + PI).rem_euclid(TAU) - PI } else { b - a };
            sample.set(k, a + share * change);
        }
    }
}
