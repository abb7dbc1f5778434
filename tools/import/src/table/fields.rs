//! Dates whose year, month, day, hour, minute and second have columns of their own.

use super::clock::{Clock, DAY};
use super::columns::Table;
use super::content::increases;
use super::units;
use super::vocabulary::{Meaning, words};
use navfuse_core::document::quoted;
use std::ops::RangeInclusive;

/// Words for the parts of a date that stand in columns of their own.
const FIELDS: [&[&str]; 6] = [
    &["year", "yyyy", "jahr"],
    &["month", "mon", "monat"],
    &["day", "tag"],
    &["hour", "hours", "hh", "stunde"],
    &["minute", "minutes", "min", "mm"],
    &["second", "seconds", "sec", "ss", "s", "sekunde"],
];
/// More words for hour, minute and second behind a day of the year.
const OF_DAY: [&[&str]; 3] = [&["hr", "h"], &["m", "mn"], &["sss", "sssss", "ssss", "ssfff"]];
/// Words for the part of a second beside the fields of a date, with its unit.
const PARTS: [(&[&str], &str); 3] = [
    (&["nano", "nanos", "nsec", "nsecs", "nanosec", "nanosecond", "nanoseconds", "ns"], "ns"),
    (&["micro", "micros", "usec", "microsec", "microsecond", "microseconds", "us"], "us"),
    (&["milli", "millis", "msec", "millisec", "millisecond", "milliseconds", "ms"], "ms"),
];
/// Years, months, days, hours, minutes and seconds of a date.
const RANGES: [RangeInclusive<f64>; 6] =
    [1980.0..=2100.0, 1.0..=12.0, 1.0..=31.0, 0.0..=23.0, 0.0..=59.0, 0.0..=60.999];
/// The places of year, month and day in the orders of dates.
const ORDERS: [[usize; 3]; 3] = [[0, 1, 2], [2, 1, 0], [2, 0, 1]];

/// Number of pairs of rows of one second in which values increase, and of all such pairs.
fn rises(seconds: &[f64], values: &[f64]) -> [usize; 2] {
    let pairs = || seconds.windows(2).zip(values.windows(2)).filter(|(s, _)| s[0] == s[1]);
    [pairs().filter(|(_, v)| v[1] > v[0]).count(), pairs().count()]
}

