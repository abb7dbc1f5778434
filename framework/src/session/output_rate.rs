//! The times at which estimates are recorded.

use crate::checkpoint::saved;
use crate::units::time::{Span, Time};

/// Chooses the estimates that the sinks receive: one in each period of the output rate.
///
/// If a reference is no faster than the output rate, each of its samples is recorded, and estimates
/// between them at the output rate. If it is faster, only its first sample in each period is
/// recorded, so that every recorded estimate has a truth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OutputRate {
    /// Time between recorded estimates.
    period: Span,
    /// The time from which the next estimate is recorded.
    next: Time,
    /// The time of the last estimate that was compared with a reference.
    compared: Option<Time>,
    /// Set while the reference is faster than the output rate.
    fast: bool,
}

saved!(OutputRate { next, compared, fast } except { period });

impl OutputRate {
    pub(crate) fn new(period: Span) -> Self {
        Self { period, next: Time::MIN, compared: None, fast: false }
    }

    /// Decides on an estimate at the time of a reference.
    pub(crate) fn records_comparison(&mut self, time: Time) -> bool {
        if let Some(before) = self.compared.replace(time) {
            self.fast = time - before < self.period;
        }
        let due = !self.fast || time >= self.next;
        if due {
            self.begin_period(time);
        }
        due
    }

    /// Returns `true` if an estimate at this time is due, whether or not there is a reference.
    pub(crate) fn is_due(&self, time: Time) -> bool {
        let expected = self.fast && self.compared.is_some_and(|t| time - t < self.period);
        time >= self.next && !expected
    }

    /// The period in which an estimate was recorded is over at the next multiple of its length.
    pub(crate) fn begin_period(&mut self, time: Time) {
        self.next = time.next_multiple(self.period);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Times, in ms, of the recorded estimates of a run with a driving sensor of 100 Hz, an output
    /// rate of 1 Hz, and a reference every `interval` ms from `first` to `last`.
    fn recorded(first: i64, interval: i64, last: i64) -> Vec<i64> {
        let mut rate = OutputRate::new(Span::from_nanos(1000 * MS));
        let mut times = Vec::new();
        for now in (0..=4000).step_by(10) {
            let time = Time::from_nanos(now * MS);
            let compared = (first..=last).contains(&now) && (now - first) % interval == 0;
            if compared && rate.records_comparison(time) {
                times.push(now);
            } else if !compared && rate.is_due(time) {
                rate.begin_period(time);
                times.push(now);
            }
        }
        times
    }

    #[test]
    fn a_faster_reference_is_recorded_once_in_each_period() {
        // 0: the first driving sample; 490 and 740: two references show the rate
        assert_eq!(recorded(490, 250, 4000), [0, 490, 1240, 2240, 3240]);
        assert_eq!(recorded(0, 250, 4000), [0, 1000, 2000, 3000, 4000]);
    }

    #[test]
    fn a_slower_reference_is_recorded_whole_beside_the_output_rate() {
        assert_eq!(recorded(500, 1000, 4000), [0, 500, 1000, 1500, 2000, 2500, 3000, 3500, 4000]);
        assert_eq!(recorded(0, 2000, 4000), [0, 1000, 2000, 3000, 4000]);
    }

    #[test]
    fn a_reference_that_ends_is_missed_for_one_period_at_most() {
        assert_eq!(recorded(0, 250, 1500), [0, 1000, 2500, 3000, 4000]);
    }
}
