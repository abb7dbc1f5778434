//! The columns of the time: a number, a date, a time of the day, or a week of GPS.

use crate::config::{FileConfig, Order, Scale, TimeColumn, TimeFormat};
use crate::dates;
use crate::headings::Wanted;
use crate::time::{self, TimeError};
use csv::ByteRecord;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::calendar::{self, Calendar, GPS_ZERO, WEEK};
use navfuse_core::units::time::{Span, Time};

/// Nanoseconds of a day, of a minute and of a second.
const DAY: i64 = 86_400_000_000_000;
const MINUTE: i64 = 60_000_000_000;
const SECOND: i128 = 1_000_000_000;
/// Longest text of a date with a time of the day.
const LONGEST_DATE: usize = 48;
/// Part of a period by which a clock may be silent around its end: a minute and a half of a day.
const SHARE: i64 = 1024;

/// The columns of the time.
pub struct TimeCell {
    /// Index of the column of the time.
    pub column: usize,
    form: Form,
    /// UTC of the run's zero, in nanoseconds since 1970; zero for a number.
    origin: i64,
    /// Offset that is added to the time.
    offset: Span,
}

/// A column that is added to a time, and its unit in nanoseconds.
type Part = (usize, u64);

/// The content of the columns.
enum Form {
    /// A number in this unit, in nanoseconds, and what is added.
    Number(u64, Option<Part>),
    /// A date with a time of the day; the date may stand in a column of its own. With `true` on the
    /// scale of GPS.
    Date(Option<usize>, Order, bool),
    /// Columns of year, month, day, hour and minute, and what is added.
    Fields([usize; 5], Option<Part>, bool),
    /// A time of the day.
    Day,
    /// A count in a unit of nanoseconds, and the count's nanoseconds at the begin of 1970. With `true` on the scale
    /// of GPS.
    Since(u64, i128, bool),
    /// Columns of the year and of the day of the year, beside the seconds of the day, or of hour and minute too, beside the
    /// seconds of the minute. With `true` on the scale of GPS.
    OfYear(([usize; 2], Option<[usize; 2]>), bool),
    /// Column of the week of GPS, and the unit of the time within the week. With `true` on the scale
    /// of GPS, otherwise without leap seconds.
    Week(usize, u64, bool),
}

