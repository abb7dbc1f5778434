//! The time of a table.

use super::columns::Table;
use super::content::increases;
use super::units::{self, Decided, Evidence, settle};
use super::vocabulary::{Meaning, words};
use navfuse_core::document::quoted;
use std::ops::RangeInclusive;

/// Intervals, s, at which a program records: a unit that gives others is wrong.
const INTERVALS: RangeInclusive<f64> = 2e-5..=120.0;
/// What is asked of dates whose order they do not show.
pub const GUESSED: &str = "is a guess";
/// The column of Xsens, which counts at 10 kHz in an MTi and in microseconds in a DOT, and an interval that no IMU has, s.
const TICKS: (&str, &str) = ("SampleTimeFine", "100*us");
const SLOW: f64 = 0.5;

/// Share of the steps of a clock that are near the usual one, and the part of it by which they differ.
const EVEN: f64 = 0.9;
const NEAR: f64 = 0.25;
/// Words for whole seconds, and for the nanoseconds beside them.
const SECONDS: [&str; 4] = ["sec", "secs", "seconds", "s"];
const NANOS: [&str; 6] = ["nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds", "ns"];
/// Counts since a date with the ranges of the years from 1990 to 2050, their unit, s, and the date of their zero.
const SINCE: [(&str, RangeInclusive<f64>, f64, &str); 7] = [
    ("excel", 32_874.0..=54_789.0, DAY, "1899-12-30"),
    ("modified-julian", 54_790.0..=69_807.0, DAY, "1858-11-17"),
    ("matlab", 726_834.0..=748_749.0, DAY, "the year 0"),
    ("julian", 2_447_892.0..=2_469_808.0, DAY, "noon of 4713 BC"),
    ("filetime", 1.227e17..=1.418e17, 1e-7, "1601"),
    ("dotnet", 6.276e17..=6.468e17, 1e-7, "the year 1"),
    ("labview", 2.713e9..=4.607e9, 1.0, "1904"),
];
/// The word for days that have the range of those of Excel, and their form.
const MODIFIED: (&str, &str) = ("mjd", "modified-julian");
/// Words for a column that counts the rows.
const COUNTERS: [&str; 9] =
    ["sample", "samples", "index", "counter", "count", "row", "frame", "no", "number"];
/// Periods of the parts of a larger unit: hours, minutes and seconds, and thousandths, millionths and billionths. Numbers
/// that reach the second part of a period and start again are no clock.
const PERIODS: [f64; 5] = [24.0, 60.0, 1e3, 1e6, 1e9];
const REACHED: f64 = 0.4;
/// Seconds of a minute, of a day and of a week.
const MINUTE: f64 = 60.0;
pub(super) const DAY: f64 = 86_400.0;
const WEEK: f64 = 604_800.0;

/// The time of a table.
pub struct Clock {
    /// Key of the source; `None` where it finds the column by itself.
    pub key: Option<String>,
    /// Times of the rows in s, NaN for dates in words.
    pub seconds: Vec<f64>,
    /// Questions about its unit.
    pub questions: Vec<String>,
}

impl Clock {
    /// Tests whether most rows have the time of the row before.
    pub fn is_shared(&self) -> bool {
        let times: Vec<f64> = self.seconds.iter().copied().filter(|t| t.is_finite()).collect();
        let same = times.windows(2).filter(|t| t[0] == t[1]).count();
        times.len() > 2 && 2 * same > times.len()
    }

    /// The interval between the times that rows share, s: each may be the begin of its rows or their end. Zero for whole
    /// seconds, which a program cuts off.
    pub fn burst(&self) -> f64 {
        let whole = self.seconds.iter().all(|t| !t.is_finite() || (t - t.round()).abs() < 1e-6);
        let steps = self.seconds.windows(2).map(|t| t[1] - t[0]).filter(|step| *step > 0.0);
        if whole { 0.0 } else { units::median(steps) }
    }
}

