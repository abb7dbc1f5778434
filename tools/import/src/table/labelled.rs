//! Files whose rows name their values: JSON, and lines such as `t=0.01 gx: 0.2`.

use super::content;
use super::elements;
use super::layout::Layout;
use super::measured::measured;
use super::vocabulary::{Meaning, meaning};
use crate::found::Found;
use navfuse_core::document::quoted;

/// Number of records by which the values are named.
const RECORDS: usize = 4000;
/// Least number of values of an object, and of a line.
const VALUES: [usize; 2] = [2, 3];
/// Number of records by which repeated names are found.
const SOME: usize = 50;
/// Share of the records that must have them.
const SHARE: f64 = 0.9;
/// Largest number of kinds.
const KINDS: usize = 50;

/// A record: the paths and the texts of its values.
pub type Record = Vec<(String, String)>;

fn value<'a>(record: &'a Record, name: &str) -> Option<&'a str> {
    record.iter().find(|(path, _)| path == name).map(|(_, text)| text.as_str())
}

/// The path whose values are words that say what a record is.
fn kind(records: &[Record]) -> Option<(String, Vec<String>)> {
    let word = |text: &&str| {
        text.starts_with(|c: char| c.is_alphabetic() || c == '/')
            && *text != "true"
            && *text != "false"
    };
    records.first()?.iter().find_map(|(name, _)| {
        let mut kinds: Vec<String> = Vec::new();
        for record in records {
            let text = value(record, name).filter(word)?;
            if !kinds.iter().any(|kind| kind == text) {
                kinds.push(text.to_owned());
            }
        }
        ((2..=KINDS).contains(&kinds.len()) && kinds.len() * 2 < records.len())
            .then(|| (name.clone(), kinds))
    })
}

/// The first records, and as many of each form that begins later, as those of a second array.
fn of_all_forms(records: &[Record]) -> Vec<&Record> {
    let same = |record: &Record, form: &Record| {
        record.len() == form.len() && record.iter().zip(form).all(|(a, b)| a.0 == b.0)
    };
    let mut forms: Vec<(&Record, usize)> = Vec::new();
    let mut chosen = Vec::new();
    for (k, record) in records.iter().enumerate() {
        let count = match forms.iter().position(|(form, _)| same(record, form)) {
            Some(place) => {
                forms[place].1 += 1;
                forms[place].1
            }
            None if forms.len() < KINDS => {
                forms.push((record, 1));
                1
            }
            None => RECORDS,
        };
        let later = forms.len() > 1 && !same(record, forms[0].0);
        if k < RECORDS || (later && count < RECORDS) {
            chosen.push(record);
        }
    }
    chosen
}

/// The sensors of records that have the same values.
fn of(records: &[&Record], kind: Option<(&str, &str)>, name: &str) -> Result<Vec<Found>, String> {
    let mut headings: Vec<String> = Vec::new();
    for (path, _) in records.iter().copied().flatten() {
        if !headings.contains(path) {
            headings.push(path.clone());
        }
    }
    let row = |record: &&Record| {
        let cell = |heading: &String| value(record, heading).unwrap_or_default().to_owned();
        headings.iter().map(cell).collect()
    };
    let rows = records.iter().map(row).collect();
    let place = kind
        .and_then(|(path, text)| Some((headings.iter().position(|h| h == path)?, text.to_owned())));
    let layout = Layout::labelled(headings, rows, place.into_iter().collect());
    let (mut sensors, why) = match measured(layout, name, Vec::new()) {
        Ok(sensors) => (sensors, None),
        Err(why) => (Vec::new(), Some(why)),
    };
    for (paths, rows) in forms(records).into_iter().filter(|(paths, _)| mean_nothing(paths)) {
        for found in by_content(&paths, rows, kind, name) {
            if !sensors.iter().any(|known| known.kind == found.kind) {
                sensors.push(found);
            }
        }
    }
    match why {
        Some(why) if sensors.is_empty() => Err(why),
        _ => Ok(sensors),
    }
}

