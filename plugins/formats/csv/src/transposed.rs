//! JSON with an array for each column, as pandas, Strava and many scripts write it: `{"time": [0, 1], "gx": [0.1, 0.2]}`,
//! `{"columns": ["time", "gx"], "data": [[0, 0.1], [1, 0.2]]}`, `{"time": {"data": [0, 1]}}`, `{"time": {"0": 0, "1": 1}}`
//! and `[{"type": "time", "data": [0, 1]}]`. Arrays of other lengths are rows of their own.

use crate::object::object;
use crate::series;
use std::collections::BTreeMap;

/// Least number of elements of the first array, at the beginning of a file.
pub const LEAST: usize = 24;
/// Keys whose array in an element of a list is a column, and those that name it.
const VALUES: [&str; 3] = ["data", "values", "value"];
const NAMES: [&str; 3] = ["type", "name", "key"];

/// The cells of a column, one after another in one text, so that they take no more memory than in the file.
#[derive(Default)]
pub struct Cells {
    text: String,
    count: usize,
    /// Place of the cell of this row, and of the next one.
    here: [usize; 2],
}

/// Ends a cell.
const END: char = '\0';

impl Cells {
    pub fn push(&mut self, cell: &str) {
        self.text.extend(cell.chars().filter(|c| *c != END));
        self.text.push(END);
        self.count += 1;
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Goes on to the next cell.
    pub fn advance(&mut self) {
        let from = self.here[1];
        let end = self.text[from..].find(END).map_or(from, |at| from + at + 1);
        self.here = [from, end];
    }

    /// The cell of this row; `None` behind the last one.
    pub fn cell(&self) -> Option<&str> {
        self.text[self.here[0]..self.here[1]].strip_suffix(END)
    }

    pub fn all(&self) -> Vec<&str> {
        self.text.split_terminator(END).collect()
    }
}

/// Columns of about one length, and the number of their rows.
#[derive(Default)]
pub struct Group {
    columns: Vec<(usize, String, Cells)>,
    rows: usize,
}

impl Group {
    /// Columns with as many rows, by their names.
    pub fn of(columns: impl Iterator<Item = (String, Cells)>, rows: usize) -> Self {
        let mut group = Self { columns: Vec::new(), rows };
        group.extend(columns);
        group
    }

    /// Adds columns.
    pub fn extend(&mut self, columns: impl Iterator<Item = (String, Cells)>) {
        let place = self.columns.len();
        self.columns.extend(columns.enumerate().map(|(k, (name, cells))| (place + k, name, cells)));
    }

    /// Adds a column that goes before those with a higher place.
    pub fn push(&mut self, place: usize, name: String, cells: Cells) {
        self.columns.push((place, name, cells));
    }