impl Table<'_> {
    /// The time: a date whose parts have columns of their own, seconds with nanoseconds beside them,
    /// or the first column that increases, in the order of the words for it.
    ///
    /// # Errors
    /// When there is none.
    pub(super) fn clock(&self, usual: f64) -> Result<Clock, String> {
        let parts = self.fields().or_else(|| self.with_nanos()).or_else(|| self.of_year());
        if let Some(clock) = parts {
            return Ok(clock);
        }
        let cell = |k: usize| self.layout.rows.first().and_then(|r| r.get(k)).map_or("", |c| c);
        let in_words = |k: usize| cell(k).contains(':') || navfuse_csv::date(cell(k)).is_some();
        let counts = |k: usize| self.layout.rows.len() < 3 || increases(&self.layout.column(k));
        let read = |(k, meaning): &(usize, Meaning)| match in_words(*k) {
            true => self.date(*k, cell(*k)),
            false => self.number(*k, meaning, usual),
        };
        let rises = |clock: &Clock| self.layout.rows.len() < 3 || increases(&clock.seconds);
        let whole = |(k, _): &&(usize, Meaning)| !starts_again(&self.layout.column(*k));
        let named = |name| self.columns.iter().filter(move |(_, m)| m.channel == name);
        let named = |name| named(name).filter(whole);
        let mut times: Vec<&(usize, Meaning)> = named("time").collect();
        if times.is_empty() {
            times.extend(named("date").filter(|(k, _)| in_words(*k) || counts(*k)));
        }
        times.sort_by_key(|(k, m)| (!self.usual(*k, "time"), m.rank));
        // of two clocks the one that tells the rows apart
        let found = times.iter().map(|time| read(time)).find(rises);
        match (found, times.first()) {
            (Some(clock), _) => Ok(clock),
            (None, Some(first)) => Ok(self.even(usual).unwrap_or_else(|| read(first))),
            (None, None) => self.unnamed(usual),
        }
    }

    /// A column without a known heading that increases in even steps and does not count the rows, beside times that many
    /// rows share.
    fn even(&self, usual: f64) -> Option<Clock> {
        let steps = |k: &usize| {
            let values = self.layout.column(*k);
            let steps: Vec<f64> = values.windows(2).map(|v| v[1] - v[0]).collect();
            let middle = units::median(steps.iter().copied());
            let near = steps.iter().filter(|s| (*s / middle - 1.0).abs() < NEAR).count();
            middle > 0.0 && middle != 1.0 && near as f64 >= EVEN * steps.len() as f64
        };
        let free = |k: &usize| self.columns.iter().all(|(used, _)| used != k);
        let k = (0..self.layout.width()).filter(free).find(steps)?;
        let meaning = Meaning { channel: "time", unit: None, sign: 1.0, rank: 0 };
        let mut clock = self.number(k, &meaning, usual);
        let question = format!("the column {} is taken for the time", self.heading(k));
        clock.questions.push(question);
        Some(clock)
    }

    /// A column without a known heading that increases from row to row, or holds dates.
    fn unnamed(&self, usual: f64) -> Result<Clock, String> {
        let free = |k: &usize| {
            self.columns.iter().all(|(used, _)| used != k) && !starts_again(&self.layout.column(*k))
        };
        let cell = |k: usize| self.layout.rows.first().and_then(|r| r.get(k)).map_or("", |c| c);
        let columns = || (0..self.layout.width()).filter(free);
        let dated = columns().find(|k| {
            matches!(cell(*k).matches(':').count(), 2 | 3) || navfuse_csv::date(cell(*k)).is_some()
        });
        let rising = || columns().find(|k| increases(&self.layout.column(*k)));
        let found = dated.or_else(rising);
        if let Some(k) = found.filter(|k| counts_rows(self.heading(*k), &self.layout.column(*k))) {
            if let Some(rate) = self.layout.rate {
                return Ok(self.counted(k, rate));
            }
            return Err(format!(
                "no column of the time, and {} counts the rows: write a scenario with \
                 `time = {{ column = {}, unit = \"10*ms\" }}` for rows at 100 Hz, or a column time_s into \
                 the file",
                self.heading(k),
                quoted(self.heading(k))
            ));
        }
        let Some(k) = found else {
            let list = self.listed();
            return Err(format!("no column of the time among {list}; name it time_s"));
        };
        let meaning = Meaning { channel: "time", unit: None, sign: 1.0, rank: 0 };
        let mut clock = match dated {
            Some(k) => self.date(k, cell(k)),
            None => self.number(k, &meaning, usual),
        };
        clock.questions.push(format!("the column {} is taken for the time", self.heading(k)));
        Ok(clock)
    }

    /// The time by a column that counts the rows, and the rate above the table.
    fn counted(&self, k: usize, rate: f64) -> Clock {
        let key = format!(
            "time = {{ column = {}, unit = \"{}*us\" }}",
            quoted(self.heading(k)),
            1e6 / rate
        );
        let seconds = self.layout.column(k).iter().map(|count| count / rate).collect();
        let question = format!(
            "{} counts the rows, and a line above them has their rate, {rate} Hz",
            self.heading(k)
        );
        Clock { key: Some(key), seconds, questions: vec![question] }
    }

    /// The column whose heading ends with one of these words, the rest of it being `stem`.
    pub(super) fn ending(
        &self,
        ends: &[&str],
        stem: Option<&[String]>,
    ) -> Option<(usize, Vec<String>)> {
        self.layout.headings.iter().enumerate().find_map(|(k, heading)| {
            let mut words = words(heading);
            let last = words.pop()?;
            let fits = ends.contains(&last.as_str()) && stem.is_none_or(|stem| stem == words);
            fits.then_some((k, words))
        })
    }

    /// Whole seconds with the nanoseconds in a column of their own.
    fn with_nanos(&self) -> Option<Clock> {
        let (nanos, stem) = self.ending(&NANOS, None)?;
        let (seconds, _) = self.ending(&SECONDS, Some(&stem))?;
        let (whole, parts) = (self.layout.column(seconds), self.layout.column(nanos));
        let fits =
            whole.iter().all(|t| t.fract() == 0.0) && parts.iter().all(|n| (0.0..1e9).contains(n));
        let [column, nanos] = [seconds, nanos].map(|k| quoted(self.heading(k)));
        let key = format!("time = {{ column = {column}, unit = \"s\", nanos = {nanos} }}");
        let seconds = whole.iter().zip(&parts).map(|(t, n)| t + 1e-9 * n).collect();
        fits.then_some(Clock { key: Some(key), seconds, questions: Vec::new() })
    }

    /// A time that counts since a date, by its range and its interval.
    fn since(&self, heading: &str, values: &[f64], usual: f64) -> Option<Clock> {
        let step = units::step(values);
        let near = |step: f64| (step / usual).ln().abs();
        let last = values.iter().rev().find(|v| v.is_finite())?;
        let fits = |unit: f64| {
            let other = if unit == DAY { near(step) } else { f64::INFINITY };
            INTERVALS.contains(&(step * unit)) && near(step * unit) < other
        };
        let found = |(_, range, unit, _): &&(&str, RangeInclusive<f64>, f64, &str)| {
            range.contains(last) && fits(*unit)
        };
        let (format, _, unit, zero) = SINCE.iter().find(found)?;
        let (word, modified) = MODIFIED;
        let format = if words(heading).iter().any(|w| w == word) { modified } else { *format };
        let question = format!("the time {heading} counts since {zero}, by its range ({format})");
        let key = format!("time = {{ column = {}, format = \"{format}\" }}", quoted(heading));
        let seconds = values.iter().map(|t| (t - last) * unit).collect();
        Some(Clock { key: Some(key), seconds, questions: vec![question] })
    }

    /// A time of the day as one number, hhmmss: six digits of which no hour, minute or second is too large, in a column
    /// of UTC, in a sentence of NMEA, with a zero before the first hour, or with a jump from one minute to the next.
    fn packed(&self, k: usize, values: &[f64]) -> Option<Clock> {
        let second = |v: f64| {
            let parts = [(v / 1e4).floor(), (v / 100.0).floor() % 100.0, v % 100.0];
            let [hour, minute, second] = parts;
            let fits = hour < 24.0 && minute < 60.0 && second < 60.0 && hour >= 0.0;
            fits.then_some((hour * 60.0 + minute) * 60.0 + second)
        };
        let seconds: Vec<f64> = values.iter().map(|v| second(*v)).collect::<Option<_>>()?;
        let cells = || self.layout.rows.iter().filter_map(|row| row.get(k));
        let digits = |cell: &str| cell.split('.').next().map_or(0, str::len);
        let jump = |values: &[f64]| values.windows(2).map(|v| v[1] - v[0]).fold(0.0, f64::max);
        let utc =
            words(self.heading(k)).iter().any(|word| ["utc", "hhmmss"].contains(&word.as_str()))
                || self.beside_digits(k).is_some();
        let sentence = self.layout.kind.iter().any(|(_, kind)| kind.starts_with('$'));
        let evident = utc
            || sentence
            || cells().any(|cell| cell.starts_with('0'))
            || (jump(values) > 40.0 && jump(&seconds) < 40.0);
        if !evident || !cells().all(|cell| digits(cell) == 6) {
            return None;
        }
        let heading = self.heading(k);
        if let Some((key, question)) = self.beside_digits(k) {
            let questions = question.into_iter().collect();
            return Some(Clock { key: Some(key), seconds, questions });
        }
        let question =
            format!("the time {heading} is one of the day, hhmmss: it counts from midnight");
        let key = format!("time = {{ column = {}, format = \"time-of-day\" }}", quoted(heading));
        Some(Clock { key: Some(key), seconds, questions: vec![question] })
    }

    /// The column of the date that is nearest to the one of a time of the day.
    fn date_beside(&self, time: usize) -> Option<usize> {
        let dates = self.columns.iter().filter(|(_, m)| m.channel == "date").map(|(k, _)| *k);
        dates.min_by_key(|k| k.abs_diff(time))
    }

    /// The key of a time of the day beside a date of digits alone, `20231114` or `141123`, and a question.
    fn beside_digits(&self, k: usize) -> Option<(String, Option<String>)> {
        let date = self.date_beside(k)?;
        let cells = || self.layout.rows.iter().filter_map(|row| row.get(date));
        let digits = |count: usize| {
            cells().all(|c| c.len() == count && c.bytes().all(|b| b.is_ascii_digit()))
        };
        let [column, heading] = [self.heading(k), self.heading(date)].map(quoted);
        let key = |order: &str| format!("time = {{ column = {column}, date = {heading}{order} }}");
        let part = |from: usize| cells().filter_map(move |c| c.get(from..from + 2)?.parse().ok());
        let most = |from: usize| part(from).max().unwrap_or(0_u8);
        match () {
            () if digits(8) => Some((key(""), None)),
            // days of NMEA 0183, unless no day is possible
            () if digits(6) && most(0) <= 31 && most(2) <= 12 => {
                let text = format!("the order of the dates in {} {GUESSED}", self.heading(date));
                Some((key(", order = \"day-month-year\""), Some(text)))
            }
            () if digits(6) => Some((key(""), None)),
            () => None,
        }
    }

    /// A time that is a number.
    pub(super) fn number(&self, k: usize, meaning: &Meaning, usual: f64) -> Clock {
        let (heading, values) = (self.heading(k), self.layout.column(k));
        let clock = self.since(heading, &values, usual).or_else(|| self.packed(k, &values));
        if let Some(clock) = clock {
            return clock;
        }
        let whole = values.windows(2).filter(|t| t[0] == t[1]).count() * 2 > values.len();
        if let Some((part, unit)) = self.part(&values).filter(|_| whole) {
            let [column, nanos] = [heading, self.heading(part)].map(quoted);
            let key = format!(
                "time = {{ column = {column}, unit = \"s\", nanos = {nanos}, nanos_unit = \"{unit}\" }}"
            );
            let parts = self.layout.column(part);
            let seconds = values.iter().zip(parts).map(|(t, p)| t + p * units::factor(unit));
            let (seconds, questions) = (seconds.collect(), Vec::new());
            return Clock { key: Some(key), seconds, questions };
        }
        // rows of other sensors have no time
        let own: Vec<f64> = values.iter().copied().filter(|t| t.is_finite()).collect();
        let step = units::step(&own);
        let ticks = heading.replace([' ', '_'], "").contains(TICKS.0)
            && step * units::factor(TICKS.1) < SLOW;
        let stated = meaning.unit.clone().or_else(|| ticks.then(|| TICKS.1.to_owned()));
        let assumed =
            || Decided { unit: "s".to_owned(), why: "no row".to_owned(), evidence: Evidence::None };
        let shown = units::time(&own, usual).unwrap_or_else(assumed);
        let absurd = |unit: &String| {
            let step = step * units::factor(unit);
            !step.is_nan() && !INTERVALS.contains(&step)
        };
        let contradicted =
            shown.evidence == Evidence::Strong || stated.as_ref().is_some_and(absurd);
        let mut questions = Vec::new();
        let subject = format!("the time {heading}");
        let unit = settle(&subject, stated, shown, contradicted, &mut questions);
        let own = self.usual(k, "time") && meaning.unit.as_ref() == Some(&unit);
        let key = format!("time = {{ column = {}, unit = {} }}", quoted(heading), quoted(&unit));
        let factor = units::factor(&unit);
        let seconds: Vec<f64> = values.iter().map(|t| t * factor).collect();
        let name = words(heading).concat();
        let of_week = ["tow", "sow", "week", "gps"].iter().any(|word| name.contains(word))
            && seconds.iter().all(|t| (0.0..=WEEK).contains(t));
        let week = self.find("week").filter(|_| of_week);
        if let Some((week, _)) = week {
            let (heading, unit, week) =
                (quoted(heading), quoted(&unit), quoted(self.heading(*week)));
            let key = format!("time = {{ column = {heading}, unit = {unit}, week = {week} }}");
            return Clock { key: Some(key), seconds, questions };
        }
        Clock { key: (!own).then_some(key), seconds, questions }
    }

    /// A time that is written as a date, or as a time of the day, which may stand beside a date.
    fn date(&self, k: usize, cell: &str) -> Clock {
        let heading = quoted(self.heading(k));
        let cells = |k: usize| self.layout.rows.iter().filter_map(move |row| row.get(k));
        let mut questions = Vec::new();
        if navfuse_csv::date(cell).is_some() {
            let key = format!("time = {{ column = {heading}, format = \"date-time\" }}");
            let seconds = cells(k).map(|cell| second_of_text(cell)).collect();
            return Clock { key: Some(key), seconds, questions };
        }
        let seconds = cells(k).map(|cell| second_of_day(cell)).collect();
        let mut order = |k: usize| match order(cells(k).map(String::as_str)) {
            (order, true) => order,
            (order, false) => {
                questions.push(format!("the order of the dates in {} {GUESSED}", self.heading(k)));
                order
            }
        };
        // a date has two separators before its time of the day
        let first = cell.split([' ', 'T']).next().unwrap_or_default();
        let dated = ['-', '/', '.'].iter().any(|c| first.matches(*c).count() == 2);
        let key = if dated {
            format!("time = {{ column = {heading}, format = \"date-time\"{} }}", order(k))
        } else if let Some(date) = self.date_beside(k) {
            let (order, date) = (order(date), quoted(self.heading(date)));
            format!("time = {{ column = {heading}, date = {date}{order} }}")
        } else {
            questions.push(format!("the time {heading} has no date: it counts from midnight"));
            format!("time = {{ column = {heading}, format = \"time-of-day\" }}")
        };
        Clock { key: Some(key), seconds, questions }
    }
}

