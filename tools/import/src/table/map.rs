//! Positions on a map, with the zone in a column or in a heading, or from a point that an answer gives.

use super::columns::Table;
use super::units::median;
use super::vocabulary::{self, Meaning, words};
use crate::found::{ORIGIN, point};
use navfuse_core::document::quoted;

/// Words for easting and northing; letters alone beside `utm`.
const EAST: [&str; 4] = ["easting", "east", "rechtswert", "ost"];
const NORTH: [&str; 4] = ["northing", "north", "hochwert", "nord"];
const LETTERS: [[&str; 2]; 2] = [["e", "x"], ["n", "y"]];
/// Words for the columns of the zone and of its hemisphere.
const ZONE: [&str; 3] = ["zone", "zonenumber", "zoneno"];
const SIDE: [&str; 5] = ["hemisphere", "band", "zoneletter", "letter", "latband"];
/// Axes before other words for them.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Words for the height above a point.
const UP: [&str; 5] = ["up", "u", "height", "altitude", "alt"];
/// The word for the distance below it.
const DOWN: &str = "down";
/// Metres, from which coordinates are no velocities.
const FAR: f64 = 30.0;
/// Eastings within a zone, m: other numbers count from a point of their own.
const WITHIN: std::ops::RangeInclusive<f64> = 1e5..=9e5;

/// The words of a heading without `utm` and the zone beside it, and the zone.
fn parts(heading: &str) -> (String, bool, Option<String>) {
    let name = heading.split(['[', '(']).next().unwrap_or_default();
    let (mut rest, mut map, mut zone) = (Vec::new(), false, None);
    let words = words(name);
    let mut words = words.iter().map(String::as_str).peekable();
    while let Some(word) = words.next() {
        let number = match word.strip_prefix("utm") {
            Some(number) => number,
            // as `UTM Easting 32T`
            None if map && word.starts_with(|c: char| c.is_ascii_digit()) => word,
            None => {
                rest.push(word);
                continue;
            }
        };
        map = true;
        let digits = number.trim_end_matches(|c: char| c.is_ascii_lowercase());
        let side = number.strip_prefix(digits).filter(|side| !side.is_empty());
        // a letter behind the easting is none of its words
        let letter = |word: &&str| word.len() == 1 && !rest.is_empty();
        let beside = || words.next_if(|word| ["n", "s"].contains(word) || letter(word));
        if digits.parse::<u8>().is_ok() {
            zone = side.or_else(beside).map(|side| format!("{digits}{}", side.to_uppercase()));
        }
    }
    // as `easting_m`
    if rest.len() > 1 && rest.last() == Some(&"m") {
        rest.pop();
    }
    (rest.concat(), map, zone)
}

