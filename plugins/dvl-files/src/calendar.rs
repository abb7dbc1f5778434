//! Dates of the Gregorian calendar as nanoseconds since 1970, without leap seconds.

/// Nanoseconds of a second.
pub const SECOND: i64 = 1_000_000_000;
/// Nanoseconds of a day.
pub const DAY: i64 = 86_400 * SECOND;

/// A date and a time of the day as an instrument writes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Calendar {
    /// Year with its century.
    pub year: i32,
    /// Month from 1.
    pub month: u8,
    /// Day from 1.
    pub day: u8,
    /// Hour.
    pub hour: u8,
    /// Minute.
    pub minute: u8,
    /// Second, up to 60 for a leap second.
    pub second: u8,
    /// Nanoseconds of the second.
    pub nanos: u32,
}

impl Calendar {
    /// Nanoseconds since 1970-01-01; `None` where no such time exists or the count overflows.
    pub fn unix_nanos(&self) -> Option<i64> {
        if !(1970..=2200).contains(&self.year) {
            return None;
        }
        let clock = time_of_day(self.hour, self.minute, self.second, self.nanos)?;
        days(self.year, self.month, self.day)?.checked_mul(DAY)?.checked_add(clock)
    }
}

/// Nanoseconds since midnight; `None` where no such time exists.
pub fn time_of_day(hour: u8, minute: u8, second: u8, nanos: u32) -> Option<i64> {
    if hour > 23 || minute > 59 || second > 60 || nanos >= 1_000_000_000 {
        return None;
    }
    let seconds = (i64::from(hour) * 60 + i64::from(minute)) * 60 + i64::from(second);
    Some(seconds * SECOND + i64::from(nanos))
}

/// The year of two digits: 80 to 99 are in the last century.
pub fn with_century(two_digits: u8) -> i32 {
    i32::from(two_digits) + if two_digits >= 80 { 1900 } else { 2000 }
}

/// Days since 1970-01-01; `None` where no such day exists.
fn days(year: i32, month: u8, day: u8) -> Option<i64> {
    let leap = |y: i32| (y % 4 == 0 && y % 100 != 0) || y % 400 == 0;
    let lengths = [31, 28 + u8::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let index = usize::from(month.checked_sub(1)?);
    if day == 0 || day > *lengths.get(index)? {
        return None;
    }
    let years =
        i64::from(year - 1970) * 365 + i64::from((1970..year).filter(|y| leap(*y)).count() as u32);
    let months: i64 = lengths[..index].iter().map(|n| i64::from(*n)).sum();
    Some(years + months + i64::from(day) - 1)
}

/// Parses `2022-06-01` and, after it, `T08:30:00.25Z`; returns nanoseconds since 1970, and
/// whether there is a time of the day.
pub fn parse(text: &str) -> Option<(i64, bool)> {
    let (date, time) = match text.split_once(['T', ' ']) {
        Some((date, time)) => (date, Some(time.strip_suffix('Z').unwrap_or(time))),
        None => (text, None),
    };
    let mut parts = date.splitn(3, '-');
    let mut next = || parts.next().filter(|p| p.bytes().all(|b| b.is_ascii_digit()));
    let (year, month, day) = (next()?.parse().ok()?, next()?.parse().ok()?, next()?.parse().ok()?);
    let midnight =
        Calendar { year, month, day, hour: 0, minute: 0, second: 0, nanos: 0 }.unix_nanos()?;
    let Some(time) = time else { return Some((midnight, false)) };
    let mut parts = time.splitn(3, ':');
    let mut next = || parts.next().filter(|p| !p.starts_with(['+', '-']));
    let (hour, minute) = (next()?.parse().ok()?, next()?.parse().ok()?);
    let (second, nanos) = match next() {
        Some(seconds) => decimal_seconds(seconds.as_bytes())?,
        None => (0, 0),
    };
    Some((midnight + time_of_day(hour, minute, second, nanos)?, true))
}

/// Parses seconds with decimals, `05.25`, into seconds and nanoseconds.
pub fn decimal_seconds(text: &[u8]) -> Option<(u8, u32)> {
    let point = text.iter().position(|b| *b == b'.').unwrap_or(text.len());
    let (whole, decimals) = (&text[..point], text.get(point + 1..).unwrap_or_default());
    let digits = |d: &[u8]| -> Option<u32> {
        d.iter().try_fold(0_u32, |n, b| b.is_ascii_digit().then(|| n * 10 + u32::from(b - b'0')))
    };
    if whole.is_empty() || whole.len() > 2 || decimals.len() > 9 {
        return None;
    }
    let scale = 10_u32.pow(9 - u32::try_from(decimals.len()).ok()?);
    Some((u8::try_from(digits(whole)?).ok()?, digits(decimals)? * scale))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn a_date_is_the_unix_time_that_every_other_program_gives() {
        // `date -u -d ... +%s`
        for (text, seconds) in [
            ("1970-01-01", 0),
            ("2000-02-29T23:59:59Z", 951_868_799),
            ("2017-05-24T11:50:13.4", 1_495_626_613),
            ("2021-03-01", 1_614_556_800),
            ("2038-01-19 03:14:08", 2_147_483_648),
        ] {
            let nanos = parse(text).unwrap().0;
            assert_eq!(nanos / SECOND, seconds, "{text}");
        }
        assert_eq!(parse("2017-05-24T11:50:13.4").unwrap().0 % SECOND, 400_000_000);
    }

    #[test]
    fn what_is_no_date_is_none() {
        for text in [
            "",
            "2017",
            "2017-13-01",
            "2017-02-29",
            "2017-00-01",
            "2017-01-00",
            "17-01-01",
            "2017-01-01T24:00",
            "2017-01-01T12:60",
            "2017-01-01T12:00:00+02:00",
            "2017-01-01T",
            "2017-1-x",
            "1969-12-31",
            "2017-01-01T1:-2",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