/// Tests whether a column has the part of a larger unit: its numbers start again and again within a period, or fall once
/// from the end of a minute to its beginning, which no clock does.
fn starts_again(values: &[f64]) -> bool {
    let minute = |v: &&[f64]| {
        let [before, after] = [v[0], v[1]];
        (MINUTE - 1.0..MINUTE).contains(&before) && (0.0..1.0).contains(&after)
    };
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most < MINUTE && values.windows(2).any(|v| minute(&v)) {
        return true;
    }
    let largest = values.iter().copied().fold(0.0, f64::max);
    let within = |period: &f64| (REACHED * period..*period).contains(&largest);
    PERIODS.iter().find(|period| within(period)).is_some_and(|period| {
        let falls = values.windows(2).filter(|v| v[0] - v[1] > 0.5 * REACHED * period);
        falls.count() > 1
    })
}

/// Tests whether a column counts the rows by its heading.
pub fn counts_rows(heading: &str, values: &[f64]) -> bool {
    let named = words(heading).iter().any(|word| COUNTERS.contains(&word.as_str()));
    named && values.windows(2).all(|v| v[1] - v[0] == 1.0)
}

/// The seconds since midnight of a text with a time of the day, or a date; NaN for another one.
pub fn second_of_text(cell: &str) -> f64 {
    let of_date = |nanos: i64| (nanos % (DAY * 1e9) as i64) as f64 * 1e-9;
    navfuse_csv::date(cell).map_or_else(|| second_of_day(cell), of_date)
}