/// The paths of records and the texts of their values.
type Form = (Vec<String>, Vec<Vec<String>>);

/// The records with the same paths.
fn forms(records: &[&Record]) -> Vec<Form> {
    let mut forms: Vec<Form> = Vec::new();
    for record in records {
        let paths: Vec<String> = record.iter().map(|(path, _)| path.clone()).collect();
        let row = record.iter().map(|(_, text)| text.clone()).collect();
        match forms.iter().position(|(known, _)| *known == paths) {
            Some(k) => forms[k].1.push(row),
            None if forms.len() < KINDS => forms.push((paths, vec![row])),
            None => {}
        }
    }
    forms
}

/// Tests whether no path names a measurement, as those of a matrix.
fn mean_nothing(paths: &[String]) -> bool {
    let measures = |m: Meaning| !["time", "date", "week"].contains(&m.channel);
    !paths.iter().any(|path| meaning(path).is_some_and(measures))
}

/// The sensors of records whose paths mean nothing, by the content of their values.
fn by_content(
    paths: &[String],
    rows: Vec<Vec<String>>,
    kind: Option<(&str, &str)>,
    name: &str,
) -> Vec<Found> {
    let place = kind
        .and_then(|(path, text)| Some((paths.iter().position(|p| p == path)?, text.to_owned())));
    let layout = Layout::labelled(paths.to_vec(), rows, place.into_iter().collect());
    let Some((names, question)) = content::headings(&layout) else { return Vec::new() };
    let named = layout.renamed(names.clone());
    let mut sensors = measured(named, name, vec![question]).unwrap_or_default();
    // the source knows the paths
    for line in sensors.iter_mut().flat_map(|found| &mut found.source) {
        for (name, path) in names.iter().zip(paths) {
            *line = line.replace(&quoted(name), &quoted(path));
        }
    }
    sensors
}

/// The sensors of a file whose rows name their values; `None` for another file.
pub fn sensors(text: &str, name: &str) -> Option<Result<Vec<Found>, String>> {
    let json = text.trim_start().starts_with(['{', '[']);
    let least = VALUES[usize::from(!json)];
    // objects have lines of any number, others one line each
    let lines = if json { f64::INFINITY } else { text.lines().count() as f64 };
    let mut records = navfuse_csv::records(text, least, ((1.0 - SHARE) * lines).ceil() as usize);
    let whole = records.iter().filter(|record| record.len() >= least).count();
    if records.len() < 2 || (whole as f64) < SHARE * records.len() as f64 {
        return None;
    }
    // cells of a table may name their numbers, too
    let twice = |record: &&Record| {
        record.iter().enumerate().any(|(k, (name, _))| record[..k].iter().any(|(n, _)| n == name))
    };
    let first = || records.iter().take(SOME);
    if !json && first().filter(twice).count() * 2 > first().count() {
        return None;
    }
    records.truncate(10 * RECORDS);
    records.retain(|record| record.len() >= least);
    let each = if json { elements::apart(&mut records) } else { Vec::new() };
    let mut found = of_records(&records, name);
    let keyed = found.iter_mut().flatten();
    keyed.for_each(|sensor| sensor.source.extend(elements::key(&each)));
    Some(found)
}

/// The sensors of all records, or of those of each kind.
fn of_records(records: &[Record], name: &str) -> Result<Vec<Found>, String> {
    let Some((path, kinds)) = kind(records) else {
        let records: Vec<&Record> = of_all_forms(records);
        return of(&records, None, name);
    };
    let mut sensors: Vec<Found> = Vec::new();
    for kind in &kinds {
        let records = records.iter().filter(|record| value(record, &path) == Some(kind));
        let records: Vec<&Record> = records.take(RECORDS).collect();
        for found in of(&records, Some((&path, kind)), kind).unwrap_or_default() {
            if !sensors.iter().any(|known| known.kind == found.kind) {
                sensors.push(found);
            }
        }
    }
    let none = || format!("none of its records ({}) has a known sensor", kinds.join(", "));
    if sensors.is_empty() { Err(none()) } else { Ok(sensors) }
}