impl TimeCell {
    /// Finds the columns of the time.
    ///
    /// # Errors
    /// When a column is missing, is ambiguous, or has an unsuitable unit, or keys contradict.
    pub fn find(
        info: &SensorInfo,
        config: &FileConfig,
        headings: &[String],
    ) -> Result<Self, StreamError> {
        let (given, key) = (&config.time.0, format!("files.{}.time", info.name));
        let others: Vec<&str> = info.channels.iter().map(|c| &*c.name).collect();
        let number = || {
            let unit = given.unit.map(|u| u.0);
            let column = given.column.as_deref();
            let wanted = Wanted { name: "time", si: "s", column, unit, key: &key, others: &others };
            let found = wanted.find(headings)?;
            let nanos = found.unit.map_or(1e9, |u| u.to_si(1e9));
            // exact times need a unit of whole nanoseconds, as all usual units of time are
            if !(1.0..=86_400e9).contains(&nanos) || (nanos - nanos.round()).abs() > 1e-6 {
                let message = "a unit of time from ns to day is needed, such as \"ms\"";
                return Err(StreamError::scenario(format!("{key}.unit: {message}")));
            }
            Ok((found.index, nanos.round() as u64))
        };
        let text = |heading: &str| {
            let column = Some(heading);
            let wanted =
                Wanted { name: "time", si: "", column, unit: None, key: &key, others: &others };
            wanted.find(headings).map(|found| found.index)
        };
        let part = || {
            let column = given.nanos.as_deref().map(text).transpose()?;
            let unit = given.nanos_unit.map_or(1.0, |u| u.0.to_si(1e9));
            Ok::<_, StreamError>(column.map(|column| (column, unit.round().max(1.0) as u64)))
        };
        let contradicts = |what: &str| Err(StreamError::scenario(format!("{key}.{what}")));
        let gps = given.scale == Some(Scale::Gps);
        let named = given.column.as_deref().unwrap_or("time");
        let dated = given.date.is_some() || given.format == TimeFormat::DateTime;
        let (column, form) = match (&given.week, &given.date, given.format) {
            (Some(_), Some(_), _) => {
                return contradicts("week: a time has a week or a date; remove one of them");
            }
            (Some(week), None, TimeFormat::Number) => {
                let (column, unit) = number()?;
                (column, Form::Week(text(week)?, unit, given.scale != Some(Scale::Utc)))
            }
            (Some(_), ..) => {
                return contradicts("week: the time of a week is a number; remove `format`");
            }
            _ if given.unit.is_some() && (dated || given.format != TimeFormat::Number) => {
                return contradicts("unit: a date has no unit; remove it");
            }
            (None, _, format) if since(format).is_some() => {
                let (unit, before) = since(format).unwrap_or((1, 0));
                (text(named)?, Form::Since(unit, before, gps))
            }
            (None, date, _) if dated => {
                let date = date.as_deref().map(text).transpose()?;
                (text(named)?, Form::Date(date, given.order, gps))
            }
            _ if given.fields.is_some() => {
                (text(named)?, Form::Fields(fields(given, text)?, part()?, gps))
            }
            (None, ..) if given.of_year.is_some() => {
                let columns = given.of_year.iter().flatten().map(|heading| text(heading));
                let columns = match *columns.collect::<Result<Vec<usize>, _>>()?.as_slice() {
                    [year, day] => ([year, day], None),
                    [year, day, hour, minute] => ([year, day], Some([hour, minute])),
                    _ => {
                        return contradicts(
                            "of_year: name year and day of the year, or hour and minute too",
                        );
                    }
                };
                (text(named)?, Form::OfYear(columns, gps))
            }
            _ if given.scale.is_some() || given.origin.is_some() => {
                return contradicts(
                    "scale, origin: a number has no date; set `offset`, or format = \"date-time\"",
                );
            }
            (None, _, TimeFormat::TimeOfDay) => (text(named)?, Form::Day),
            _ => {
                let (column, unit) = number()?;
                (column, Form::Number(unit, part()?))
            }
        };
        let offset = time::from_seconds(given.offset.map_or(0.0, |o| o.si()));
        let offset = offset
            .ok_or_else(|| StreamError::scenario(format!("{key}.offset: beyond 73 years")))?;
        let origin = given.origin.map_or(0, |date| date.nanos);
        Ok(Self { column, form, origin, offset })
    }

    /// Tests whether the time uses a column.
    pub fn uses(&self, column: usize) -> bool {
        let other = match self.form {
            Form::Number(_, part) => part.is_some_and(|(k, _)| k == column),
            Form::Date(date, ..) => date == Some(column),
            Form::Fields(fields, part, _) => {
                fields.contains(&column) || part.is_some_and(|(k, _)| k == column)
            }
            Form::OfYear((day, minute), _) => {
                day.contains(&column) || minute.is_some_and(|minute| minute.contains(&column))
            }
            Form::Day | Form::Since(..) => false,
            Form::Week(week, ..) => week == column,
        };
        self.column == column || other
    }

