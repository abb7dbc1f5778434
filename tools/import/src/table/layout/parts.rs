//! Headings of angles that stand over degrees, minutes and seconds, as in the tables of GrafNav.

use crate::table::vocabulary::meaning;

/// Parts of an angle.
const PARTS: [&str; 3] = ["deg", "min", "sec"];

/// Tests whether a cell of a line of units is part of those of an angle, `(+/-D M S)`.
pub(super) fn is_part(cell: &str) -> bool {
    let letters = cell.trim_matches(|c: char| !c.is_ascii_alphabetic()).to_ascii_lowercase();
    PARTS.iter().any(|part| *part == letters || part[..1] == letters)
}

/// The headings of all columns, if those of latitude and longitude stand over three columns each whose numbers in the rows
/// are degrees, minutes and seconds.
pub(super) fn spread_over_parts(titles: &[String], rows: &[Vec<String>]) -> Option<Vec<String>> {
    let angle = |title: &str| meaning(title).is_some_and(|m| ["lat", "lon"].contains(&m.channel));
    let angles = titles.iter().filter(|title| angle(title)).count();
    let width = rows.first()?.len();
    if angles != 2 || titles.len() + angles * (PARTS.len() - 1) != width {
        return None;
    }
    let mut headings = Vec::with_capacity(width);
    for title in titles {
        if !angle(title) {
            headings.push(title.clone());
            continue;
        }
        let first = headings.len();
        let in_parts = |row: &Vec<String>| {
            let cell = |k: usize| row.get(first + k).and_then(|cell| cell.parse::<f64>().ok());
            let [degrees, minutes, seconds] = [cell(0)?, cell(1)?, cell(2)?];
            let whole = degrees.fract() == 0.0 && minutes.fract() == 0.0;
            let part = |value: f64| (0.0..60.0).contains(&value);
            (whole && degrees.abs() <= 360.0 && part(minutes) && part(seconds)).then_some(())
        };
        if !rows.iter().all(|row| in_parts(row).is_some()) {
            return None;
        }
        headings.extend(PARTS.iter().map(|part| format!("{title} {part}")));
    }
    Some(headings)
}
