//! Dates of the Gregorian calendar as nanoseconds since 1970, without leap seconds.

/// Nanoseconds of a second.
pub const SECOND: i64 = 1_000_000_000;
/// Nanoseconds of a day.
pub const DAY: i64 = 86_400 * SECOND;

/// Nanoseconds of a week of GPS time.
pub const WEEK: i64 = 7 * DAY;
/// Zero of GPS time, 1980-01-06, in nanoseconds since 1970.
pub const GPS_ZERO: i64 = 315_964_800 * SECOND;

/// First months, as year and month (January or July), of each count of leap seconds since the zero of GPS time.
const LEAP_SECONDS: [(i64, u8); 18] = [
    (1981, 7),
    (1982, 7),
    (1983, 7),
    (1985, 7),
    (1988, 1),
    (1990, 1),
    (1991, 1),
    (1992, 7),
    (1993, 7),
    (1994, 7),
    (1996, 1),
    (1997, 7),
    (1999, 1),
    (2006, 1),
    (2009, 1),
    (2012, 7),
    (2015, 7),
    (2017, 1),
];

/// The times of UTC, in nanoseconds since 1970, from which each count of leap seconds holds.
const STEPS: [i64; 18] = {
    let (mut steps, mut k) = ([0; 18], 0);
    while k < 18 {
        let (year, month) = LEAP_SECONDS[k];
        // January to June have 181 days, and 182 in a leap year
        let half = if month == 7 { 181 + is_leap(year) as i64 } else { 0 };
        steps[k] = (days_before(year) + half) * DAY;
        k += 1;
    }
    steps
};

/// Tests whether a year of the Gregorian calendar has 366 days.
const fn is_leap(year: i64) -> bool {
    (year % 4 == 0 && year % 100 != 0) || year % 400 == 0
}

/// Days from 1970 to the begin of a year after Christ.
const fn days_before(year: i64) -> i64 {
    let before = year - 1;
    // 477 leap years lie before 1970
    365 * (year - 1970) + before / 4 - before / 100 + before / 400 - 477
}

/// Nanoseconds by which GPS time is ahead of UTC at a time of UTC, in nanoseconds since 1970. The
/// table ends with the leap second of 2016, the last until the end of 2026 at least.
pub fn leap_seconds(utc: i64) -> i64 {
    STEPS.partition_point(|step| utc >= *step) as i64 * SECOND
}