    /// The form of the time, for a message.
    pub fn needs(&self) -> &'static str {
        match self.form {
            Form::Number(..)
            | Form::Week(..)
            | Form::Fields(..)
            | Form::OfYear(..)
            | Form::Since(..) => "a decimal number is needed",
            Form::Date(..) => "a date such as 2022-06-01T08:30:00.25Z is needed",
            Form::Day => "a time of the day such as 08:30:00.25 or 083000.25 is needed",
        }
    }

    /// The period after which the clock starts again from zero, if stamps that fell from `before` to
    /// `time` show one: 16, 24 or 32 bits, an hour, a day or a week. `step` is the last interval
    /// between two stamps.
    pub fn period(&self, before: Time, time: Time, step: Span) -> Option<Span> {
        let spans = [3600, 86_400, 604_800].map(|seconds| seconds * 1_000_000_000);
        let periods: Vec<i64> = match self.form {
            Form::Number(unit, None) => {
                let counts = [16, 24, 32].map(|bits| (1_i64 << bits).saturating_mul(unit as i64));
                counts.into_iter().chain(spans).collect()
            }
            Form::Day => vec![spans[1]],
            Form::Number(..)
            | Form::Date(..)
            | Form::Since(..)
            | Form::OfYear(..)
            | Form::Fields(..)
            | Form::Week(..) => Vec::new(),
        };
        let [from, to] = [before, time].map(|time| (time - self.offset).nanos());
        let goes_on = |period: &i64| {
            let gap = period.saturating_sub(from).saturating_add(to);
            let largest = (period / SHARE).max(3 * step.nanos().min(period / 64));
            to >= 0 && from < *period && gap > 0 && gap <= largest
        };
        periods.into_iter().find(goes_on).map(Span::from_nanos)
    }

    /// The time of a row.
    ///
    /// # Errors
    /// When a cell is no time, or the time is too far from zero.
    pub fn of(&self, record: &ByteRecord) -> Result<Time, TimeError> {
        let cell = |column: usize| record.get(column).unwrap_or_default().trim_ascii();
        let here = cell(self.column);
        let utc = |nanos: i64, gps: bool| if gps { calendar::utc_of_gps(nanos) } else { nanos };
        let more = |part: Option<Part>| {
            part.map_or(Ok(0), |(k, unit)| time::parse(cell(k), unit).map(Time::nanos))
        };
        let nanos = match self.form {
            Form::Number(unit, None) => return Ok(time::parse(here, unit)? + self.offset),
            Form::Number(unit, part) => {
                let more = Span::from_nanos(more(part)?);
                return Ok(time::parse(here, unit)? + more + self.offset);
            }
            Form::Day => {
                let text = std::str::from_utf8(here).ok().and_then(time_of_day);
                let nanos = text.ok_or(TimeError::NotANumber)?;
                return Ok(Time::from_nanos(nanos) + self.offset);
            }
            Form::Since(unit, before, gps) => {
                let since = time::nanos(here, unit)? - before;
                utc(i64::try_from(since).map_err(|_| TimeError::TooLarge)?, gps)
            }
            Form::OfYear(([year, day], minute), gps) => {
                let number =
                    |k: usize| std::str::from_utf8(cell(k)).ok()?.trim().parse::<i32>().ok();
                let day = number(year).zip(number(day));
                let day = day.and_then(|(year, day)| dates::day_of_year(year, day));
                let minute = match minute {
                    Some([hour, minute]) => number(hour)
                        .zip(number(minute))
                        .filter(|(hour, minute)| (0..24).contains(hour) && (0..60).contains(minute))
                        .map(|(hour, minute)| i64::from(60 * hour + minute) * MINUTE),
                    None => Some(0),
                };
                let since = time::parse(here, 1_000_000_000)?.nanos();
                let minute = day.zip(minute).and_then(|(day, minute)| day.checked_add(minute));
                let minute = minute.ok_or(TimeError::NotANumber)?;
                utc(minute.checked_add(since).ok_or(TimeError::TooLarge)?, gps)
            }
            Form::Date(date, order, gps) => {
                let nanos = date_and_time(date.map(cell), here, order);
                utc(nanos.ok_or(TimeError::NotANumber)?, gps)
            }
            Form::Fields(fields, part, gps) => {
                let midnight = minute_of(fields.map(cell)).ok_or(TimeError::NotANumber)?;
                let since = time::parse(here, 1_000_000_000)?.nanos() + more(part)?;
                utc(midnight.checked_add(since).ok_or(TimeError::TooLarge)?, gps)
            }
            Form::Week(week, unit, gps) => {
                let week: i64 = std::str::from_utf8(cell(week))
                    .ok()
                    .and_then(|w| w.parse().ok())
                    .filter(|w| (0..=10_000).contains(w))
                    .ok_or(TimeError::NotANumber)?;
                let since = time::parse(here, unit)?.nanos();
                let nanos =
                    (GPS_ZERO + week * WEEK).checked_add(since).ok_or(TimeError::TooLarge)?;
                utc(nanos, gps)
            }
        };
        let time = nanos.checked_sub(self.origin).ok_or(TimeError::TooLarge)?;
        let inside = (Time::MIN.nanos()..Time::MAX.nanos()).contains(&time);
        if inside { Ok(Time::from_nanos(time) + self.offset) } else { Err(TimeError::TooLarge) }
    }
}