impl Table<'_> {
    /// A date whose year, month, day, hour, minute and second have columns of their own, with a part of the second beside
    /// them where the seconds are whole; `None` where another column is finer.
    pub(super) fn fields(&self) -> Option<Clock> {
        let columns = self.named_fields().or_else(|| self.fields_by_content())?;
        let values = columns.map(|k| self.layout.column(k));
        let number = values.iter().all(|v| v.first().is_some_and(|v| v.is_finite()));
        let [_, _, _, hours, minutes, seconds] = &values;
        let repeats = seconds.windows(2).filter(|s| s[0] == s[1]).count() * 2 > seconds.len();
        let part = || self.part(seconds).or_else(|| self.part_behind(columns[5]));
        let part = repeats.then(part).flatten();
        if !number || (repeats && part.is_none() && self.rises_besides(&columns)) {
            return None;
        }
        let parts = part.map(|(k, unit)| (self.layout.column(k), units::factor(unit)));
        let more = |k: usize| parts.as_ref().map_or(0.0, |(values, unit)| values[k] * unit);
        let second = |k: usize| (hours[k] * 60.0 + minutes[k]) * 60.0 + seconds[k] + more(k);
        let names = columns.map(|k| quoted(self.heading(k)));
        let beside = part.map_or_else(String::new, |(k, unit)| {
            let unit =
                if unit == "ns" { String::new() } else { format!(", nanos_unit = \"{unit}\"") };
            format!(", nanos = {}{unit}", quoted(self.heading(k)))
        });
        let fields = names[..5].join(", ");
        let key = format!("time = {{ column = {}, fields = [{fields}]{beside} }}", names[5]);
        let seconds = (0..hours.len()).map(second).collect();
        Some(Clock { key: Some(key), seconds, questions: Vec::new() })
    }

    /// The year and the day of the year in columns of their own, beside the seconds of the day, or beside hour, minute and
    /// the seconds of the minute.
    pub(super) fn of_year(&self) -> Option<Clock> {
        let all = |names: &[&str], range: RangeInclusive<f64>| {
            let named = |h: &String| names.contains(&words(h).concat().as_str());
            let k = self.layout.headings.iter().position(named)?;
            self.layout.column(k).iter().all(|v| range.contains(v)).then_some(k)
        };
        let year = all(&["year", "yyyy", "yr"], RANGES[0].clone())?;
        let day =
            all(&["doy", "ddd", "dayofyear", "yearday", "yday", "jday", "julianday"], 1.0..=366.0)?;
        let [hour, minute, second] = [3, 4, 5].map(|field| {
            let names = [FIELDS[field], OF_DAY[field - 3]].concat();
            all(&names, RANGES[field].clone())
        });
        let (names, column, seconds): (Vec<usize>, _, _) = match hour.zip(minute).zip(second) {
            Some(((hour, minute), second)) => {
                let [hours, minutes, seconds] =
                    [hour, minute, second].map(|k| self.layout.column(k));
                let of = |k: usize| (hours[k] * 60.0 + minutes[k]) * 60.0 + seconds[k];
                (vec![year, day, hour, minute], second, (0..hours.len()).map(of).collect())
            }
            None => {
                let words = ["sod", "secondsofday", "secofday", "seconds", "sec", "time"];
                let seconds = all(&words, 0.0..=DAY)?;
                (vec![year, day], seconds, self.layout.column(seconds))
            }
        };
        let names: Vec<String> = names.into_iter().map(|k| quoted(self.heading(k))).collect();
        let key = format!(
            "time = {{ column = {}, of_year = [{}] }}",
            quoted(self.heading(column)),
            names.join(", ")
        );
        Some(Clock { key: Some(key), seconds, questions: Vec::new() })
    }

    /// The columns of the fields of a date, by their words.
    fn named_fields(&self) -> Option<[usize; 6]> {
        let (mut columns, mut before) = ([0; 6], None);
        for (column, names) in columns.iter_mut().zip(FIELDS) {
            let (k, stem) = self.ending(names, before.as_deref())?;
            (*column, before) = (k, Some(stem));
        }
        Some(columns)
    }

    /// The same in any language: six columns beside each other with the ranges of a date that shows its order.
    fn fields_by_content(&self) -> Option<[usize; 6]> {
        let range = |k: usize, field: usize| {
            let values = self.layout.column(k);
            let whole = |v: &f64| field == 5 || v.fract() == 0.0;
            !values.is_empty() && values.iter().all(|v| RANGES[field].contains(v) && whole(v))
        };
        let changes = |k: usize| self.layout.column(k).windows(2).any(|v| v[0] != v[1]);
        let of = |first: usize| {
            let dates = ORDERS.map(|order| order.map(|k| first + k));
            let mut dates = dates.into_iter().filter(|d| (0..3).all(|f| range(d[f], f)));
            let [year, month, day] = dates.next().filter(|_| dates.next().is_none())?;
            let times = (3..6).all(|f| range(first + f, f)) && changes(first + 5);
            times.then_some([year, month, day, first + 3, first + 4, first + 5])
        };
        (0..self.layout.width().saturating_sub(5)).find_map(of)
    }

    /// The column behind the seconds with their part, and its unit: the shortest period that its numbers reach.
    fn part_behind(&self, seconds: usize) -> Option<(usize, &'static str)> {
        let (whole, values) = (self.layout.column(seconds), self.layout.column(seconds + 1));
        let largest = values.iter().copied().fold(0.0, f64::max);
        let (_, unit) = PARTS.iter().rev().find(|(_, unit)| largest * units::factor(unit) < 1.0)?;
        let positive = values.iter().all(|v| *v >= 0.0 && v.fract() == 0.0);
        let [rises, all] = rises(&whole, &values);
        (positive && rises == all && all > 0).then_some((seconds + 1, *unit))
    }

    /// The column with the part of whole seconds, and its unit: it increases within a second.
    pub(super) fn part(&self, seconds: &[f64]) -> Option<(usize, &'static str)> {
        PARTS.iter().find_map(|(names, unit)| {
            let (k, _) = self.ending(names, None)?;
            let (values, factor) = (self.layout.column(k), units::factor(unit));
            let within =
                |(s, v): (&f64, &f64)| s.fract() == 0.0 && (0.0..1.0).contains(&(v * factor));
            let [rises, all] = rises(seconds, &values);
            let often = rises * 10 >= all * 9;
            (seconds.iter().zip(&values).all(within) && often).then_some((k, *unit))
        })
    }

    /// Tests whether a column of the time beside those of a date increases from row to row.
    fn rises_besides(&self, columns: &[usize]) -> bool {
        let time = |(k, m): &&(usize, Meaning)| m.channel == "time" && !columns.contains(k);
        self.columns.iter().filter(time).any(|(k, _)| increases(&self.layout.column(*k)))
    }
}