/// UTC of a time on the scale of GPS, both in nanoseconds since 1970.
pub fn utc_of_gps(gps: i64) -> i64 {
    // the leap seconds at the time itself are right except within the last seconds before a change
    let utc = gps.saturating_sub(leap_seconds(gps));
    gps.saturating_sub(leap_seconds(utc))
}

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

    /// Date and time of a number of nanoseconds since 1970.
    pub fn of_unix_nanos(nanos: i64) -> Self {
        let (day, clock) = (nanos.div_euclid(DAY), nanos.rem_euclid(DAY));
        let seconds = clock / SECOND;
        // years begin in March here, so that the leap day is last; 146 097 days are 400 years, and
        // 719 468 days lie between 0000-03-01 and 1970-01-01
        let day = day + 719_468;
        let (era, day) = (day.div_euclid(146_097), day.rem_euclid(146_097));
        let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
        let day = day - (365 * year + year / 4 - year / 100);
        let month = (5 * day + 2) / 153;
        let date = day - (153 * month + 2) / 5 + 1;
        let (month, january) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
        Self {
            year: (400 * era + year + january) as i32,
            month: month as u8,
            day: date as u8,
            hour: (seconds / 3600) as u8,
            minute: (seconds / 60 % 60) as u8,
            second: (seconds % 60) as u8,
            nanos: (clock % SECOND) as u32,
        }
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
    let leap = is_leap(i64::from(year));
    let lengths = [31, 28 + u8::from(leap), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let index = usize::from(month.checked_sub(1)?);
    if day == 0 || day > *lengths.get(index)? {
        return None;
    }
    let months: i64 = lengths[..index].iter().map(|n| i64::from(*n)).sum();
    Some(days_before(i64::from(year)) + months + i64::from(day) - 1)
}

/// Parses `2022-06-01` and, after it, `T08:30:00.25Z` or `T09:30:00.25+01:00`; returns nanoseconds
/// since 1970, and whether there is a time of the day.
pub fn parse(text: &str) -> Option<(i64, bool)> {
    let (date, time) = match text.split_once(['T', ' ']) {
        Some((date, time)) => (date, Some(time.strip_suffix('Z').unwrap_or(time))),
        None => (text, None),
    };
    let (time, zone) = match time.and_then(|time| Some((time, time.rfind(['+', '-'])?))) {
        Some((time, at)) => (Some(time[..at].trim_end()), zone(&time[at..])?),
        None => (time, 0),
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
    Some((midnight + time_of_day(hour, minute, second, nanos)? - zone, true))
}

/// The nanoseconds by which a zone such as `+01:00` or `-0330` is ahead of UTC.
fn zone(text: &str) -> Option<i64> {
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let digits = || text[1..].bytes().filter(|b| *b != b':');
    let number = |from: usize| {
        let mut two = digits().skip(from).take(2);
        two.try_fold(0_u8, |n, b| b.is_ascii_digit().then(|| n * 10 + (b - b'0')))
    };
    let known = matches!(digits().count(), 2 | 4);
    Some(sign * time_of_day(number(0).filter(|_| known)?, number(2)?, 0, 0)?)
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
    fn a_zone_is_subtracted() {
        let utc = parse("2021-02-28T23:30:00.5Z");
        for text in [
            "2021-03-01T00:30:00.5+01:00",
            "2021-03-01 00:30:00.5 +0100",
            "2021-03-01 00:30:00.5+01",
            "2021-02-28T20:00:00.5-03:30",
        ] {
            assert_eq!(parse(text), utc, "{text}");
        }
        for wrong in ["2021-03-01T00:30:00+1", "2021-03-01T00:30:00+25:00", "2021-03-01T00:30-x"] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn every_day_of_two_centuries_is_its_own_date() {
        for day in 0..days(2200, 12, 31).unwrap() {
            let nanos = day * DAY + 86_399 * SECOND + 7;
            assert_eq!(Calendar::of_unix_nanos(nanos).unix_nanos(), Some(nanos));
        }
        // `date -u -d @-1`
        let before = Calendar::of_unix_nanos(-SECOND);
        assert_eq!((before.year, before.month, before.day, before.second), (1969, 12, 31, 59));
    }

    #[test]
    fn gps_time_is_ahead_by_the_leap_seconds_of_the_date() {
        let nanos = |text| parse(text).unwrap().0;
        assert_eq!(nanos("1980-01-06"), GPS_ZERO);
        // IERS Bulletin C: GPS - UTC
        for (text, seconds) in [
            ("1980-01-06", 0),
            ("1981-06-30T23:59:59", 0),
            ("1981-07-01", 1),
            ("1999-01-01", 13),
            ("2016-12-31T23:59:59", 17),
            ("2017-01-01", 18),
            ("2026-06-01", 18),
        ] {
            let utc = nanos(text);
            assert_eq!(leap_seconds(utc), seconds * SECOND, "{text}");
            assert_eq!(utc_of_gps(utc + seconds * SECOND), utc, "{text}");
        }
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
            "2017-01-01T12:00:00+25:00",
            "2017-01-01T",
            "2017-1-x",
            "1969-12-31",
            "2017-01-01T1:-2",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_day_ends_with_the_nanosecond_before_midnight_or_with_a_leap_second() {
        assert_eq!(time_of_day(0, 0, 0, 0), Some(0));
        assert_eq!(time_of_day(23, 59, 59, 999_999_999), Some(DAY - 1));
        assert_eq!(time_of_day(23, 59, 60, 0), Some(DAY));
        for (hour, minute, second, nanos) in
            [(24, 0, 0, 0), (0, 60, 0, 0), (0, 0, 61, 0), (0, 0, 0, 1_000_000_000)]
        {
            assert_eq!(time_of_day(hour, minute, second, nanos), None);
        }
    }
}
