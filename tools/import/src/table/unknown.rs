//! The reason why a table has no sensor, with a remedy.

use super::columns::Table;
use super::vocabulary::{self, meaning, words};

/// Words for a column that names what a row has, and for that of its value.
const NAMES: [&str; 8] =
    ["field", "signal", "variable", "channel", "name", "key", "parameter", "metric"];
const VALUES: [&str; 2] = ["value", "reading"];
/// Brackets around the unit of a heading.
const BRACKETS: [[char; 2]; 3] = [['[', ']'], ['(', ')'], ['{', '}']];

/// The reason why a table without a known time is refused whose rows have one value each; `None` for other tables.
pub fn one_value(text: &str) -> Option<String> {
    let titles = |line: &str| -> Option<String> {
        let cells: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        let named = |names: &[&str]| {
            cells.iter().find(|cell| names.contains(&words(cell).concat().as_str())).copied()
        };
        let (name, value) = (named(&NAMES)?, named(&VALUES)?);
        let known = cells.iter().filter_map(|cell| meaning(cell));
        let measured = known.filter(|m| !["time", "date", "week"].contains(&m.channel)).count();
        (measured == 0).then(|| {
            format!(
                "each row has one {value}, which its cell {name} names: write a table whose rows have all values of \
                 a time, with `pivot` of pandas or of Flux"
            )
        })
    };
    text.lines().take(20).find_map(titles)
}

/// The reason why sentences of NMEA 0183 are refused that have no sensor; `None` for other text.
pub fn sentences(text: &str) -> Option<String> {
    let address = |line: &str| {
        let (_, sentence) = line.split_once('$')?;
        let (sentence, check) = sentence.trim_end().split_once('*')?;
        let address = sentence.split(',').next()?;
        let known = address.len() > 3 && address.bytes().all(|b| b.is_ascii_alphanumeric());
        (known && check.len() == 2).then(|| format!("${address}"))
    };
    let lines = text.lines().filter(|line| !line.trim().is_empty()).count();
    let mut addresses: Vec<String> = text.lines().filter_map(address).collect();
    if 2 * addresses.len() <= lines {
        return None;
    }
    addresses.sort();
    addresses.dedup();
    Some(format!(
        "its sentences of NMEA 0183 ({}) are none that navfuse reads: record GGA and RMC for a position, HDT or THS \
         for a heading, or write their fields as a table",
        addresses.join(", ")
    ))
}

impl Table<'_> {
    /// What stands for the unit of a column, in brackets behind its heading or in the line of units, and is none that is
    /// known.
    pub(super) fn unknown_unit(&self, k: usize) -> Option<&str> {
        let own = self.layout.units.get(k).map(String::as_str).filter(|unit| !unit.is_empty());
        let bracketed = |[open, close]: &[char; 2]| {
            let (_, rest) = self.layout.headings.get(k)?.split_once(*open)?;
            Some(rest.split_once(*close)?.0)
        };
        let unit = own.or_else(|| BRACKETS.iter().find_map(bracketed))?;
        let index = unit.trim().parse::<usize>().is_ok();
        (!index && vocabulary::expression(unit).is_none()).then_some(unit)
    }

    /// The reason why no sensor is recognised.
    pub(super) fn unknown(&self) -> String {
        let list = self.listed();
        if self.easting_and_northing().is_some() {
            return format!(
                "its positions are easting and northing on a map, and no column among {list} names the \
                 zone of UTM: add a column `zone` with one such as 32N, or write latitude and \
                 longitude (cs2cs of PROJ converts them)"
            );
        }
        if self.beams().len() > 1 {
            return format!(
                "its velocities are along the beams of a velocity log ({list}), of which three or four give \
                 a velocity: write a scenario with a sensor of type dvl-beams and its beams"
            );
        }
        let axes = |h: &String| vocabulary::axis(h).is_some();
        if self.layout.headings.iter().filter(|h| axes(h)).count() >= 3 {
            return format!(
                "the columns {list} name axes alone, which may be a position, a velocity or a force: \
                 name the quantity, as accel_x_mps2, vel_x_mps, or lat_deg, lon_deg and height_m"
            );
        }
        format!(
            "no sensor is recognised by its columns {list}; rename them, such as gyro_x_radps, or map \
             them with `columns` in a scenario"
        )
    }
}
