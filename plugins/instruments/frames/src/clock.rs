//! The clock of an instrument: its stamps on the clock of the run, in order.

use navfuse_core::units::calendar::{DAY, SECOND};
use navfuse_core::units::time::Time;
use std::collections::VecDeque;
use std::fmt::Write;

/// Change of time, in nanoseconds, beyond which the clock may have been set, or a stamp damaged.
const STEP: i64 = 600 * SECOND;

/// The time stamp of a record, on the clock that its format has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stamp {
    /// The record has no stamp, or one that is no time, such as month zero.
    #[default]
    Missing,
    /// Date and time: nanoseconds since 1970, without leap seconds.
    Date(i64),
    /// Time of the day without a date: nanoseconds since midnight.
    TimeOfDay(i64),
    /// Nanoseconds since the record before.
    Elapsed(i64),
}

/// The zero of the run's clock on the clock of the instrument.
#[derive(Clone, Copy, Debug, Default)]
pub struct Zero {
    /// Nanoseconds since 1970 at which the run's clock is zero.
    pub origin: i64,
    /// Midnight before the first record, for stamps without a date, in nanoseconds since 1970.
    pub first_day: Option<i64>,
    /// Offset that is added to every stamp.
    pub offset: i64,
    /// Clock that replaces the stamps by the time of arrival, in nanoseconds since 1970: for an
    /// instrument without a clock, or with one that is not to be trusted.
    pub arrival: Option<fn() -> i64>,
}

/// Converts stamps and puts records of type `T` in order. A record whose stamp agrees with no other is
/// left out.
#[derive(Debug)]
pub struct Clock<T> {
    zero: Zero,
    /// Time of the day of the ping before, and the days since the first.
    day: Option<(i64, i64)>,
    elapsed: Option<i64>,
    last: Option<i64>,
    /// A record with its offset, whose time no other record has confirmed yet.
    held: Option<(i64, u64, T)>,
    ready: VecDeque<(i64, T)>,
    missing: Count,
    late: Count,
    late_by: i64,
    stray: Count,
    forward: Count,
    forward_by: i64,
}

/// A number of events and the offset of the first one in the file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Count {
    number: u64,
    first: u64,
}

impl Count {
    /// Counts an event.
    pub fn add(&mut self, offset: u64) {
        if self.number == 0 {
            self.first = offset;
        }
        self.number += 1;
    }

    /// Describes the events, if there are any: "3 pings WHAT, the first at byte 17", where `record`
    /// is the format's word for a record.
    pub fn describe(&self, record: &str, what: &str) -> Option<String> {
        let (n, first) = (self.number, self.first);
        match n {
            0 => None,
            1 => Some(format!("1 {record} {what} at byte {first}")),
            _ => {
                let what = what.trim_end_matches(',');
                Some(format!("{n} {record}s {what}, the first at byte {first}"))
            }
        }
    }

    /// Tests whether there was no event.
    pub fn is_zero(&self) -> bool {
        self.number == 0
    }
}

impl<T> Clock<T> {
    /// The clock with this zero.
    pub fn new(zero: Zero) -> Self {
        Self {
            zero,
            day: None,
            elapsed: None,
            last: None,
            held: None,
            ready: VecDeque::with_capacity(4),
            missing: Count::default(),
            late: Count::default(),
            late_by: 0,
            stray: Count::default(),
            forward: Count::default(),
            forward_by: 0,
        }
    }

    /// Takes the next record of the file, which begins at the offset.
    pub fn push(&mut self, stamp: Stamp, offset: u64, record: T) {
        match self.time(stamp) {
            Some(time) => self.order(time, offset, record),
            None => self.missing.add(offset),
        }
    }

    /// The time of a record on the run's clock in nanoseconds, whatever came before; counts a record
    /// without one.
    pub fn at_once(&mut self, stamp: Stamp, offset: u64) -> Option<i64> {
        let time = self.time(stamp);
        if time.is_none() {
            self.missing.add(offset);
        }
        time
    }

    /// Takes the end of the file.
    pub fn finish(&mut self) {
        if let Some((time, offset, record)) = self.held.take() {
            // a single record far from all others is a damaged stamp, unless there is no other
            if self.last.is_none() {
                self.release(time, offset, record);
            } else {
                self.stray.add(offset);
            }
        }
    }

    /// The next record in order, with its time on the run's clock in nanoseconds.
    pub fn pop(&mut self) -> Option<(i64, T)> {
        self.ready.pop_front()
    }

