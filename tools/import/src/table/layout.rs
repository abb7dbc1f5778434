//! The layout of a table: its separator, the lines before its rows, its headings and its rows.

mod cells;
mod parts;
mod preamble;
mod vectors;

use super::sentinel;
use super::vocabulary::meaning;
use cells::{are_units, is_number, numbers, raw, split, with_unit};
use navfuse_core::document::quoted;
use std::collections::HashMap;

/// Largest number of lines by which the layout is found.
const LINES: usize = 4000;
/// Least number of known headings in a line that lines without any may follow.
const KNOWN: usize = 3;
/// Separators and decimal commas, in the order in which they are tried.
const FORMS: [(Option<char>, bool); 9] = [
    (Some(','), false),
    (Some(';'), false),
    (Some(';'), true),
    (Some('\t'), false),
    (Some('\t'), true),
    (Some('|'), false),
    (Some('|'), true),
    (None, false),
    (None, true),
];

/// The layout of a table.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// Separator; `None` for spaces.
    delimiter: Option<char>,
    decimal_comma: bool,
    /// Start of comments, if it is not `#`.
    comment: Option<char>,
    /// Lines at the beginning that are no part of the table.
    pub skip: usize,
    /// Number of lines after which another table begins; zero where none does.
    pub until: usize,
    /// Columns with several numbers in each cell, by their headings, with how many they are.
    vectors: Vec<(String, usize)>,
    /// Set if the rows name their values.
    labels: bool,
    /// Set if the source must be given the headings.
    pub given: bool,
    /// Headings, empty for a table without.
    pub headings: Vec<String>,
    /// Units in a line of their own, by column.
    pub units: Vec<String>,
    /// Cells that a row must have, by the index of their columns.
    pub kind: Vec<(usize, String)>,
    /// Number of lines before the first row.
    before: usize,
    /// Cells of the first rows.
    pub rows: Vec<Vec<String>>,
    /// Units after the numbers of the cells.
    suffixes: Vec<String>,
    /// Set if the rows run from the newest to the oldest.
    backwards: bool,
    /// Rate in Hz that a line above the table states.
    pub rate: Option<f64>,
    /// Point from which positions count, deg and m, and zone of UTM, as a line above the table states them.
    pub origin: Option<[f64; 3]>,
    pub zone: Option<String>,
    /// Numbers that stand for no measurement, by the index of their columns.
    pub missing: Vec<(usize, f64)>,
}

/// The text of a comment.
fn uncommented(line: &str) -> Option<(char, &str)> {
    let start = line.chars().next().filter(|c| matches!(c, '#' | '%'));
    let start = start.or_else(|| line.starts_with("//").then_some('/'))?;
    Some((start, line.trim_start_matches(start).trim_start()))
}

/// The usual number of cells in a form, and the share of numbers in the lines with as many.
fn score(lines: &[&str], delimiter: Option<char>) -> (f64, usize) {
    let mut widths: HashMap<usize, f64> = HashMap::new();
    for line in lines {
        let cells = split(line, delimiter);
        if let Some(numbers) = numbers(&cells) {
            *widths.entry(cells.len()).or_default() += numbers as f64 / cells.len() as f64;
        }
    }
    let best = widths.into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    best.map_or((0.0, 0), |(width, score)| (score, width))
}

/// Headings of two lines: a group, which stands over its first column alone, and its members.
fn grouped(groups: &[String], members: &[String]) -> Vec<String> {
    let mut group = "";
    let join = |(above, member): (&String, &String)| format!("{above} {member}").trim().to_owned();
    let filled: Vec<String> = groups
        .iter()
        .map(|above| {
            group = if above.is_empty() { group } else { above };
            group.to_owned()
        })
        .collect();
    filled.iter().zip(members).map(join).collect()
}