#[cfg(test)]
mod tests {
    use crate::table::recognise;

    /// The keys of a table with these headings, and a sample each 10 ms over two seconds, or the reason why it is refused.
    fn keys(headings: &str, date: &str) -> String {
        let row = |k: usize| {
            let (second, milli) = (58 + k / 100, 10 * (k % 100));
            let time = format!("{},{},{milli}", 13 + second / 60, second % 60);
            format!("{date},22,{time},0.0{},0.01,0.02,0.1,0.2,-9.8{}\n", k % 7, k % 9)
        };
        let rows = (0..300).map(row).collect::<String>();
        let found = recognise(&format!("{headings},gx,gy,gz,ax,ay,az\n{rows}"), "");
        found.map_or_else(|why| why, |found| found[0].source.join("\n"))
    }

    #[test]
    fn the_fields_of_a_date_are_found_by_their_ranges_in_any_language() {
        let words = "any,mes,dia,hora,minut,segon,millesima";
        let key = "time = { column = \"segon\", fields = [\"any\", \"mes\", \"dia\", \"hora\", \"minut\"], \
                   nanos = \"millesima\", nanos_unit = \"ms\" }";
        assert!(keys(words, "2023,11,14").contains(key), "{}", keys(words, "2023,11,14"));
        let order = keys("dia,mes,any,hora,minut,segon,millesima", "14,11,2023");
        assert!(order.contains("fields = [\"any\", \"mes\", \"dia\""), "{order}");
    }

    #[test]
    fn a_day_of_the_year_has_hour_minute_and_second_in_columns_beside_it() {
        let row = |k: usize| {
            let second = 3_550.0 + k as f64 / 10.0;
            let [minute, hour] = [(second / 60.0).floor(), 22.0 + (second / 3600.0).floor()];
            let second = second % 60.0;
            format!("2023,318,{hour},{},{second:.1},0.0{},1,2,0.1,0.2,-9.8\n", minute % 60.0, k % 7)
        };
        let rows = (0..900).map(row).collect::<String>();
        let keys = |headings: &str| {
            let found = recognise(&format!("{headings},gx,gy,gz,ax,ay,az\n{rows}"), "");
            found.map_or_else(|why| why, |found| found[0].source.join("\n"))
        };
        for [year, day, hour, minute, second] in
            [["YEAR", "DOY", "HH", "MM", "SS.SSS"], ["year", "day of year", "h", "min", "sec"]]
        {
            let found = keys(&[year, day, hour, minute, second].join(","));
            let key = format!(
                "time = {{ column = \"{second}\", of_year = [\"{year}\", \"{day}\", \"{hour}\", \"{minute}\"] }}"
            );
            assert!(found.contains(&key), "{found}");
        }
        // the seconds of a minute alone are no clock
        let why = keys("a,b,c,d,SS.SSS");
        assert!(why.contains("no column of the time"), "{why}");
    }

    #[test]
    fn a_part_of_a_second_alone_is_no_time() {
        let why = keys("a,b,c,h,m,s,ms", "7,8,9");
        assert!(why.contains("no column of the time"), "{why}");
    }
}
