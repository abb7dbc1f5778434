//! Files of Racelogic VBOX: sections in brackets, times of the day, minutes of an arc, and longitudes that are positive to
//! the west.

use super::layout::Layout;
use super::measured::measured;
use crate::found::Found;

/// The sections of the names of the columns, of their descriptions, and of the rows.
const NAMES: &str = "[column names]";
const DESCRIPTIONS: &str = "[header]";
const ROWS: &str = "[data]";

/// The heading of a column in the words of the vocabulary.
fn heading(described: &str) -> String {
    let lower = described.trim().to_lowercase();
    match lower.as_str() {
        "time" => "utc".to_owned(),
        "lat" | "latitude" => "latitude [arcmin]".to_owned(),
        "long" | "longitude" => "longitude [arcmin]".to_owned(),
        // the direction of the motion
        "heading" => "course".to_owned(),
        "velocity" => "velocity kmh".to_owned(),
        "vert-vel" | "vertical velocity kmh" => "velocity up [km/h]".to_owned(),
        "vertical velocity m/s" => "velocity up [m/s]".to_owned(),
        _ => described.trim().to_owned(),
    }
}

/// The sensors of a file; `None` for any other file.
pub fn sensors(text: &str) -> Option<Result<Vec<Found>, String>> {
    let lines: Vec<&str> = text.split('\n').map(str::trim).collect();
    let section = |name: &str| lines.iter().position(|line| line.eq_ignore_ascii_case(name));
    let (names, rows) = (section(NAMES)?, section(ROWS)?);
    let names: Vec<&str> = lines.get(names + 1)?.split_whitespace().collect();
    let described = section(DESCRIPTIONS).map(|begin| {
        let named = |line: &&&str| !line.is_empty() && !line.starts_with('[');
        lines[begin + 1..].iter().take_while(named).copied().collect::<Vec<&str>>()
    });
    let described = described.filter(|list| list.len() == names.len()).unwrap_or(names);
    let headings: Vec<String> = described.into_iter().map(heading).collect();
    let Some(mut layout) = Layout::of(&(lines[rows + 1..].join("\n"))) else {
        return Some(Err("it is a file of Racelogic VBOX without rows".to_owned()));
    };
    if layout.width() != headings.len() {
        let text = format!(
            "it is a file of Racelogic VBOX with {} columns in {NAMES} and {} in its rows",
            headings.len(),
            layout.width()
        );
        return Some(Err(text));
    }
    layout.headings = headings;
    layout.given = true;
    layout.skip = rows + 1;
    let mut found = measured(layout, "", Vec::new());
    for sensor in found.iter_mut().flatten() {
        for key in sensor.source.iter_mut().filter(|key| key.starts_with("columns.lon")) {
            *key = key.replace("\"arcmin\"", "\"arcmin\", scale = -1");
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_longitude_counts_to_the_west_and_a_heading_is_a_course() {
        let row =
            |k: usize| format!("12 2213{k}.00 +02430.5{k} +06312.4{k} 43.2 120.{k} +1600.0\n");
        let rows: String = (10..30).map(row).collect();
        let text = format!(
            "File created on 14/11/2023\n\n[header]\nsatellites\ntime\nlatitude\nlongitude\nvelocity kmh\nheading\n\
             height\n\n[column names]\nsats time lat long velocity heading height\n\n[data]\n{rows}"
        );
        let found = sensors(&text).and_then(Result::ok).unwrap_or_default();
        assert_eq!(found.len(), 1);
        let source = &found[0].source;
        let has = |key: &str| source.iter().any(|line| line.starts_with(key));
        assert!(has("skip = 15") && has("columns.vel_n"), "{source:?}");
        assert!(
            has("columns.lon = { column = \"longitude [arcmin]\", unit = \"arcmin\", scale = -1 }"),
            "{source:?}"
        );
    }
}