impl Layout {
    /// Finds the layout; `None` where no two lines look like rows of one table. The last line of
    /// the text may be cut off.
    pub fn of(text: &str) -> Option<Self> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        // old programs end their lines with CR alone
        let ended = (!text.contains('\n')).then(|| text.replace('\r', "\n"));
        let text = ended.as_deref().unwrap_or(text);
        let points = text.replace(',', ".");
        let form = |comma: bool| -> Vec<&str> {
            let text = if comma { points.as_str() } else { text };
            text.split('\n').take(LINES).collect()
        };
        let forms = [form(false), form(true)];
        let last = forms[0].len().saturating_sub(1).max(1);
        let mut best = (0.0, 0, None, false);
        // cells between tabs may be empty, and are no cells between spaces
        let tabs = forms[0].iter().filter(|line| line.contains("\t\t")).count();
        let joined = 2 * tabs < forms[0].len();
        // a form whose marks do not occur is none
        let occurs = |c: char| text.contains(c);
        let forms_of_text = FORMS.into_iter().filter(|(delimiter, comma)| {
            delimiter.map_or(joined, occurs) && (!comma || occurs(','))
        });
        for (delimiter, comma) in forms_of_text {
            let rows: Vec<&str> = forms[usize::from(comma)][..last]
                .iter()
                .copied()
                .filter(|line| uncommented(line).is_none())
                .collect();
            let (score, width) = score(&rows, delimiter);
            if score > 1.001 * best.0 {
                best = (score, width, delimiter, comma);
            }
        }
        let (_, width, delimiter, decimal_comma) = best;
        let lines = &forms[usize::from(decimal_comma)][..last];
        let row = |line: &&str| {
            let cells = split(line, delimiter);
            let fits = uncommented(line).is_none() && cells.len() == width;
            Some(cells).filter(|cells| fits && numbers(cells).is_some())
        };
        let numbered = lines.iter().enumerate().filter_map(|(k, line)| Some((k, row(line)?)));
        let mut rows: Vec<(usize, Vec<String>)> = numbered.collect();
        rows.drain(..preamble::length(&rows));
        let (first, _) = *rows.first()?;
        let (places, rows): (Vec<usize>, Vec<Vec<String>>) = rows.into_iter().unzip();
        let mut layout = Self { delimiter, decimal_comma, rows, before: first, ..Self::default() };
        layout.rate = lines[..first].iter().find_map(|line| preamble::rate(line));
        layout.origin = lines[..first].iter().find_map(|line| preamble::origin(line));
        layout.zone = lines[..first].iter().find_map(|line| preamble::zone(line));
        let others = lines[first..].iter().filter_map(|line| uncommented(line));
        layout.comment = others.map(|(c, _)| c).find(|c| *c != '#');
        layout.find_headings(&lines[..first], width);
        layout.spread();
        layout.find_units(places.into_iter().map(|k| lines[k])).then_some(layout)
    }

    /// Finds the units after the numbers of the cells; `false` where those of one column differ.
    fn find_units<'a>(&mut self, lines: impl Iterator<Item = &'a str>) -> bool {
        let mut units = vec![String::new(); self.width()];
        for line in lines {
            let unit = |cell: &str| with_unit(cell.trim()).map_or("", |(_, unit)| unit).to_owned();
            for (known, unit) in units.iter_mut().zip(raw(line, self.delimiter, unit)) {
                if known.is_empty() {
                    *known = unit;
                } else if !unit.is_empty() && unit != *known {
                    return false;
                }
            }
        }
        self.suffixes = units.iter().filter(|unit| !unit.is_empty()).cloned().collect();
        self.suffixes.sort();
        self.suffixes.dedup();
        if !self.suffixes.is_empty() && self.units.is_empty() {
            self.units = units;
        }
        true
    }

    /// Finds the headings and the units in the lines before the rows.
    fn find_headings(&mut self, before: &[&str], width: usize) {
        let ends_empty = self.rows.iter().all(|row| row.last().is_some_and(String::is_empty));
        if let Some(headings) = preamble::described(before, width) {
            (self.headings, self.given, self.skip) = (unique(&headings), true, before.len());
            return;
        }
        let cells = |line: &str| -> Option<Vec<String>> {
            let text = uncommented(line).map_or(line, |(_, rest)| rest);
            let separators = [self.delimiter, Some(','), Some(';'), Some('\t'), None];
            let fits = |cells: &Vec<String>| {
                let count = cells.len();
                count == width || (ends_empty && count + 1 == width)
            };
            let whole = |d| preamble::with_row(split(text, d), &self.rows);
            let fitting = separators.into_iter().map(whole).find(fits).map(preamble::uncounted);
            let spaced = || parts::spread_over_parts(&split(text, None), &self.rows);
            fitting.or_else(|| self.delimiter.is_none().then(spaced).flatten())
        };
        let titles = (before.iter().enumerate())
            .filter_map(|(k, line)| Some((k, cells(line)?)))
            .filter(|(_, cells)| cells.iter().all(|c| !is_number(c)));
        let mut titles: Vec<(usize, Vec<String>)> = titles.collect();
        // lines below the headings may have units, and the devices that measure
        let known = |(_, cells): &(usize, Vec<String>)| {
            cells.iter().filter(|c| meaning(c).is_some()).count()
        };
        let best = titles.iter().map(known).max().unwrap_or(0);
        if best >= KNOWN
            && titles.last().is_some_and(|last| known(last) == 0)
            && let Some(k) = titles.iter().rposition(|title| known(title) == best)
        {
            let below: Vec<(usize, Vec<String>)> = titles.drain(k + 1..).collect();
            let units = below.into_iter().find(|(_, cells)| are_units(cells));
            titles.extend(units);
        }
        let mut titles = titles.into_iter();
        let mut last = titles.next_back();
        // or units stand above the headings, as those of Garmin do
        if let Some((_, units)) = titles.clone().next_back().filter(|title| {
            2 * known(title) < best
                && best > 0
                && last.as_ref().is_some_and(|l| known(l) == best)
                && are_units(&title.1)
        }) {
            self.units = units;
            titles.next_back();
        } else if let Some(above) = titles.clone().next_back()
            && let Some((_, units)) = last.clone().filter(|(_, cells)| are_units(cells))
        {
            self.units = units;
            titles.next_back();
            last = Some(above);
        }
        if let Some((place, members)) = last.clone().filter(|(_, cells)| unique(cells) != *cells)
            && let Some((_, groups)) = titles.next_back()
        {
            last = Some((place, grouped(&groups, &members)));
        }
        let blank = |line: &&&str| !line.trim().is_empty();
        let marks: Vec<Option<char>> =
            before.iter().filter(blank).map(|l| uncommented(l).map(|(c, _)| c)).collect();
        let Some((place, headings)) = last else {
            match marks.first() {
                Some(Some(mark)) if marks.iter().all(|m| *m == Some(*mark)) => self.mark(*mark),
                _ => self.skip = if marks.is_empty() { 0 } else { before.len() },
            }
            return;
        };
        let line = before[place];
        let commented = uncommented(line).is_some();
        let same = split(line, self.delimiter) == headings;
        let unique = unique(&headings);
        // a line below the headings that is neither a row nor one of units
        let followed =
            before[place + 1..].iter().any(|l| !l.trim().is_empty() && uncommented(l).is_none());
        let own = !commented && same && unique == headings;
        self.given = !own || followed || !self.units.is_empty();
        self.headings = unique;
        self.headings.resize(width, String::new());
        let plain = marks.iter().filter(|m| m.is_none()).count();
        let mark = marks.iter().flatten().next();
        let one = marks.iter().flatten().all(|m| Some(m) == mark);
        if plain == usize::from(!commented) && one && (commented || !self.given) {
            mark.into_iter().for_each(|mark| self.mark(*mark));
        } else {
            self.skip = if self.given { before.len() } else { place };
        }
    }

    /// Rows that name their values.
    pub fn labelled(
        headings: Vec<String>,
        rows: Vec<Vec<String>>,
        kind: Vec<(usize, String)>,
    ) -> Self {
        Self { labels: true, given: true, headings, rows, kind, ..Self::default() }
    }

    /// The same rows below other headings.
    pub fn renamed(&self, headings: Vec<String>) -> Self {
        Self { headings, given: true, skip: self.before, units: Vec::new(), ..self.clone() }
    }

    /// The rows in the other order.
    pub fn reversed(&self) -> Self {
        let rows = self.rows.iter().rev().cloned().collect();
        let skip = if self.labels { self.skip } else { self.before };
        Self { rows, given: true, skip, backwards: !self.backwards, ..self.clone() }
    }

    fn mark(&mut self, comment: char) {
        if comment != '#' {
            self.comment = Some(comment);
        }
    }

    /// The keys of the source for this layout.
    pub fn keys(&self) -> Vec<String> {
        let mut keys = Vec::new();
        match self.delimiter {
            _ if self.labels => keys.push("labels = true".to_owned()),
            Some(',') => {}
            Some(c) => keys.push(format!("delimiter = {}", quoted(&c.to_string()))),
            None => keys.push("delimiter = \"whitespace\"".to_owned()),
        }
        if self.decimal_comma {
            keys.push("decimal = \",\"".to_owned());
        }
        keys.extend(self.comment.map(|c| format!("comment = \"{c}\"")));
        if self.skip > 0 {
            keys.push(format!("skip = {}", self.skip));
        }
        if self.given {
            let list: Vec<String> = self.of_file().iter().map(|h| quoted(h)).collect();
            keys.push(format!("headings = [{}]", list.join(", ")));
        }
        if self.backwards {
            keys.push("backwards = true".to_owned());
        }
        if self.until > 0 {
            keys.push(format!("until = {}", self.until));
        }
        if !self.vectors.is_empty() {
            let count = |(heading, n): &(String, usize)| format!("{} = {n}", quoted(heading));
            let list: Vec<String> = self.vectors.iter().map(count).collect();
            keys.push(format!("vectors = {{ {} }}", list.join(", ")));
        }
        if !self.suffixes.is_empty() {
            let list: Vec<String> = self.suffixes.iter().map(|s| quoted(s)).collect();
            keys.push(format!("suffixes = [{}]", list.join(", ")));
        }
        let cell = |(k, word): &(usize, String)| {
            Some(format!("{} = {}", quoted(self.headings.get(*k)?), quoted(word)))
        };
        let cells: Vec<String> = self.kind.iter().filter_map(cell).collect();
        if !cells.is_empty() {
            keys.push(format!("rows = {{ {} }}", cells.join(", ")));
        }
        keys
    }

    /// Empties the cells of columns whose numbers stand for no measurement.
    pub fn leave_out(&mut self, columns: &[usize]) {
        for k in columns {
            for number in sentinel::of(&self.column(*k)) {
                self.missing.push((*k, number));
                let cells = self.rows.iter_mut().filter_map(|row| row.get_mut(*k));
                cells.filter(|c| c.parse() == Ok(number)).for_each(String::clear);
            }
        }
    }

    /// The numbers of a column; NaN where a cell has none.
    pub fn column(&self, index: usize) -> Vec<f64> {
        let cell = |row: &Vec<String>| row.get(index).and_then(|c| navfuse_csv::number(c));
        self.rows.iter().map(|row| cell(row).unwrap_or(f64::NAN)).collect()
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.rows.first().map_or(0, Vec::len)
    }
}

/// Headings, of which each occurs once.
fn unique(headings: &[String]) -> Vec<String> {
    let mut seen: HashMap<&str, usize> = HashMap::new();
    let number = |heading: &str, count: usize| match count {
        1 => heading.to_owned(),
        n => format!("{heading} ({n})"),
    };
    headings
        .iter()
        .map(|heading| {
            let count = seen.entry(heading).or_default();
            *count += 1;
            number(heading, *count)
        })
        .collect()
}

#[cfg(test)]
mod tests;