/// The unit in nanoseconds of a count since a date of its own, and the count's nanoseconds at the begin of 1970.
fn since(format: TimeFormat) -> Option<(u64, i128)> {
    let day = i128::from(DAY);
    match format {
        TimeFormat::Matlab => Some((DAY as u64, 719_529 * day)),
        TimeFormat::Excel => Some((DAY as u64, 25_569 * day)),
        TimeFormat::Julian => Some((DAY as u64, 4_881_175 * day / 2)),
        TimeFormat::ModifiedJulian => Some((DAY as u64, 40_587 * day)),
        TimeFormat::Dotnet => Some((100, 62_135_596_800 * SECOND)),
        TimeFormat::Filetime => Some((100, 11_644_473_600 * SECOND)),
        TimeFormat::Cocoa => Some((1_000_000_000, -978_307_200 * SECOND)),
        TimeFormat::Labview => Some((1_000_000_000, 2_082_844_800 * SECOND)),
        TimeFormat::Number | TimeFormat::DateTime | TimeFormat::TimeOfDay => None,
    }
}

/// The columns of year, month, day, hour and minute.
fn fields(
    given: &TimeColumn,
    text: impl Fn(&str) -> Result<usize, StreamError>,
) -> Result<[usize; 5], StreamError> {
    let mut columns = [0; 5];
    for (column, heading) in columns.iter_mut().zip(given.fields.iter().flatten()) {
        *column = text(heading)?;
    }
    Ok(columns)
}

/// Nanoseconds since 1970 of a minute, from the cells of its year, month, day, hour and minute.
fn minute_of(cells: [&[u8]; 5]) -> Option<i64> {
    let number = |k: usize| std::str::from_utf8(cells[k]).ok()?.parse::<u16>().ok();
    let small = |k: usize| u8::try_from(number(k)?).ok();
    let (year, month, day) = (i32::from(number(0)?), small(1)?, small(2)?);
    let (hour, minute) = (small(3)?, small(4)?);
    Calendar { year, month, day, hour, minute, second: 0, nanos: 0 }.unix_nanos()
}

/// Nanoseconds since midnight of a text such as `08:30:00.25`, `8:30:00.25 AM`, `083000.25` or `30:00.25`.
fn time_of_day(text: &str) -> Option<i64> {
    // pandas writes a span as `0 days 08:30:00.25`
    let (days, text) = text.split_once(" days ").unwrap_or(("0", text));
    let days = days.parse::<i64>().ok().filter(|days| (0..10_000).contains(days))?;
    // the checksum of a line stands behind its last cell
    let sum = |sum: &str| sum.len() == 2 && sum.bytes().all(|b| b.is_ascii_hexdigit());
    let text = text.split_once('*').filter(|(_, rest)| sum(rest)).map_or(text, |(text, _)| text);
    let (text, half) = of_twelve(text.as_bytes());
    let text = std::str::from_utf8(text).ok()?;
    let (hour, minute, seconds) = match text.split_once(':') {
        Some((hour, rest)) => {
            match rest.split_once(':') {
                Some((minute, seconds)) => (hour.parse().ok()?, minute.parse().ok()?, seconds),
                // minutes and seconds, as spreadsheets show them
                None if rest.contains('.') => (0, hour.parse().ok()?, rest),
                None => return None,
            }
        }
        None => {
            let digits = text.find('.').unwrap_or(text.len());
            let whole = text.get(..digits)?.parse::<u32>().ok().filter(|_| digits == 6)?;
            let [hour, minute] = [whole / 10_000, whole / 100 % 100].map(u8::try_from);
            (hour.ok()?, minute.ok()?, text.get(4..)?)
        }
    };
    let mut decimals = Short::default();
    decimals.push_time(seconds.as_bytes(), 1)?;
    let (second, nanos) = calendar::decimal_seconds(decimals.text())?;
    calendar::time_of_day(hour, minute, second, nanos).map(|time| days * DAY + half + time)
}