impl Table<'_> {
    /// The keys of a position in easting and northing, with the zone; `None` for other positions, and
    /// where no column names the zone.
    fn on_map(&self) -> Option<(Vec<String>, String)> {
        let [east, north] = self.easting_and_northing()?;
        let named = self.layout.headings.iter().find_map(|h| parts(h).2).or_else(|| self.zone());
        let zone = named.or_else(|| self.layout.zone.clone())?;
        let [from, up] = [east, north].map(|k| quoted(self.heading(k)));
        let key = |channel: &str| {
            let zone = quoted(&zone);
            format!("columns.{channel} = {{ column = {from}, north = {up}, zone = {zone} }}")
        };
        let question = format!("{from} and {up} are taken for UTM in the zone {zone}, WGS-84");
        Some((["lat", "lon"].map(key).to_vec(), question))
    }

    /// The keys of a position that is no latitude and longitude in two columns, and a question.
    pub(super) fn placed(&self) -> Option<(Vec<String>, String)> {
        self.on_map().or_else(|| self.in_one_column()).or_else(|| self.beside_point())
    }

    /// The keys of a position east, north and up of a point, which an answer gives.
    fn beside_point(&self) -> Option<(Vec<String>, String)> {
        let [east, north] = self.local().filter(|_| self.easting_and_northing().is_none())?;
        let named = |h: &&String| {
            words(h).iter().find(|w| *w != AXES[2]).is_some_and(|w| UP.contains(&w.as_str()))
        };
        let below = |h: &&String| {
            let name = h.split(['[', '(']).next().unwrap_or_default();
            words(name).first().is_some_and(|w| w == DOWN) && !h.contains('/')
        };
        let up = self.layout.headings.iter().find(named).map(|h| ("up", h));
        let up = up.or_else(|| self.layout.headings.iter().find(below).map(|h| (DOWN, h)));
        let channels: &[&str] =
            if up.is_some() { &["lat", "lon", "height"] } else { &["lat", "lon"] };
        let more = up.map_or_else(String::new, |(side, h)| format!(", {side} = {}", quoted(h)));
        let [from, to] = [east, north].map(|k| quoted(self.heading(k)));
        let stated = self.layout.origin.map(point);
        let place = if stated.is_some() { "point above the table" } else { "position given" };
        let origin = stated.unwrap_or_else(|| ORIGIN.to_owned());
        let key = |channel: &&str| {
            format!(
                "columns.{channel} = {{ column = {from}, north = {to}{more}, origin = {origin} }}"
            )
        };
        let question =
            format!("{from} and {to} are taken for metres east and north of the {place}");
        Some((channels.iter().map(key).collect(), question))
    }

    /// The columns of coordinates east and north of a point.
    pub(super) fn local(&self) -> Option<[usize; 2]> {
        let column = |names: [&str; 4], letter: &str| {
            self.layout.headings.iter().position(|heading| {
                let mut words = words(heading.split(['[', '(']).next().unwrap_or_default());
                // as x_east
                if words.len() == 2 && AXES.contains(&words[0].as_str()) {
                    words.remove(0);
                }
                let alone = words.len() == 1 || words.get(1).is_some_and(|unit| unit == "m");
                let word = words.first().map(String::as_str).unwrap_or_default();
                names.contains(&word) || (alone && word == letter)
            })
        };
        let [east, north] = [column(EAST, "e")?, column(NORTH, "n")?];
        let far = |k: usize| {
            let values = self.layout.column(k);
            let first = values.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
            median(values.iter().map(|v| v.abs())) > FAR
                || values.iter().any(|v| (v - first).abs() > FAR)
        };
        (far(east) || far(north)).then_some([east, north])
    }

    /// The columns of easting and northing.
    pub(super) fn easting_and_northing(&self) -> Option<[usize; 2]> {
        let column = |names: [&str; 4], letters: [&str; 2]| {
            self.layout.headings.iter().position(|heading| {
                let (rest, map, _) = parts(heading);
                let map = map || self.layout.zone.is_some();
                names.contains(&rest.as_str()) || (map && letters.contains(&rest.as_str()))
            })
        };
        let found = [column(EAST, LETTERS[0])?, column(NORTH, LETTERS[1])?];
        let middle = median(self.layout.column(found[0]).into_iter().filter(|v| *v != 0.0));
        WITHIN.contains(&middle).then_some(found)
    }

    /// Takes `z` beside x and y on a map, whose zone a line above the table states, for the height.
    pub(super) fn height_of_map(&mut self) {
        let axis = |h: &String| vocabulary::axis(h).is_some_and(|(axis, ..)| axis == 2);
        let column = self.layout.headings.iter().position(axis);
        let alone = self.layout.zone.is_some() && self.find("height").is_none();
        if let Some(k) = column.filter(|_| alone && self.easting_and_northing().is_some()) {
            let unit = vocabulary::axis(self.heading(k)).and_then(|(.., unit)| unit);
            self.columns.retain(|(other, _)| *other != k);
            self.columns.push((k, Meaning { channel: "height", unit, sign: 1.0, rank: 0 }));
        }
    }

    /// The zone in a column, which has the same zone in each row.
    fn zone(&self) -> Option<String> {
        let cell = |names: &[&str]| {
            let named = |h: &String| names.contains(&parts(h).0.as_str());
            let k = self.layout.headings.iter().position(named)?;
            let first = self.layout.rows.first()?.get(k)?;
            let same = self.layout.rows.iter().all(|row| row.get(k) == Some(first));
            same.then(|| first.clone())
        };
        let zone = cell(&ZONE)?;
        match zone.parse::<u8>() {
            Ok(number) => {
                let side = cell(&SIDE)?.chars().next()?.to_ascii_uppercase();
                Some(format!("{number}{side}"))
            }
            Err(_) => Some(zone),
        }
    }
}
