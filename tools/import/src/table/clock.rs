//! The time of a table.

use super::columns::Table;
use super::content::increases;
use super::units::{self, Decided, Evidence, median, settle};
use super::vocabulary::Meaning;
use navfuse_core::document::quoted;
use std::ops::RangeInclusive;

/// Intervals, s, at which a program records: a unit that gives others is wrong.
const INTERVALS: RangeInclusive<f64> = 2e-5..=120.0;
/// The column of Xsens, which counts at 10 kHz.
const TICKS: (&str, &str) = ("SampleTimeFine", "100*us");

/// The time of a table.
pub struct Clock {
    /// Key of the source; `None` where it finds the column by itself.
    pub key: Option<String>,
    /// Times of the rows in s, NaN for dates in words.
    pub seconds: Vec<f64>,
    /// Questions about its unit.
    pub questions: Vec<String>,
}

impl Table<'_> {
    /// The column of the time: the first one that increases, in the order of the words for it.
    ///
    /// # Errors
    /// When there is none, or a time of the day has no date.
    pub(super) fn clock(&self, usual: f64) -> Result<Clock, String> {
        let mut times: Vec<&(usize, Meaning)> =
            self.columns.iter().filter(|(_, m)| m.channel == "time").collect();
        times.sort_by_key(|(k, m)| (!self.usual(*k, "time"), m.rank));
        let cell = |k: usize| self.layout.rows.first().and_then(|r| r.get(k)).map_or("", |c| c);
        let in_words = |k: usize| cell(k).contains(':');
        let counts = |k: usize| self.layout.rows.len() < 3 || increases(&self.layout.column(k));
        let found = times.iter().find(|(k, _)| in_words(*k) || counts(*k)).or(times.first());
        match found {
            Some((k, _)) if in_words(*k) => self.date(*k, cell(*k)),
            Some((k, meaning)) => Ok(self.number(*k, meaning, usual)),
            None => {
                let list = self.listed();
                Err(format!("no column of the time among {list}; name it time_s"))
            }
        }
    }

    /// A time that is a number.
    fn number(&self, k: usize, meaning: &Meaning, usual: f64) -> Clock {
        let (heading, values) = (self.heading(k), self.layout.column(k));
        let stated =
            meaning.unit.clone().or_else(|| heading.contains(TICKS.0).then(|| TICKS.1.to_owned()));
        let assumed =
            || Decided { unit: "s".to_owned(), why: "no row".to_owned(), evidence: Evidence::None };
        let shown = units::time(&values, usual).unwrap_or_else(assumed);
        let step = median(values.windows(2).map(|v| v[1] - v[0]));
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
        let seconds = values.iter().map(|t| t * factor).collect();
        Clock { key: (!own).then_some(key), seconds, questions }
    }

    /// A time that is written as a date, or as a time of the day beside a date.
    fn date(&self, k: usize, cell: &str) -> Result<Clock, String> {
        let heading = quoted(self.heading(k));
        let key = if cell.contains(['-', '/']) {
            format!("time = {{ column = {heading}, format = \"date-time\" }}")
        } else if let Some((date, _)) = self.find("date") {
            let date = quoted(self.heading(*date));
            format!("time = {{ column = {heading}, date = {date} }}")
        } else {
            return Err(format!(
                "the time {heading} has no date (its first value is {cell:?}), and no column is \
                 named `date`"
            ));
        };
        let seconds = vec![f64::NAN; self.layout.rows.len()];
        Ok(Clock { key: Some(key), seconds, questions: Vec::new() })
    }
}
