//! The cells of a line, and what they look like: numbers, dates, units.

use super::super::vocabulary::expression;
use super::parts;

/// Filled cells of a line of units for each word that is no unit, below a line of headings.
const WORDS: usize = 3;
/// Longest date, or time of the day.
const LONGEST_STAMP: usize = 18;

/// The cells of a line, without quotation marks and units.
pub(super) fn split(line: &str, delimiter: Option<char>) -> Vec<String> {
    let clean = |cell: &str| {
        let cell = cell.trim().trim_matches('"').trim();
        // as the source reads a quoted number between commas
        let commas = delimiter == Some(',');
        let read = || navfuse_csv::ungrouped(cell.as_bytes(), commas);
        let plain = cell.contains(',').then(read).flatten();
        let number = || with_unit(cell).map_or(cell, |(number, _)| number).to_owned();
        plain.and_then(|n| String::from_utf8(n).ok()).unwrap_or_else(number)
    };
    raw(line, delimiter, clean)
}

/// A number with a known unit after it.
pub(super) fn with_unit(cell: &str) -> Option<(&str, &str)> {
    navfuse_csv::with_unit(cell).filter(|(_, unit)| expression(unit).is_some())
}

/// The cells of a line, each of them changed.
pub(super) fn raw(
    line: &str,
    delimiter: Option<char>,
    clean: impl Fn(&str) -> String,
) -> Vec<String> {
    let Some(delimiter) = delimiter else {
        let (mut quoted, mut begins) = (false, true);
        let apart = |c: char| {
            quoted ^= c == '"' && (begins || quoted);
            begins = c.is_whitespace() && !quoted;
            begins
        };
        return line.split(apart).filter(|cell| !cell.is_empty()).map(clean).collect();
    };
    // a quotation mark within a cell is a second of an arc
    let (mut quote, mut begins) = (false, true);
    let outside = |c: char| {
        quote = if c == '"' { begins && !quote } else { quote };
        begins = !quote && (c == delimiter || (begins && c == ' '));
        c == delimiter && !quote
    };
    line.trim_end_matches('\r').split(outside).map(clean).collect()
}

pub(super) fn is_number(cell: &str) -> bool {
    navfuse_csv::number(cell).is_some()
}

/// Tests whether a cell holds a latitude and a longitude, or digits and the name of a month.
fn is_several(cell: &str) -> bool {
    navfuse_csv::coordinates(cell, false).is_some()
        || is_sided(cell)
        || navfuse_csv::date(cell).is_some()
        || navfuse_csv::vector(cell).len() > 2
}

/// Tests whether a cell has degrees, minutes and perhaps seconds with their side, `48°06'00.1"N`.
fn is_sided(cell: &str) -> bool {
    let parts = cell.split(|c: char| !c.is_ascii_digit() && c != '.').filter(|p| !p.is_empty());
    let marks = |c: char| c.is_ascii_digit() || ". -°'\"′″NSEW".contains(c);
    cell.contains('°') && cell.chars().all(marks) && (2..=3).contains(&parts.count())
}

/// Tests whether a cell looks like a date or a time of the day.
fn is_stamp(cell: &str) -> bool {
    let part = |c: char| c.is_ascii_digit() || [':', '/', '-', '.'].contains(&c);
    let short = cell.len() <= LONGEST_STAMP && cell.matches('.').count() <= 2;
    short && cell.starts_with(|c: char| c.is_ascii_digit()) && cell.chars().all(part)
}

/// Cells with numbers, if at least half of the cells that are neither empty nor stamps are numbers.
pub(super) fn numbers(cells: &[String]) -> Option<usize> {
    let (mut numbers, mut words) = (0, 0);
    for cell in cells.iter().filter(|c| cells.len() > 1 && !c.is_empty()) {
        if is_number(cell) {
            numbers += 1;
        } else if !navfuse_csv::is_absent(cell) && !is_stamp(cell) {
            *(if is_several(cell) { &mut numbers } else { &mut words }) += 1;
        }
    }
    (numbers > 0 && words <= numbers).then_some(numbers)
}

/// Tests whether a cell has the pattern of a date or of a time, `yyyy-mm-dd`.
fn is_pattern(cell: &str) -> bool {
    let mut parts = cell.split(['-', ':', '/', '.']);
    cell.len() > 3 && parts.all(|p| !p.is_empty() && p.chars().all(|c| "ymdhs".contains(c)))
}

/// Tests whether cells below headings are units: all that are not empty, and one with two letters.
pub(super) fn are_units(cells: &[String]) -> bool {
    let bracketed = |cell: &str| cell.starts_with(['(', '[']) && cell.ends_with([')', ']']);
    let unit = |cell: &String| {
        let empty = cell.is_empty() || is_pattern(cell);
        // a unit may have a factor, as `1e-7deg`
        let factor = cell.find(|c: char| c.is_alphabetic() && c != 'e').unwrap_or(0);
        let plain = if is_number(cell[..factor].trim()) { &cell[factor..] } else { cell };
        empty || bracketed(cell) || parts::is_part(cell) || expression(plain).is_some()
    };
    let (units, filled) =
        (cells.iter().filter(|c| unit(c)), cells.iter().filter(|c| !c.is_empty()));
    let others = cells.len() - units.count();
    // a few columns may have words in place of a unit
    WORDS * others <= filled.count() && cells.iter().any(|cell| cell.len() > 1)
}
