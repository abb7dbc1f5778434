//! Values of names with times of their own, as rows with those of one time.

use crate::number::number;
use crate::transposed::{Cells, Group, LEAST};
use navfuse_core::units::calendar;
use std::collections::{BTreeMap, HashMap};

/// Part of the usual step within which values have one time, and share of a column that must have the times of another one.
const NEAR: f64 = 0.25;
const SHARE: f64 = 0.9;
/// Words for the times of values, and for their unit.
pub const TIMES: [&str; 20] = [
    "timestamps",
    "timestamp",
    "times",
    "time",
    "ts",
    "t",
    "stamp",
    "utc",
    "date",
    "datetime",
    "epoch",
    "utime",
    "clock",
    "zeit",
    "zeitstempel",
    "uhrzeit",
    "temps",
    "tiempo",
    "tempo",
    "tijd",
];
pub const UNITS: [&str; 6] = ["unit", "units", "einheit", "unité", "unidad", "eenheid"];
/// Least number of names that have times of their own.
const SERIES: usize = 3;

/// Takes out the names whose values have times of their own, `{"gx": {"values": [[0.01, 0.2], ...]}}` or
/// `{"gx": {"timestamps": [...], "values": [...]}}`, as those of one time in rows.
pub fn timed(
    columns: &mut BTreeMap<String, (usize, Cells)>,
    units: &BTreeMap<String, String>,
) -> Vec<Group> {
    let rising = |cells: &Cells| {
        let values: Vec<f64> = cells.all().iter().filter_map(|cell| number(cell)).collect();
        values.len() == cells.count()
            && values.windows(2).filter(|v| v[1] <= v[0]).count() * 100 < values.len()
    };
    let pair = |stem: &str| -> Option<[String; 2]> {
        let has = |name: &String| columns.contains_key(name);
        let inner = [format!("{stem}.0"), format!("{stem}.1")];
        let apart = || {
            let time = TIMES.iter().map(|word| format!("{stem}.{word}")).find(has)?;
            Some([time, stem.to_owned()]).filter(|[_, value]| has(value))
        };
        let two = inner.iter().all(has) && !has(&format!("{stem}.2"));
        let [time, value] = if two { inner } else { apart()? };
        let count = |name: &String| columns.get(name).map_or(0, |(_, cells)| cells.count());
        let long = count(&time) == count(&value) && count(&time) >= LEAST;
        let rises = columns.get(&time).is_some_and(|(_, cells)| long && rising(cells));
        rises.then_some([time, value])
    };
    let stems = columns
        .iter()
        .filter_map(|(path, (order, _))| Some((*order, path.rsplit_once('.')?.0.to_owned())));
    let mut stems: Vec<(usize, String)> = stems.collect();
    stems.sort();
    stems.dedup_by(|a, b| a.1 == b.1);
    let found: Vec<(String, [String; 2])> =
        stems.into_iter().filter_map(|(_, stem)| Some((stem.clone(), pair(&stem)?))).collect();
    if found.len() < SERIES {
        return Vec::new();
    }
    let mut series = Named::default();
    for (stem, [time, value]) in found {
        let unit = units.get(&stem).map_or_else(String::new, |unit| format!(" [{unit}]"));
        if let [Some((_, times)), Some((_, values))] =
            [time, value].map(|name| columns.remove(&name))
        {
            times
                .all()
                .iter()
                .zip(values.all())
                .for_each(|(time, value)| series.push(&format!("{stem}{unit}"), time, value));
        }
    }
    groups(series.series, "time")
}

/// Series by their names, in the order in which they begin.
#[derive(Default)]
pub struct Named {
    places: HashMap<String, usize>,
    pub series: Vec<Series>,
}

impl Named {
    /// Adds a value to the series of a name; a text that is none is left out.
    pub fn push(&mut self, name: &str, time: &str, value: &str) {
        let Some(seconds) = seconds(time) else { return };
        if number(value).is_none() && !["true", "false"].contains(&value) {
            return;
        }
        let next = self.series.len();
        let place = match self.places.get(name) {
            Some(place) => *place,
            None => {
                self.places.insert(name.to_owned(), next);
                self.series.push(Series { name: name.to_owned(), ..Series::default() });
                next
            }
        };
        let series = &mut self.series[place];
        series.seconds.push(seconds);
        series.times.push(time);
        series.values.push(value);
    }
}

/// The times and the values of a name.
#[derive(Default)]
pub struct Series {
    name: String,
    /// Times to compare with others.
    seconds: Vec<f64>,
    times: Cells,
    values: Cells,
}

/// The number of a time, or the seconds of a date.
pub fn seconds(time: &str) -> Option<f64> {
    let date = || calendar::parse(time).map(|(nanos, _)| nanos as f64 * 1e-9);
    let clock = || {
        let clock = time.split([' ', 'T']).find(|part| part.contains(':'))?;
        let parts = clock.trim_end_matches('Z').split(':').map(|p| p.parse::<f64>().ok());
        parts.collect::<Option<Vec<f64>>>().map(|p| p.iter().fold(0.0, |sum, p| 60.0 * sum + p))
    };
    number(time).or_else(date).or_else(clock).filter(|t| t.is_finite())
}

/// For each time of the first series the place in the second one with the same time, within a part of the usual step.
fn aligned(first: &Series, second: &Series) -> Option<Vec<Option<usize>>> {
    let (a, b) = (&first.seconds, &second.seconds);
    if 2 * b.len() < a.len() {
        return None;
    }
    let span = a.last()? - a.first()?;
    let near = NEAR * span.abs() / (a.len().max(2) - 1) as f64;
    let (mut places, mut next, mut found) = (Vec::with_capacity(a.len()), 0, 0);
    for time in a {
        while b.get(next).is_some_and(|t| *t < time - near) {
            next += 1;
        }
        let same = b.get(next).is_some_and(|t| (t - time).abs() <= near);
        places.push(same.then_some(next));
        next += usize::from(same);
        found += usize::from(same);
    }
    let most = |n: usize| found as f64 >= SHARE * n as f64;
    (most(b.len()) && 2 * found >= a.len()).then_some(places)
}

/// The series that share their times, with the times of the first of them in a column of this title.
pub fn groups(mut series: Vec<Series>, time: &str) -> Vec<Group> {
    let mut order: Vec<usize> = (0..series.len()).collect();
    order.sort_by_key(|k| usize::MAX - series[*k].seconds.len());
    let mut leaders: Vec<(usize, Group)> = Vec::new();
    for k in order {
        let places = |(place, (first, _)): (usize, &(usize, Group))| {
            Some((place, aligned(&series[*first], &series[k])?))
        };
        let (place, places) = leaders.iter().enumerate().find_map(places).unwrap_or_else(|| {
            let times = std::mem::take(&mut series[k].times);
            let rows = series[k].seconds.len();
            leaders.push((k, Group::of(std::iter::once((time.to_owned(), times)), rows)));
            (leaders.len() - 1, (0..rows).map(Some).collect())
        });
        let mut cells = Cells::default();
        let mut values = std::mem::take(&mut series[k].values);
        let mut next = 0;
        for place in places {
            let Some(place) = place else {
                cells.push("");
                continue;
            };
            while next <= place {
                values.advance();
                next += 1;
            }
            cells.push(values.cell().unwrap_or_default());
        }
        leaders[place].1.push(k + 1, series[k].name.clone(), cells);
    }
    leaders.into_iter().map(|(_, group)| group).collect()
}
