//! A depth by the pressure of water: which unit it has, and whether it counts from vacuum or from the air at the surface.
//!
//! Words of the heading and the range of the numbers exclude most readings. Where several remain, an answered height at
//! the start excludes those that are far from it; else the bias of the depth covers them, and the likelihood of the
//! samples decides between their units, which move at different speeds.

use navfuse_core::document::quoted;
use navfuse_core::units::parse_unit;

/// Words of a pressure above the one at the surface, and of one above vacuum.
const GAUGE: [&str; 8] = ["sea", "gauge", "gage", "relative", "rel", "psig", "barg", "dbarg"];
const ABSOLUTE: [&str; 4] = ["abs", "absolute", "psia", "bara"];
/// Units of a pressure without a stated one, with the least number of each in water or air: the first one is the
/// likeliest. A smaller number is a pressure above the one at the surface.
const BY_SIZE: [(&str, f64); 3] = [("Pa", 2e4), ("hPa", 500.0), ("kPa", 80.0)];
/// All units that are possible.
const UNITS: [&str; 6] = ["Pa", "hPa", "kPa", "bar", "dbar", "psi"];
/// Largest pressure of the air, Pa, and the change by which a pressure is one of water: 30 cm.
const AIR: f64 = 1.1e5;
const WATER: f64 = 3e3;
/// The least pressure of the air at a lake in the mountains, Pa, and near the sea: units of meteorology are those of
/// sensors that count from vacuum, and small numbers in the larger ones are those of others.
const LEAST_AIR: [f64; 2] = [5e4, 9e4];
const METEOROLOGY: f64 = 1e3;
/// Pressures of the air at sea level, bar.
const SURFACE: std::ops::RangeInclusive<f64> = 0.97..=1.05;
/// The air at the surface, Pa, and the pressure of a metre of water.
const ATMOSPHERE: f64 = 101_325.0;
const METRE: f64 = 1.005e4;
/// Depths that are possible without a stated unit, m, and how much farther from an answer than the nearest depth one is
/// that the answer excludes: an answer may be some metres off.
const POSSIBLE: std::ops::RangeInclusive<f64> = -2.0..=1000.0;
const FARTHER: f64 = 8.0;
/// Least 1-sigma of the bias that covers several readings, m.
const LEAST_BIAS: f64 = 10.0;

/// One way to read the numbers.
#[derive(Clone, Debug, PartialEq)]
struct Reading {
    unit: String,
    absolute: bool,
    /// Depth in the first row, m.
    depth: f64,
}

fn size(unit: &str) -> f64 {
    parse_unit(unit).map_or(f64::NAN, |unit| unit.to_si(1.0))
}

impl Reading {
    fn new(unit: &str, absolute: bool, number: f64) -> Self {
        let air = if absolute { ATMOSPHERE } else { 0.0 };
        Self { unit: unit.to_owned(), absolute, depth: (number * size(unit) - air) / METRE }
    }
}

/// A column with a pressure, and the ways to read it, of which the first is used.
#[derive(Clone, Debug)]
pub struct Pressure {
    column: String,
    readings: Vec<Reading>,
    /// Set if an answer decided between them.
    answered: bool,
}

impl Pressure {
    /// The pressure in a column, whose heading and unit consist of these words; `None` for a pressure of air.
    pub fn of(
        column: &str,
        words: &[String],
        values: &[f64],
        stated: Option<&str>,
    ) -> Option<Self> {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (least, most) =
            finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let first = finite().next()?;
        let named = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
        let counts = match () {
            () if named(&GAUGE) => Some(false),
            () if named(&ABSOLUTE) => Some(true),
            () => None,
        };
        let by_size = || BY_SIZE.iter().find(|(_, number)| least >= *number).map(|(unit, _)| *unit);
        // one bar is the air, and another small number a gauge pressure in decibar, metres of water
        let in_air = || SURFACE.contains(&least).then_some("bar");
        let unit = stated.or_else(by_size).or_else(in_air).unwrap_or("dbar");
        let above_air = |unit: &str| {
            let floor = LEAST_AIR[usize::from(size(unit) > METEOROLOGY)];
            least * size(unit) > floor
        };
        let wet = |unit: &str, absolute: bool| {
            let (change, most) = ((most - least) * size(unit), most * size(unit));
            change > WATER || (absolute && most > AIR)
        };
        let absolute = counts.unwrap_or_else(|| above_air(unit));
        if absolute && !wet(unit, true) {
            return None;
        }
        let mut readings = vec![Reading::new(unit, absolute, first)];
        let others = UNITS.iter().filter(|other| stated.is_none() && **other != unit);
        for unit in [unit].iter().chain(others) {
            for absolute in [true, false].into_iter().filter(|a| counts.is_none_or(|c| c == *a)) {
                let reading = Reading::new(unit, absolute, first);
                let possible = stated.is_some() || POSSIBLE.contains(&reading.depth);
                let fits = (above_air(unit) || !absolute) && wet(unit, absolute) && possible;
                if fits && !readings.contains(&reading) {
                    readings.push(reading);
                }
            }
        }
        Some(Self { column: column.to_owned(), readings, answered: false })
    }

