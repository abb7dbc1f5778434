//! Positions on a map, with the zone in a column or in a heading.

use super::columns::Table;
use super::units::median;
use super::vocabulary::words;
use navfuse_core::document::quoted;

/// Words for easting and northing; letters alone beside `utm`.
const EAST: [&str; 4] = ["easting", "east", "rechtswert", "ost"];
const NORTH: [&str; 4] = ["northing", "north", "hochwert", "nord"];
const LETTERS: [[&str; 2]; 2] = [["e", "x"], ["n", "y"]];
/// Words for the columns of the zone and of its hemisphere.
const ZONE: [&str; 3] = ["zone", "zonenumber", "zoneno"];
const SIDE: [&str; 5] = ["hemisphere", "band", "zoneletter", "letter", "latband"];
/// Eastings within a zone, m: other numbers count from a point of their own.
const WITHIN: std::ops::RangeInclusive<f64> = 1e5..=9e5;

/// The words of a heading without `utm` and the zone beside it, and the zone.
fn parts(heading: &str) -> (String, bool, Option<String>) {
    let name = heading.split(['[', '(']).next().unwrap_or_default();
    let (mut rest, mut map, mut zone) = (Vec::new(), false, None);
    let words = words(name);
    let mut words = words.iter().map(String::as_str).peekable();
    while let Some(word) = words.next() {
        let Some(number) = word.strip_prefix("utm") else {
            rest.push(word);
            continue;
        };
        map = true;
        let digits = number.trim_end_matches(['n', 's']);
        let side = number.strip_prefix(digits).filter(|side| !side.is_empty());
        let beside = || words.next_if(|word| ["n", "s"].contains(word));
        if digits.parse::<u8>().is_ok() {
            zone = side.or_else(beside).map(|side| format!("{digits}{}", side.to_uppercase()));
        }
    }
    (rest.concat(), map, zone)
}

impl Table<'_> {
    /// The keys of a position in easting and northing, with the zone; `None` for other positions, and
    /// where no column names the zone.
    pub(super) fn on_map(&self) -> Option<(Vec<String>, String)> {
        let [east, north] = self.easting_and_northing()?;
        let zone = self.layout.headings.iter().find_map(|h| parts(h).2).or_else(|| self.zone())?;
        let [from, up] = [east, north].map(|k| quoted(self.heading(k)));
        let key = |channel: &str| {
            let zone = quoted(&zone);
            format!("columns.{channel} = {{ column = {from}, north = {up}, zone = {zone} }}")
        };
        let question = format!("{from} and {up} are taken for UTM in the zone {zone}, WGS-84");
        Some((["lat", "lon"].map(key).to_vec(), question))
    }

    /// The columns of easting and northing.
    pub(super) fn easting_and_northing(&self) -> Option<[usize; 2]> {
        let column = |names: [&str; 4], letters: [&str; 2]| {
            self.layout.headings.iter().position(|heading| {
                let (rest, map, _) = parts(heading);
                names.contains(&rest.as_str()) || (map && letters.contains(&rest.as_str()))
            })
        };
        let found = [column(EAST, LETTERS[0])?, column(NORTH, LETTERS[1])?];
        let middle = median(self.layout.column(found[0]).into_iter().filter(|v| *v != 0.0));
        WITHIN.contains(&middle).then_some(found)
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
