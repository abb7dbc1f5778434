//! The columns of the time: a number, a date, or a week of GPS.

use crate::config::{FileConfig, Scale, TimeFormat};
use crate::headings::Wanted;
use crate::time::{self, TimeError};
use csv::ByteRecord;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::calendar::{self, GPS_ZERO, WEEK};
use navfuse_core::units::time::{Span, Time};

/// Longest text of a date with a time of the day.
const LONGEST_DATE: usize = 48;

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

/// The content of the columns.
enum Form {
    /// A number in this unit, in nanoseconds.
    Number(u64),
    /// A date with a time of the day; the date may stand in a column of its own. With `true` on the
    /// scale of GPS.
    Date(Option<usize>, bool),
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
        let contradicts = |what: &str| Err(StreamError::scenario(format!("{key}.{what}")));
        let gps = given.scale == Some(Scale::Gps);
        let (column, form) = match (&given.week, &given.date, given.format) {
            (Some(_), Some(_), _) => {
                return contradicts("week: a time has a week or a date; remove one of them");
            }
            (Some(_), _, TimeFormat::DateTime) => {
                return contradicts("week: the time of a week is a number; remove `format`");
            }
            (Some(week), None, TimeFormat::Number) => {
                let (column, unit) = number()?;
                (column, Form::Week(text(week)?, unit, given.scale != Some(Scale::Utc)))
            }
            (None, date, format) if date.is_some() || format == TimeFormat::DateTime => {
                if given.unit.is_some() {
                    return contradicts("unit: a date has no unit; remove it");
                }
                let date = date.as_deref().map(text).transpose()?;
                (text(given.column.as_deref().unwrap_or("time"))?, Form::Date(date, gps))
            }
            _ if given.scale.is_some() || given.origin.is_some() => {
                return contradicts(
                    "scale, origin: a number has no date; set `offset`, or format = \"date-time\"",
                );
            }
            _ => {
                let (column, unit) = number()?;
                (column, Form::Number(unit))
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
        let second = match self.form {
            Form::Number(_) => None,
            Form::Date(date, _) => date,
            Form::Week(week, ..) => Some(week),
        };
        self.column == column || second == Some(column)
    }

    /// The form of the time, for a message.
    pub fn needs(&self) -> &'static str {
        match self.form {
            Form::Number(_) | Form::Week(..) => "a decimal number is needed",
            Form::Date(..) => "a date such as 2022-06-01T08:30:00.25Z is needed",
        }
    }

    /// The time of a row.
    ///
    /// # Errors
    /// When a cell is no time, or the time is too far from zero.
    pub fn of(&self, record: &ByteRecord) -> Result<Time, TimeError> {
        let cell = |column: usize| record.get(column).unwrap_or_default().trim_ascii();
        let here = cell(self.column);
        let nanos = match self.form {
            Form::Number(unit) => return Ok(time::parse(here, unit)? + self.offset),
            Form::Date(date, gps) => {
                let nanos = date_and_time(date.map(cell), here).ok_or(TimeError::NotANumber)?;
                if gps { calendar::utc_of_gps(nanos) } else { nanos }
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
                if gps { calendar::utc_of_gps(nanos) } else { nanos }
            }
        };
        let time = nanos.checked_sub(self.origin).ok_or(TimeError::TooLarge)?;
        let inside = (Time::MIN.nanos()..Time::MAX.nanos()).contains(&time);
        if inside { Ok(Time::from_nanos(time) + self.offset) } else { Err(TimeError::TooLarge) }
    }
}

/// Nanoseconds since 1970 of a date and a time of the day, in one text or in two.
fn date_and_time(date: Option<&[u8]>, time: &[u8]) -> Option<i64> {
    let mut text = [0; LONGEST_DATE];
    let date = date.unwrap_or_default();
    let separator: &[u8] = if date.is_empty() { b"" } else { b" " };
    let bytes = date.iter().chain(separator).chain(time);
    let mut length = 0;
    for byte in bytes {
        *text.get_mut(length)? = if *byte == b'/' { b'-' } else { *byte };
        length += 1;
    }
    let (nanos, has_time) = calendar::parse(std::str::from_utf8(&text[..length]).ok()?)?;
    has_time.then_some(nanos)
}
