//! Tables with one value in each row, which a cell names: `time,channel,value`, in the annotated CSV of InfluxDB, in logs of
//! MOOS, and as objects of JSON. The values of one time become one row.

use crate::number::number;
use crate::object::object;
use crate::series::{Named, TIMES, UNITS, groups};
use crate::transposed::Group;
use std::borrow::Cow;

/// Words for the column that names the value of a row, for that of its sensor, and for that of its value.
const NAMES: [&str; 15] = [
    "field",
    "signal",
    "variable",
    "channel",
    "name",
    "key",
    "parameter",
    "metric",
    "quantity",
    "kanal",
    "messgröße",
    "canal",
    "canale",
    "kanaal",
    "señal",
];
const SENSORS: [&str; 6] = ["sensor", "measurement", "topic", "device", "message", "group"];
pub const VALUES: [&str; 9] =
    ["value", "reading", "val", "wert", "messwert", "valeur", "valor", "valore", "waarde"];
/// Lines within which the headings stand, and their length.
const HEAD: usize = 20;
const LONGEST: usize = 800;
/// Least number of names of a table without headings: two vectors.
const VECTOR: usize = 6;
/// Share of its lines that are rows, and of those with a number.
const ROWS: f64 = 0.9;
const NUMBERS: f64 = 0.5;