    pub fn rows(&self) -> usize {
        self.rows
    }
}

/// The columns of a file: the rows of the longest ones come first, and those of other sensors follow.
#[derive(Default)]
pub struct Columns {
    groups: Vec<Group>,
    /// The group of the current row, and how many of its rows were begun.
    group: usize,
    at: usize,
}

/// A line of GeoJSON, whose times are an array beside its coordinates, and the path of the first of several.
const LINE: &str = "\"LineString\"";
const FIRST_LINE: &str = "features.0.";

/// Tests whether a text begins with one object or list of arrays: the first array of numbers, or of arrays of numbers, has
/// many elements, and the object has not ended before it.
pub fn begins(text: &str) -> bool {
    let text = text.trim_start();
    let deepest = if text.contains(LINE) { [8, 5] } else { [4, 2] };
    let (mut depth, mut quoted, mut escaped, mut elements) = (0_usize, false, false, 0_usize);
    let mut opened = Vec::new();
    let mut key = String::new();
    // values of one object whose keys count them
    let mut counted = 0_usize;
    for c in text.chars() {
        if quoted {
            quoted = c != '"' || escaped;
            escaped = c == '\\' && !escaped;
            if quoted {
                key.push(c);
            }
            continue;
        }
        match c {
            '"' => {
                quoted = true;
                key.clear();
                elements = 0;
            }
            '{' | '[' => {
                depth += 1;
                opened.push(c);
                elements = if c == '{' { 0 } else { elements };
                counted = 0;
            }
            '}' | ']' => {
                depth = depth.saturating_sub(1);
                opened.pop();
                if depth == 0 {
                    return false;
                }
            }
            ',' if opened.last() == Some(&'[') => elements += 1,
            ',' if key.parse() == Ok(counted) => counted += 1,
            _ => {}
        }
        let listed = opened.first() == Some(&'[');
        let named = !listed || VALUES.contains(&key.as_str());
        let braces = opened.iter().filter(|c| **c == '{').count();
        let shallow = depth <= deepest[0] && braces <= deepest[1];
        if elements.max(counted) >= LEAST && named && shallow && opened.contains(&'{') {
            return true;
        }
    }
    false
}

impl Columns {
    /// The columns of a text of JSON.
    pub fn of(text: &str) -> Self {
        let listed = text.trim_start().starts_with('[');
        let mut columns: BTreeMap<String, (usize, Cells)> = BTreeMap::new();
        let mut names: BTreeMap<String, String> = BTreeMap::new();
        let mut units: BTreeMap<String, String> = BTreeMap::new();
        let mut order = 0;
        object(text.trim(), |path, value| {
            let parts: Vec<&str> =
                path.strip_prefix(FIRST_LINE).unwrap_or(path).split('.').collect();
            // the place in a list comes first
            let first = usize::from(listed);
            let number = |part: &&str| part.bytes().all(|b| b.is_ascii_digit());
            let Some(k) = (first..parts.len()).find(|k| number(&parts[*k])) else {
                if parts.last().is_some_and(|last| NAMES.contains(last)) && listed {
                    names.insert(parts[0].to_owned(), value.to_owned());
                } else if let Some((stem, _)) =
                    path.rsplit_once('.').filter(|(_, last)| series::UNITS.contains(last))
                {
                    units.insert(stem.to_owned(), value.to_owned());
                }
                return;
            };
            let Ok(row) = parts[k].parse::<usize>() else { return };
            let mut name: Vec<&str> = parts[..k].to_vec();
            if name.len() > 1 && name.last().is_some_and(|last| VALUES.contains(last)) {
                name.pop();
            }
            name.extend(&parts[k + 1..]);
            let column = columns.entry(name.join(".")).or_insert_with(|| {
                order += 1;
                (order, Cells::default())
            });
            // elements come in their order
            if row >= column.1.count && row - column.1.count < 1 << 20 {
                (column.1.count..row).for_each(|_| column.1.push(""));
                column.1.push(value);
            }
        });
        let timed = series::timed(&mut columns, &units);
        // headings beside the rows of all columns, or of those of a sensor
        let titles = |path: &String, _: &mut (usize, Cells)| path.ends_with("columns");
        let titles: Vec<(String, (usize, Cells))> = columns.extract_if(.., titles).collect();
        let name = |path: &str| {
            let (first, rest) = path.split_once('.').map_or((path, ""), |(a, b)| (a, b));
            let of_list = || names.get(first).map(|name| (name.clone(), rest.to_owned()));
            let of_split = |(title, (_, headings)): &(String, (usize, Cells))| {
                let sensor = title.strip_suffix("columns")?;
                let stem = if sensor.is_empty() { "data." } else { sensor };
                let rest = path.strip_prefix(stem)?;
                let (k, after) = rest.split_once('.').unwrap_or((rest, ""));
                let heading = *headings.all().get(k.parse::<usize>().ok()?)?;
                Some((format!("{sensor}{heading}"), after.to_owned()))
            };
            let found = of_list().filter(|_| listed);
            match found.or_else(|| titles.iter().find_map(of_split)) {
                Some((name, rest)) if rest.is_empty() => name,
                Some((name, rest)) => format!("{name}.{rest}"),
                None => path.to_owned(),
            }
        };
        let mut columns: Vec<_> = columns.into_iter().collect();
        columns.sort_by_key(|(_, (order, cells))| (usize::MAX - cells.count, *order));
        let mut groups: Vec<Group> = Vec::new();
        for (path, (order, cells)) in columns {
            let column = (order, name(&path), cells);
            let rows = column.2.count;
            match groups.last_mut().filter(|group| 2 * rows > group.rows) {
                Some(group) => group.columns.push(column),
                None => groups.push(Group { columns: vec![column], rows }),
            }
        }
        // shorter ones are a time and a value at least
        let begins = groups.first().map_or(0, |group| group.rows);
        groups.retain(|g| g.rows == begins || (g.rows >= LEAST && g.columns.len() > 1));
        groups.extend(timed);
        Self::new(groups)
    }

    /// The rows of groups.
    pub fn new(mut groups: Vec<Group>) -> Self {
        groups.iter_mut().for_each(|group| group.columns.sort_by_key(|(order, ..)| *order));
        groups.sort_by_key(|group| usize::MAX - group.rows);
        Self { groups, group: 0, at: 0 }
    }

    /// Goes on to the next row; `false` at the end.
    pub fn advance(&mut self) -> bool {
        while let Some(group) = self.groups.get_mut(self.group) {
            if self.at < group.rows {
                self.at += 1;
                group.columns.iter_mut().for_each(|(.., cells)| cells.advance());
                return true;
            }
            (self.group, self.at) = (self.group + 1, 0);
        }
        false
    }

    /// Calls `found` with the name and the text of each value of the row.
    pub fn values(&self, mut found: impl FnMut(&str, &str)) {
        for (_, name, cells) in self.groups.get(self.group).iter().flat_map(|g| &g.columns) {
            if let Some(cell) = cells.cell() {
                found(name, cell);
            }
        }
    }

