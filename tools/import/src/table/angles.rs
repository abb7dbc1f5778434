//! The units of latitudes, longitudes and attitudes.

use super::columns::Table;
use super::units;

/// The unit of integers of latitude and longitude, for a question.
pub const IN_E7: &str = "1e-7 deg (or semicircles)";

impl Table<'_> {
    /// Unit and factor of latitude and longitude, and `true` for degrees with minutes.
    pub(super) fn place(&self, questions: &mut Vec<String>) -> (String, f64, bool) {
        let (lat, lon) = (self.values("lat"), self.values("lon"));
        let (unit, mut scale, minutes) = units::angle(&lat, &lon);
        if scale == units::E7 && self.in_semicircles() {
            scale = units::SEMICIRCLE;
        }
        let stated = self.find("lat").and_then(|(_, m)| m.unit.clone());
        let text = match (unit, scale, minutes) {
            (_, _, true) => "ddmm.mmmm",
            (unit, 1.0, _) => unit,
            (_, units::E7, _) => IN_E7,
            _ => "semicircles",
        };
        let why = if text == "semicircles" {
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

    /// Tests whether a column holds whole numbers alone.
    pub(super) fn is_whole(&self, k: usize) -> bool {
        self.layout.column(k).iter().all(|v| !v.is_finite() || v.fract() == 0.0)
    }

    /// -1 where the column after one of positive numbers names the south or the west.
    pub(super) fn hemisphere(&self, k: usize) -> f64 {
        let other =
            |row: &Vec<String>| row.get(k + 1).is_some_and(|cell| cell == "S" || cell == "W");
        if self.layout.rows.iter().all(other) { -1.0 } else { 1.0 }
    }
}

/// The unit of an angle by its range.
pub(super) fn turned(values: &[f64]) -> &'static str {
    let largest = values.iter().filter(|v| v.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()));
    if largest > 6.3 { "deg" } else { "rad" }
}