    /// The unit that is used.
    pub fn unit(&self) -> &str {
        &self.readings[0].unit
    }

    /// The key of the depth.
    pub fn key(&self) -> String {
        let Reading { unit, absolute, .. } = &self.readings[0];
        let atmosphere = if *absolute { "" } else { ", atmosphere = \"0 Pa\"" };
        let column = quoted(&self.column);
        format!("columns.depth = {{ column = {column}, unit = \"{unit}\"{atmosphere} }}")
    }

    /// What is asked about it.
    pub fn question(&self) -> String {
        let side = match self.readings[0].absolute {
            true => "above vacuum, with 101325 Pa at",
            false => "above the one at",
        };
        let why = if self.answered { ", by the height of the position" } else { "" };
        format!("the pressure {} counts {side} the surface{why}", self.column)
    }

    /// Removes the readings that an answered depth at the start excludes; `true` if another one is used now.
    pub fn settle(&mut self, depth: f64) -> bool {
        let distance = |reading: &Reading| (reading.depth - depth).abs();
        let nearest = self.readings.iter().map(distance).fold(f64::INFINITY, f64::min);
        let far = nearest + FARTHER;
        let mut near: Vec<Reading> =
            self.readings.iter().filter(|r| distance(r) < far).cloned().collect();
        let changed = near[0] != self.readings[0];
        if changed {
            near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        }
        self.readings = near;
        self.answered |= changed;
        changed
    }

    /// The 1-sigma of the bias that covers all readings, m; `None` where one alone is possible.
    pub fn doubt(&self) -> Option<f64> {
        let distance = |reading: &Reading| (reading.depth - self.readings[0].depth).abs();
        let largest = self.readings.iter().map(distance).fold(0.0, f64::max);
        (self.readings.len() > 1).then_some(largest.max(LEAST_BIAS))
    }

    /// Factors on the depth by the other units.
    pub fn factors(&self) -> Vec<f64> {
        let of = |reading: &Reading| size(&reading.unit) / size(self.unit());
        let mut factors: Vec<f64> = self.readings.iter().map(of).filter(|k| *k != 1.0).collect();
        factors.dedup();
        factors
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::Pressure;

    /// The readings of a dive from 6 m to 10 m, as unit and `true` for one from vacuum.
    fn readings(unit: &str, absolute: bool, heading: &str, stated: bool) -> Option<Pressure> {
        let air = if absolute { 101_325.0 } else { 0.0 };
        let number = |k: u32| (air + 1.005e4 * (6.0 + 0.1 * f64::from(k))) / super::size(unit);
        let values: Vec<f64> = (0..40).map(number).collect();
        let words: Vec<String> = heading.split('_').map(str::to_owned).collect();
        Pressure::of(heading, &words, &values, stated.then_some(unit))
    }

    #[test]
    fn the_readings_of_a_pressure_hold_the_right_one_and_an_answer_finds_it() {
        for unit in super::UNITS {
            for absolute in [true, false] {
                for stated in [true, false] {
                    let mut found = readings(unit, absolute, "pressure", stated).unwrap();
                    let right = |r: &super::Reading| r.unit == unit && r.absolute == absolute;
                    // small numbers in Pa, hPa and kPa are never those of a vehicle under water
                    let one = found.readings.len() == 1 && !right(&found.readings[0]);
                    assert!(
                        found.readings.iter().any(right) && !one,
                        "{unit} {absolute} {stated}: {found:?}"
                    );
                    found.settle(6.0);
                    assert!(
                        (found.readings[0].depth - 6.0).abs() < 8.0,
                        "{unit} {absolute} {stated}: {found:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn words_leave_one_reading_of_a_stated_unit() {
        for (heading, absolute) in [("sea_pressure", false), ("abs_pressure", true)] {
            let found = readings("dbar", absolute, heading, true);
            assert!(found.is_some_and(|found| found.doubt().is_none()), "{heading}");
        }
    }

    #[test]
    fn a_pressure_of_air_is_none() {
        let words = ["pressure".to_owned()];
        let values: Vec<f64> = (0..40).map(|k| 1013.0 + 0.01 * f64::from(k)).collect();
        assert!(Pressure::of("pressure", &words, &values, Some("hPa")).is_none());
    }
}