/// The letters of a heading before its unit.
pub fn word(heading: &str) -> String {
    let name = heading.split(['[', '(']).next().unwrap_or_default();
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The columns of a table by what they hold.
#[derive(Clone, Debug, PartialEq)]
struct Roles {
    time: usize,
    /// The sensor, and the name of the value.
    names: Vec<usize>,
    value: usize,
    unit: Option<usize>,
}

impl Roles {
    fn of(headings: &[&str]) -> Option<Self> {
        let words: Vec<String> = headings.iter().map(|h| word(h)).collect();
        let find = |known: &[&str]| words.iter().position(|w| known.contains(&w.as_str()));
        let (time, name, value) = (find(&TIMES)?, find(&NAMES)?, find(&VALUES)?);
        let sensor = find(&SENSORS).filter(|k| *k != time);
        let names = sensor.into_iter().chain([name]).collect();
        Some(Self { time, names, value, unit: find(&UNITS) })
    }
}

/// The cells of a line, without quotation marks.
pub fn cells(line: &str, separator: Option<char>) -> Vec<&str> {
    match separator {
        Some(c) => line.split(c).map(|cell| cell.trim().trim_matches('"')).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// A cell with a decimal point in place of a comma that separates no cells.
pub fn point(cell: &str, separator: Option<char>) -> Cow<'_, str> {
    match separator != Some(',') && cell.contains(',') {
        true => cell.replace(',', ".").into(),
        false => cell.into(),
    }
}

/// The separator of a line.
pub fn separator(line: &str) -> Option<char> {
    [';', '\t', ','].into_iter().find(|c| line.contains(*c))
}

/// The form of the lines.
#[derive(Clone, Debug, PartialEq)]
enum Lines {
    /// With headings, and the title of the time.
    Table(Option<char>, Roles, String),
    /// A time, a name, perhaps who wrote it, and a value.
    Plain(Option<char>),
    /// `>name:milliseconds:value`, as Teleplot has them, perhaps with a unit.
    Marked,
    /// An object with the values at these paths.
    Objects([String; 3]),
}

fn filled(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with(['%', '#']))
}

/// The values of an object of JSON on one line.
fn of_object(line: &str) -> Option<Vec<(String, String)>> {
    let line = line.trim_start_matches(['[', ',', ' ']).trim_end_matches([',', ' ', ']']);
    let mut values = Vec::new();
    if line.starts_with('{') && line.ends_with('}') {
        object(line, |path, value| values.push((path.to_owned(), value.to_owned())));
    }
    (!values.is_empty()).then_some(values)
}

/// A line of Teleplot: its time, its name, its value and its unit.
fn marked(line: &str) -> Option<[&str; 4]> {
    let mut parts = line.strip_prefix('>')?.splitn(3, ':');
    let (name, time, rest) = (parts.next()?, parts.next()?, parts.next()?);
    let value = rest.split('|').next().unwrap_or_default();
    let (value, unit) = value.split_once('§').unwrap_or((value, ""));
    number(time)?;
    (number(value).is_some() && !name.is_empty()).then_some([time, name, value, unit])
}

/// A row of a table without headings: its time, its name and its value.
fn plain(line: &str, separator: Option<char>) -> Option<[&str; 3]> {
    let cells = cells(line, separator);
    let name = cells.get(1).filter(|name| name.starts_with(|c: char| c.is_alphabetic()))?;
    number(cells[0])?;
    let last = *cells.get(3).or(cells.get(2))?;
    (separator.is_none() || cells.len() <= 4).then_some([cells[0], name, last])
}

impl Lines {
    fn of(text: &str) -> Option<Self> {
        let first = filled(text).find(|line| line.len() > 2)?;
        if let Some(values) = of_object(first) {
            let paths: Vec<&str> = values.iter().map(|(path, _)| path.as_str()).collect();
            let roles = Roles::of(&paths).filter(|_| values.len() < VECTOR)?;
            let of = |k: usize| paths[k].to_owned();
            let name = *roles.names.last()?;
            return Some(Self::Objects([of(roles.time), of(name), of(roles.value)]));
        }
        if marked(first).is_some() {
            return Some(Self::Marked);
        }
        let titled = |line: &str| {
            let separator = separator(line)?;
            let cells = cells(line, Some(separator));
            let roles = Roles::of(&cells)?;
            let time = cells[roles.time].to_owned();
            Some(Self::Table(Some(separator), roles, time))
        };
        filled(text).take(HEAD).find_map(titled).or_else(|| Self::without_headings(text))
    }

    fn without_headings(text: &str) -> Option<Self> {
        // the last line may be cut off
        let lines: Vec<&str> = filled(text).collect();
        let lines = lines.split_last().map_or(&[][..], |(_, whole)| whole);
        let comma = lines.first().and_then(|line| separator(line));
        let separator = comma.filter(|c| lines.iter().all(|line| line.contains(*c)));
        let rows: Vec<[&str; 3]> = lines.iter().filter_map(|l| plain(l, separator)).collect();
        let numbers: Vec<&[&str; 3]> = rows.iter().filter(|r| number(r[2]).is_some()).collect();
        let mut names: Vec<&str> = numbers.iter().map(|row| row[1]).collect();
        names.sort_unstable();
        names.dedup();
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        // rows of several kinds have more values, and few names
        let apart = separator.is_some()
            || lines
                .iter()
                .all(|line| plain(line, None).is_none() || line.split_whitespace().count() < 5);
        let fits = share(rows.len(), lines.len()) > ROWS
            && share(numbers.len(), rows.len()) > NUMBERS
            && names.len() >= VECTOR;
        (fits && apart).then_some(Self::Plain(separator))
    }

    /// The title of the time.
    fn time(&self) -> &str {
        match self {
            Self::Table(_, _, time) => time,
            Self::Plain(_) => "time",
            Self::Marked => "time [ms]",
            Self::Objects([time, ..]) => time,
        }
    }

    /// Calls `found` with the time, the name and the value of a line.
    fn row(&mut self, line: &str, mut found: impl FnMut(&str, &str, &str)) {
        match self {
            Self::Objects(paths) => {
                let Some(values) = of_object(line) else { return };
                let value = |path: &String| values.iter().find(|(p, _)| p == path).map(|(_, v)| v);
                if let [Some(time), Some(name), Some(value)] = [0, 1, 2].map(|k| value(&paths[k])) {
                    found(time, name, value);
                }
            }
            Self::Marked => {
                if let Some([time, name, value, unit]) = marked(line) {
                    let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
                    found(time, &(name.to_owned() + &unit), value);
                }
            }
            Self::Plain(separator) => {
                if let Some([time, name, value]) = plain(line, *separator) {
                    found(time, name, value);
                }
            }
            Self::Table(separator, roles, _) => {
                let cells = cells(line, *separator);
                // the next table may have its columns in another order
                if let Some(next) = Roles::of(&cells) {
                    *roles = next;
                    return;
                }
                let cell = |k: usize| cells.get(k).copied().unwrap_or_default();
                let names: Vec<&str> = roles.names.iter().map(|k| cell(*k)).collect();
                let unit = roles.unit.map(cell).filter(|unit| !unit.is_empty());
                let unit = unit.map_or_else(String::new, |unit| format!(" [{unit}]"));
                if names.iter().all(|name| !name.is_empty()) {
                    let value = point(cell(roles.value), *separator);
                    found(cell(roles.time), &(names.join(".") + &unit), &value);
                }
            }
        }
    }
}

/// Tests whether a text begins with one value in each row.
pub fn begins(text: &str) -> bool {
    Lines::of(text).is_some()
}

/// The columns of the names that share their times.
pub fn read(text: &str) -> Vec<Group> {
    // as it was recognised
    let beginning = text.char_indices().nth(HEAD * LONGEST).map_or(text, |(at, _)| &text[..at]);
    let Some(mut lines) = Lines::of(beginning) else { return Vec::new() };
    let mut named = Named::default();
    for line in filled(text) {
        lines.row(line, |time, name, value| named.push(name, time, value));
    }
    groups(named.series, lines.time())
}