    /// Describes what was wrong with the stamps, where `record` is the format's word for a record.
    pub fn describe(&self, record: &str) -> Option<String> {
        let mut parts = Vec::new();
        parts.extend(
            self.missing.describe(
                record,
                "left out without a valid time within 73 years of the run's zero",
            ),
        );
        if let Some(mut text) =
            self.late.describe(record, "left out, not later than the one before")
        {
            let _ = write!(text, " (by up to {:.2} s)", self.late_by as f64 * 1e-9);
            parts.push(text);
        }
        parts.extend(self.stray.describe(record, "left out whose time agrees with no other"));
        if let Some(mut text) = self.forward.describe(record, "after a gap or a step of the clock")
        {
            let _ = write!(text, " (by up to {:.0} s)", self.forward_by as f64 * 1e-9);
            parts.push(text);
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// The time of a stamp on the run's clock.
    fn time(&mut self, stamp: Stamp) -> Option<i64> {
        if let Some(now) = self.zero.arrival {
            let time = now() - self.zero.origin + self.zero.offset;
            // records that arrive together keep their order
            let before = self.held.as_ref().map(|(held, ..)| *held).max(self.last);
            return Some(before.map_or(time, |before| time.max(before + 1)));
        }
        let instrument = match stamp {
            Stamp::Missing => return None,
            Stamp::Date(nanos) => nanos.checked_sub(self.zero.origin)?,
            Stamp::TimeOfDay(now) => {
                // midnight was passed, or passed back, if the time changes by over half a day
                let days = self.day.map_or(0, |(before, days)| match now - before {
                    change if change < -DAY / 2 => days + 1,
                    change if change > DAY / 2 => days - 1,
                    _ => days,
                });
                self.day = Some((now, days));
                let midnight = self.zero.first_day.map_or(0, |day| day - self.zero.origin);
                midnight.checked_add(days * DAY)?.checked_add(now)?
            }
            Stamp::Elapsed(nanos) => {
                let total = self.elapsed.map_or(0, |before| before.saturating_add(nanos));
                self.elapsed = Some(total);
                total
            }
        };
        let time = instrument.checked_add(self.zero.offset)?;
        (Time::MIN.nanos() < time && time < Time::MAX.nanos()).then_some(time)
    }

    fn order(&mut self, time: i64, offset: u64, record: T) {
        let follows = |from: i64| time > from && time - from <= STEP;
        if let Some(last) = self.last
            && time <= last
        {
            self.late.add(offset);
            self.late_by = self.late_by.max(last - time);
            return;
        }
        match (self.held.take(), self.last) {
            (None, Some(last)) if follows(last) => self.release(time, offset, record),
            // the first record, or one after a gap
            (None, _) => self.held = Some((time, offset, record)),
            (Some((held, at, first)), _) if follows(held) => {
                self.release(held, at, first);
                self.release(time, offset, record);
            }
            (Some((_, stray, _)), Some(last)) if follows(last) => {
                self.stray.add(stray);
                self.release(time, offset, record);
            }
            (Some((held, at, first)), _) if time > held => {
                self.release(held, at, first);
                self.held = Some((time, offset, record));
            }
            (Some((held, at, first)), None) if held - time <= STEP => {
                self.release(held, at, first);
                self.order(time, offset, record);
            }
            (Some((_, stray, _)), _) => {
                self.stray.add(stray);
                self.held = Some((time, offset, record));
            }
        }
    }

    fn release(&mut self, time: i64, offset: u64, record: T) {
        if let Some(last) = self.last
            && time - last > STEP
        {
            self.forward.add(offset);
            self.forward_by = self.forward_by.max(time - last);
        }
        self.last = Some(time);
        self.ready.push_back((time, record));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn one_comma_ends_a_clause() {
        let mut count = Count::default();
        count.add(17);
        let described = |count: &Count| count.describe("chunk", "skipped, damaged,");
        assert_eq!(described(&count).as_deref(), Some("1 chunk skipped, damaged, at byte 17"));
        count.add(18);
        let several = "2 chunks skipped, damaged, the first at byte 17";
        assert_eq!(described(&count).as_deref(), Some(several));
    }

    #[test]
    fn the_time_of_arrival_replaces_any_stamp_and_keeps_the_order() {
        let zero = Zero { arrival: Some(|| 7 * SECOND), offset: 1, ..Zero::default() };
        let mut clock = Clock::new(zero);
        for stamp in [Stamp::Missing, Stamp::Date(3), Stamp::Elapsed(-5)] {
            clock.push(stamp, 0, ());
        }
        clock.finish();
        let times: Vec<i64> = std::iter::from_fn(|| clock.pop()).map(|(time, ())| time).collect();
        assert_eq!(times, [7, 8, 9].map(|k| 7 * SECOND + k - 6));
        assert_eq!(clock.describe("ping"), None);
    }

    /// The seconds of the pings that a clock gives for stamps in seconds, and its description.
    fn read(stamps: &[Stamp]) -> (Vec<i64>, Option<String>) {
        let mut clock = Clock::new(Zero::default());
        let mut times = Vec::new();
        for (k, stamp) in stamps.iter().enumerate() {
            clock.push(*stamp, k as u64 * 100, ());
            times.extend(std::iter::from_fn(|| clock.pop()));
        }
        clock.finish();
        times.extend(std::iter::from_fn(|| clock.pop()));
        (times.iter().map(|(t, _)| t / SECOND).collect(), clock.describe("ping"))
    }

    fn dates(seconds: &[i64]) -> (Vec<i64>, Option<String>) {
        read(&seconds.iter().map(|s| Stamp::Date(s * SECOND)).collect::<Vec<_>>())
    }

    #[test]
    fn one_damaged_stamp_costs_one_ping() {
        let intact = [1000, 1001, 1002, 1003, 1004, 1005];
        assert_eq!(dates(&intact), (intact.to_vec(), None));
        for k in 0..intact.len() {
            // with one ping before it, a stamp in the past could as well be the true one
            let wrong: &[i64] = if k < 2 { &[900_000_000] } else { &[5, 900_000_000] };
            for wrong in wrong {
                let mut stamps = intact;
                stamps[k] = *wrong;
                let expected: Vec<i64> =
                    intact.iter().copied().filter(|t| *t != intact[k]).collect();
                let (times, text) = dates(&stamps);
                assert_eq!((times, text.is_some()), (expected, true), "{k} {wrong}");
            }
        }
    }

    #[test]
    fn a_clock_that_steps_is_reported_with_offset_and_count() {
        let (times, text) = dates(&[10, 11, 12, 5000, 5001]);
        assert_eq!(times, [10, 11, 12, 5000, 5001]);
        let text = text.unwrap_or_default();
        assert_eq!(text, "1 ping after a gap or a step of the clock at byte 300 (by up to 4988 s)");
        let (times, text) = dates(&[10, 11, 12, 8, 9, 10, 11, 12, 13, 14]);
        assert_eq!(times, [10, 11, 12, 13, 14]);
        assert_eq!(
            text.unwrap_or_default(),
            "5 pings left out, not later than the one before, the first at byte 300 (by up to \
             4.00 s)"
        );
    }

    #[test]
    fn stamps_of_zero_are_counted() {
        let date = |s| Stamp::Date(s * SECOND);
        let (times, text) =
            read(&[Stamp::Missing, Stamp::Missing, date(10), date(11), Stamp::Missing, date(12)]);
        assert_eq!(times, [10, 11, 12]);
        assert_eq!(
            text.unwrap_or_default(),
            "3 pings left out without a valid time within 73 years of the run's zero, the first at \
             byte 0"
        );
    }

    #[test]
    fn a_time_of_the_day_goes_on_after_midnight() {
        let at = |s| Stamp::TimeOfDay(s * SECOND);
        let (times, text) = read(&[at(86_398), at(86_399), at(0), at(1)]);
        assert_eq!((times, text), (vec![86_398, 86_399, 86_400, 86_401], None));
    }

    #[test]
    fn elapsed_times_add_up_from_the_first_record() {
        let (times, _) = read(&[Stamp::Elapsed(7 * SECOND); 4]);
        assert_eq!(times, [0, 7, 14, 21]);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_stamps_give_times_in_order(
            stamps in proptest::collection::vec(prop_oneof![
                Just(Stamp::Missing),
                any::<i64>().prop_map(Stamp::Date),
                (0..3000_i64).prop_map(|s| Stamp::Date(s * SECOND)),
                (0..DAY).prop_map(Stamp::TimeOfDay),
                (0..DAY).prop_map(Stamp::Elapsed),
            ], 0..40)
        ) {
            let (times, _) = read(&stamps);
            prop_assert!(times.len() <= stamps.len());
            prop_assert!(times.is_sorted());
        }
    }
}
