//! Instants and their differences as exact counts of nanoseconds.

use crate::checkpoint::saved;
use std::fmt;
use std::ops::{Add, Sub};

/// An instant on the clock of the run, in whole nanoseconds from its zero. The count is exact, so
/// that equal times compare equal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(i64);

saved!(Time(nanos));

impl Time {
    /// A time before every instant of a run.
    pub const MIN: Self = Self(i64::MIN / 4);
    /// A time after every instant of a run.
    pub const MAX: Self = Self(i64::MAX / 4);

    /// The time of a number of nanoseconds.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// The time of a number of seconds, rounded to the nearest nanosecond; `None` if the number is
    /// not finite or beyond 73 years.
    pub fn from_seconds(seconds: f64) -> Option<Self> {
        let nanos = (seconds * 1e9).round();
        (nanos.abs() < Self::MAX.0 as f64).then_some(Self(nanos as i64))
    }

    /// The time in nanoseconds.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// The time in seconds.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }

    /// Seconds from `earlier` to this time.
    pub fn since(self, earlier: Self) -> f64 {
        (self - earlier).seconds()
    }

    /// The first multiple of a period after this time, counted from zero.
    pub fn next_multiple(self, period: Span) -> Self {
        Self((self.0.div_euclid(period.0) + 1).saturating_mul(period.0))
    }
}

impl Add<Span> for Time {
    type Output = Self;
    fn add(self, span: Span) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl Sub<Span> for Time {
    type Output = Self;
    fn sub(self, span: Span) -> Self {
        Self(self.0.saturating_sub(span.0))
    }
}

impl Sub for Time {
    type Output = Span;
    fn sub(self, earlier: Self) -> Span {
        Span(self.0.saturating_sub(earlier.0))
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} s", self.seconds())
    }
}

/// The difference of two times, in whole nanoseconds. It is exact, and an instant cannot stand in
/// its place.
///
/// ```
/// use navfuse_core::units::time::{Span, Time};
/// let (begin, end) = (Time::from_nanos(40), Time::from_nanos(100));
/// assert_eq!(end - begin, Span::from_nanos(60));
/// assert_eq!(begin + (end - begin), end);
/// ```
/// ```compile_fail
/// # use navfuse_core::units::time::{Span, Time};
/// let sum = Time::from_nanos(40) + Time::from_nanos(60);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span(i64);

saved!(Span(nanos));

impl Span {
    /// No time at all.
    pub const ZERO: Self = Self(0);
    /// A span after which every instant of a run has passed.
    pub const MAX: Self = Self(Time::MAX.0);

    /// The span of a number of nanoseconds.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// The span of a number of seconds, rounded to the nearest nanosecond; `None` if the number is
    /// not finite or beyond 73 years.
    pub fn from_seconds(seconds: f64) -> Option<Self> {
        Time::from_seconds(seconds).map(|time| Self(time.0))
    }

    /// The span in nanoseconds.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// The span in seconds.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }
}

impl Add for Span {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Span {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} s", self.seconds())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::{Span, Time};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig {
            failure_persistence: None, ..ProptestConfig::default()
        })]

        #[test]
        fn seconds_and_nanoseconds_convert_to_the_nearest_and_back(
            nanos in -(1_i64 << 53)..(1 << 53)
        ) {
            // Below 2^53 ns (104 days) the count is an exact f64, so that one division rounds once.
            // On the way back, half a unit in the last place of the seconds and of the product add
            // up. Below 2^51 ns (26 days) they are 0.12 + 0.13 ns at most, which rounding removes;
            // beyond, they and the rounding itself are below 0.5 + 0.5 + 0.5 ns.
            let t = Time::from_nanos(nanos);
            let back = Time::from_seconds(t.seconds()).unwrap();
            prop_assert!((back.nanos() - nanos).abs() <= i64::from(nanos.abs() > 1 << 51));
            let exact = format!("{}e-9", nanos).parse::<f64>().unwrap();
            prop_assert_eq!(t.seconds(), exact, "correctly rounded");
        }

        #[test]
        fn a_span_is_exact_however_late_it_is(
            start in 0..1_i64 << 60, length in 0..1_i64 << 50
        ) {
            let (a, b) = (Time::from_nanos(start), Time::from_nanos(start + length));
            let span = Span::from_nanos(length);
            prop_assert_eq!((b - a, a + span, b - span), (span, b, a));
            prop_assert_eq!(b.since(a), span.seconds());
        }
    }

    #[test]
    fn what_is_no_time_is_none_and_the_ends_of_time_do_not_overflow() {
        for s in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e10, -1e300] {
            assert_eq!(Time::from_seconds(s), None);
        }
        let (first, last) = (Time::from_nanos(i64::MIN), Time::from_nanos(i64::MAX));
        let span = Span::from_nanos(i64::MAX);
        assert!(last.since(first) > 0.0 && first.since(last) < 0.0);
        assert_eq!((last + span, first - span, span + span), (last, first, span));
    }

    /// `MAX` is 2^61 - 1 ns, which as f64 is 2^61. The f64 of 2^61 ns in seconds gives 2^61 exactly,
    /// and the one before it 256 ns less.
    #[test]
    fn no_number_of_seconds_is_a_time_after_the_last() {
        let last = (1_i64 << 61) as f64 / 1e9;
        assert_eq!(last * 1e9, (1_i64 << 61) as f64);
        assert_eq!((Time::from_seconds(last), Time::from_seconds(-last)), (None, None));
        let before = Time::from_seconds(last.next_down());
        assert_eq!(before.map(Time::nanos), Some((1 << 61) - 256));
    }
}
