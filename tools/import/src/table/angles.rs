//! The units of latitudes, longitudes and attitudes.

use super::columns::Table;
use super::units;
use super::vocabulary::words;
use navfuse_core::document::quoted;
use std::f64::consts::{FRAC_PI_2, TAU};

/// The unit of integers of latitude and longitude, for a question.
pub const IN_E7: &str = "1e-7 deg (or semicircles)";

impl Table<'_> {
    /// Unit and factor of latitude and longitude, and `true` for degrees with minutes.
    pub(super) fn place(&self, questions: &mut Vec<String>) -> (String, f64, bool) {
        let (lat, lon) = (self.values("lat"), self.values("lon"));
        let stated = self.find("lat").and_then(|(_, m)| m.unit.clone());
        // minutes and seconds of an arc have no other range than degrees in other notations
        let arc = stated.as_ref().filter(|unit| !["deg", "rad"].contains(&unit.as_str()));
        let most = |values: &[f64]| {
            values.iter().filter(|v| v.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()))
        };
        if let Some(unit) = arc
            && most(&lat) * units::factor(unit) <= FRAC_PI_2
            && most(&lon) * units::factor(unit) <= TAU
        {
            return (unit.clone(), 1.0, false);
        }
        let (mut unit, mut scale, mut minutes) = units::angle(&lat, &lon);
        let either = minutes && stated.is_none() && units::in_minutes(most(&lat), most(&lon));
        let either = either && !self.is_padded("lat") && !self.is_padded("lon");
        if either && self.in_minutes() {
            (unit, scale, minutes) = ("arcmin", 1.0, false);
        } else if either && !self.has(&["vel_n", "vel_e"]) && !self.has(&["speed", "course"]) {
            questions.push("latitude and longitude may be minutes of an arc, too".to_owned());
        }
        if scale == units::E7 && self.names_part("e6") {
            scale = 1e-6;
        }
        if scale == units::E7 && self.in_semicircles() {
            scale = units::SEMICIRCLE;
        }
        let text = match (unit, scale, minutes) {
            (_, _, true) => "ddmm.mmmm",
            ("arcmin", ..) => "minutes of an arc",
            (unit, 1.0, _) => unit,
            (_, units::E7, _) => IN_E7,
            (_, 1e-6, _) => "1e-6 deg",
            (_, 1e-8, _) => "1e-8 deg",
            (_, 1e-9, _) => "1e-9 deg",
            _ => "semicircles",
        };
        let why = if ["semicircles", "minutes of an arc"].contains(&text) {
            "a heading, their range, or the velocity"
        } else {
            "their range"
        };
        match stated {
            Some(stated) if stated == unit && text == unit => {}
            // small degrees are possible
            Some(stated) if stated == "deg" && unit == "rad" => return (stated, 1.0, false),
            Some(stated) => questions.push(format!(
                "the headings of latitude and longitude mean {stated}, but their range is one of \
                 {text}: {text} is used"
            )),
            None => questions.push(format!("the unit of latitude and longitude: {text} by {why}")),
        }
        (unit.to_owned(), scale, minutes)
    }

    /// Tests whether latitudes and longitudes are degrees, minutes and seconds in one number, ddmmss.s.
    pub(super) fn is_packed(&self) -> bool {
        let [lat, lon] = ["lat", "lon"].map(|c| self.values(c));
        let parts =
            |values: &[f64], most: f64| {
                values.iter().filter(|v| v.is_finite()).map(|v| v.abs()).all(|v| {
                    v % 100.0 < 60.0 && (v / 100.0).trunc() % 100.0 < 60.0 && v / 1e4 < most
                })
            };
        let large = lat.iter().any(|v| v.abs() > 9_100.0) || lon.iter().any(|v| v.abs() > 18_100.0);
        // parts of a degree are whole numbers
        let fractions = |values: &[f64]| values.iter().any(|v| v.is_finite() && v.fract() != 0.0);
        large && parts(&lat, 91.0) && parts(&lon, 181.0) && fractions(&lat) && fractions(&lon)
    }

    /// The unit of roll, pitch and yaw, which is the same: a small roll stands beside a yaw in degrees.
    pub(super) fn turned(&self) -> &'static str {
        turned(&["roll", "pitch", "yaw"].map(|angle| self.values(angle)).concat())
    }

    /// Names the direction beside a speed the course, where the positions move along it: a receiver calls it heading, too.
    pub(super) fn name_course(&mut self) {
        let direction = ["lat", "lon", "speed", "yaw"];
        let others = ["course", "vel_n", "roll", "pitch"];
        if !self.has(&direction) || others.iter().any(|c| self.find(c).is_some()) {
            return;
        }
        let rename = |table: &mut Self, from: &str, to: &'static str| {
            let named = table.columns.iter_mut().filter(|(_, m)| m.channel == from);
            named.for_each(|(_, meaning)| meaning.channel = to);
        };
        rename(self, "yaw", "course");
        let (unit, scale, minutes) = self.place(&mut Vec::new());
        if self.beside_track(units::factor(&unit) * scale, minutes).is_none() {
            rename(self, "course", "yaw");
        }
    }

    /// Tests whether the numbers of a latitude or longitude begin with a zero, or stand beside a letter for their side, as
    /// degrees with minutes do.
    fn is_padded(&self, channel: &str) -> bool {
        let Some((k, _)) = self.find(channel) else { return false };
        let padded = |cell: &String| {
            let digits = cell.trim_start_matches('-').as_bytes();
            digits.len() > 1 && digits[0] == b'0' && digits[1].is_ascii_digit()
        };
        let mut cells = self.layout.rows.iter().filter_map(|row| row.get(*k));
        cells.any(padded) || !self.side(*k, channel).is_empty()
    }

    /// Tests whether a column holds whole numbers alone.
    pub(super) fn is_whole(&self, k: usize) -> bool {
        self.layout.column(k).iter().all(|v| !v.is_finite() || v.fract() == 0.0)
    }

    /// The key for the column beside one of a latitude or longitude that names its side in each row.
    pub(super) fn side(&self, k: usize, channel: &str) -> String {
        let sides = if channel == "lat" { ["N", "S"] } else { ["E", "W"] };
        let named = |k: &usize| {
            let cells = || self.layout.rows.iter().map(|row| row.get(*k).map_or("", |c| c));
            cells().all(|c| c.is_empty() || sides.contains(&c)) && cells().any(|c| !c.is_empty())
        };
        let beside = [Some(k + 1), k.checked_sub(1)].into_iter().flatten();
        let found = beside.filter(|k| *k < self.layout.headings.len()).find(named);
        found.map_or_else(String::new, |k| format!(", side = {}", quoted(self.heading(k))))
    }

    /// Tests whether the headings of latitude and longitude name a part of a degree.
    fn names_part(&self, part: &str) -> bool {
        let named = |c: &str| {
            self.find(c).is_some_and(|(k, _)| words(self.heading(*k)).iter().any(|w| w == part))
        };
        named("lat") && named("lon")
    }
}

/// The unit of angles by their range.
pub(super) fn turned(values: &[f64]) -> &'static str {
    let largest = values.iter().filter(|v| v.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()));
    if largest > 6.3 { "deg" } else { "rad" }
}