/// A time of the day without its `AM` or `PM`, and the nanoseconds that these add to it: half a day to one after
/// noon, and less half a day to one of the hour 12 before noon.
fn of_twelve(time: &[u8]) -> (&[u8], i64) {
    let time = time.trim_ascii();
    let Some((rest, [half, b'M' | b'm'])) = time.split_last_chunk::<2>() else { return (time, 0) };
    let (rest, twelve) = (rest.trim_ascii(), time.starts_with(b"12"));
    match (half, twelve) {
        (b'P' | b'p', false) => (rest, DAY / 2),
        (b'A' | b'a', true) => (rest, -DAY / 2),
        (b'P' | b'p' | b'A' | b'a', _) => (rest, 0),
        _ => (time, 0),
    }
}

/// A text of bounded length.
struct Short {
    bytes: [u8; LONGEST_DATE],
    length: usize,
}

impl Default for Short {
    fn default() -> Self {
        Self { bytes: [0; LONGEST_DATE], length: 0 }
    }
}

impl Short {
    fn text(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    /// Appends a time of the day whose seconds may have their decimals after one more colon than `colons`
    /// before them: `08:30:00:250`. Fewer than three digits may count frames of a film or hundredths. ISO 8601 permits a
    /// comma: `08:30:00,25`.
    fn push_time(&mut self, time: &[u8], colons: usize) -> Option<()> {
        let places = || time.iter().enumerate().filter(|(_, b)| **b == b':').map(|(at, _)| at);
        let digits = |at: &usize| time[at + 1..].iter().take_while(|b| b.is_ascii_digit()).count();
        let of_time = |at: &usize| time[..*at].iter().all(|b| b.is_ascii_digit() || *b == b':');
        let point = places().nth(colons - 1).filter(of_time);
        let comma = time.iter().position(|b| *b == b',').filter(of_time);
        let comma = comma.filter(|at| digits(at) > 0);
        match point.filter(|at| matches!(digits(at), 3 | 6 | 9)).or(comma) {
            Some(at) => {
                self.push(&time[..at])?;
                self.push(b".")?;
                self.push(&time[at + 1..])
            }
            None => self.push(time),
        }
    }

    fn push(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.length.checked_add(bytes.len())?;
        self.bytes.get_mut(self.length..end)?.copy_from_slice(bytes);
        self.length = end;
        Some(())
    }
}

/// Nanoseconds since 1970 of a date and a time of the day, in one text or in two.
fn date_and_time(date: Option<&[u8]>, time: &[u8], order: Order) -> Option<i64> {
    in_order(date, time, order).or_else(|| {
        let time = std::str::from_utf8(time).ok()?;
        let Some(date) = date.filter(|date| !date.is_empty()) else { return dates::date(time) };
        let date = std::str::from_utf8(date).ok()?;
        let of_digits = dates::day_of_digits(date, order).zip(time_of_day(time));
        let named = || dates::date(&format!("{date} {time}"));
        of_digits.map(|(day, time)| day + time).or_else(named)
    })
}

/// The same with separators between the parts of the date, in the order that is given.
fn in_order(date: Option<&[u8]>, time: &[u8], order: Order) -> Option<i64> {
    let (date, time) = match date.filter(|date| !date.is_empty()) {
        Some(date) => (date, time),
        None => {
            let at = time.iter().position(|b| matches!(b, b'T' | b' '))?;
            (&time[..at], &time[at + 1..])
        }
    };
    let mut parts = date.splitn(3, |b| matches!(b, b'-' | b'/' | b'.' | b':'));
    let [a, b, c] = [parts.next()?, parts.next()?, parts.next()?];
    let in_order = match order {
        Order::YearMonthDay => [a, b, c],
        Order::DayMonthYear => [c, b, a],
        Order::MonthDayYear => [c, a, b],
    };
    let mut text = Short::default();
    for (part, end) in in_order.into_iter().zip([b"-", b"-", b"T"]) {
        text.push(part)?;
        text.push(end)?;
    }
    let (time, half) = of_twelve(time);
    text.push_time(time.strip_suffix(b" UTC").unwrap_or(time), 3)?;
    let (nanos, has_time) = calendar::parse(std::str::from_utf8(text.text()).ok()?)?;
    has_time.then(|| nanos.checked_add(half)).flatten()
}