/// The seconds since midnight of a text with a time of the day; NaN for another one.
fn second_of_day(cell: &str) -> f64 {
    let time = cell.split([' ', 'T']).find(|part| part.contains(':')).unwrap_or_default();
    let time = time.split(['Z', '+', '-']).next().unwrap_or_default();
    let parts: Vec<f64> =
        time.split(':').map(|p| p.replace(',', ".").parse().unwrap_or(f64::NAN)).collect();
    match *parts.as_slice() {
        [hour, minute, second] => (hour * 60.0 + minute) * 60.0 + second,
        // as spreadsheets show minutes
        [minute, second] if time.contains(['.', ',']) => minute * 60.0 + second,
        // milliseconds after a third colon
        [hour, minute, second, milli] => (hour * 60.0 + minute) * 60.0 + second + 1e-3 * milli,
        _ => f64::NAN,
    }
}

/// The key for the order of dates, and `false` where the dates do not show it.
fn order<'a>(cells: impl Iterator<Item = &'a str>) -> (&'static str, bool) {
    let mut largest = [0_u32; 2];
    let mut separator = None;
    for cell in cells {
        let mut parts = cell.splitn(3, ['-', '/', '.', ':']);
        separator = cell.find(['-', '/', '.']).and_then(|at| cell[at..].chars().next());
        for largest in &mut largest {
            *largest = (*largest).max(parts.next().and_then(|p| p.parse().ok()).unwrap_or(0));
        }
    }
    match (largest, separator) {
        ([first, _], _) if first > 31 => ("", true),
        (_, Some('.')) => (", order = \"day-month-year\"", true),
        ([first, _], _) if first > 12 => (", order = \"day-month-year\"", true),
        ([_, second], _) if second > 12 => (", order = \"month-day-year\"", true),
        _ => (", order = \"month-day-year\"", false),
    }
}