    /// The first rows of each group as objects of JSON, in at most so many bytes.
    pub fn beginning(mut self, most: usize) -> String {
        // half for all alike, and half by their rows
        let (count, rows) =
            (self.groups.len().max(1), self.groups.iter().map(|g| g.rows).sum::<usize>().max(1));
        let (mut text, mut end) = (String::new(), 0.0);
        for group in 0..self.groups.len() {
            (self.group, self.at) = (group, 0);
            let share = 0.5 / count as f64 + 0.5 * self.groups[group].rows as f64 / rows as f64;
            end += share * most as f64;
            while (text.len() as f64) < end && self.advance() && self.group == group {
                let mut cells = Vec::new();
                self.values(|name, cell| cells.push(format!("\"{name}\": \"{cell}\"")));
                text += &format!("{{{}}}\n", cells.join(", "));
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_for_each_column_is_rows() {
        let split =
            "{\"columns\": [\"t\", \"gx\"], \"index\": [0, 1], \"data\": [[0.5, 1], [1.5, 2]]}";
        for (text, rows) in [
            ("{\"t\": [0.5, 1.5], \"n\": 2, \"g\": [1, null]}", "t=0.5 g=1 t=1.5 g= "),
            (split, "index=0 t=0.5 gx=1 index=1 t=1.5 gx=2 "),
            ("{\"t\": {\"0\": 0.5, \"1\": 1.5}}", "t=0.5 t=1.5 "),
            ("{\"t\": {\"data\": [0.5, 1.5]}}", "t=0.5 t=1.5 "),
            (
                "{\"i\": {\"columns\": [\"t\", \"x\"], \"data\": [[0.5, 1], [1.5, 2]]}}",
                "i.t=0.5 i.x=1 i.t=1.5 i.x=2 ",
            ),
            (
                "{\"features\": [{\"properties\": {\"times\": [5, 6]}, \"geometry\": \
                 {\"type\": \"LineString\", \"coordinates\": [[1, 2], [3, 4]]}}]}",
                "properties.times=5 geometry.coordinates.0=1 geometry.coordinates.1=2 \
                 properties.times=6 geometry.coordinates.0=3 geometry.coordinates.1=4 ",
            ),
            (
                "[{\"type\": \"p\", \"data\": [[1, 2], [3, 4]]}, {\"type\": \"t\", \"data\": [5, 6]}]",
                "p.0=1 p.1=2 t=5 p.0=3 p.1=4 t=6 ",
            ),
        ] {
            let (mut columns, mut found) = (Columns::of(text), String::new());
            while columns.advance() {
                columns.values(|name, cell| found += &format!("{name}={cell} "));
            }
            assert_eq!(found, rows, "{text}");
        }
    }

    #[test]
    fn arrays_of_other_lengths_are_rows_of_their_own() {
        let list = |n: usize| (0..n).map(|k| k.to_string()).collect::<Vec<_>>().join(", ");
        let [long, short] = [list(100), list(30)];
        let text = format!(
            "{{\"i\": {{\"t\": [{long}], \"g\": [{long}]}}, \"n\": [1, 2], \"f\": {{\"t\": [{short}], \"lat\": [{short}]}}}}"
        );
        assert!(begins(&text));
        let (mut columns, mut rows) = (Columns::of(&text), Vec::new());
        while columns.advance() {
            let mut row = String::new();
            columns.values(|name, cell| row += &format!("{name}={cell} "));
            rows.push(row);
        }
        assert_eq!((rows.len(), rows[99].as_str()), (130, "i.t=99 i.g=99 "));
        assert_eq!(
            (rows[100].as_str(), rows[129].as_str()),
            ("f.t=0 f.lat=0 ", "f.t=29 f.lat=29 ")
        );
        assert!(Columns::of(&text).beginning(1000).contains("f.lat"));
    }

    #[test]
    fn long_arrays_of_one_object_are_columns_and_those_of_records_are_not() {
        let list = |n: usize| (0..n).map(|k| k.to_string()).collect::<Vec<_>>().join(", ");
        assert!(begins(&format!("{{\"t\": [{}", list(100))));
        assert!(begins(&format!("{{\"a\": 1, \"t\": {{\"data\": [{}", list(100))));
        assert!(begins(&format!("[{{\"type\": \"t\", \"data\": [{}", list(100))));
        let keyed = (0..100).map(|k| format!("\"{k}\": 0.5")).collect::<Vec<_>>().join(", ");
        assert!(begins(&format!("{{\"t\": {{{keyed}")));
        let record = format!("{{\"t\": 1, \"cov\": [{}]}}", list(9));
        assert!(!begins(&format!("{record}\n{record}\n")));
        assert!(!begins(&format!("[{{\"t\": 1, \"ranges\": [{}]}},", list(100))));
    }
}
