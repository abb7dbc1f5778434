//! The velocities along the beams of a log, with the angles that other columns have.

use super::columns::{Chosen, Table};
use super::units;
use super::vocabulary::{fitting, words};
use crate::beams::Beams;
use crate::found::Found;

/// Words of the velocities along the beams, beside the number of the beam.
const BEAMS: [&str; 4] = ["beam", "beams", "b", "radial"];
/// Words that may stand beside them.
const BESIDE: [&str; 11] =
    ["vel", "velocity", "velocities", "speed", "mps", "m", "s", "mm", "cm", "mmps", "dvl"];
/// Words of a column with the azimuth of a beam, and with the slant of all of them.
const AZIMUTH: [&str; 2] = ["azimuth", "az"];
const SLANT: [&str; 5] = ["beamangle", "slant", "slantangle", "janusangle", "beamslant"];
/// Numbers of beams of which a velocity follows.
const COUNTS: std::ops::RangeInclusive<usize> = 3..=4;

/// The number in the words of a heading, and the words without it.
fn numbered(heading: &str) -> Option<(usize, Vec<String>)> {
    let name = heading.split(['[', '(']).next().unwrap_or_default();
    let mut number = None;
    let mut rest = Vec::new();
    for word in words(name) {
        let text = word.trim_end_matches(|c: char| c.is_ascii_digit());
        if let Ok(n) = word[text.len()..].parse::<usize>()
            && number.replace(n).is_some()
        {
            return None;
        }
        if !text.is_empty() {
            rest.push(text.to_owned());
        }
    }
    Some((number?, rest))
}

impl Table<'_> {
    /// The columns of the velocities along the beams, in the order of their numbers.
    pub(super) fn beams(&self) -> Vec<usize> {
        let along = |rest: &[String]| {
            let beam = rest.iter().filter(|w| BEAMS.contains(&w.as_str())).count() == 1;
            beam && rest.iter().all(|w| BEAMS.contains(&w.as_str()) || BESIDE.contains(&w.as_str()))
        };
        self.by_number(along)
    }

    /// The columns with a number beside words that fit, in the order of the numbers.
    fn by_number(&self, fits: impl Fn(&[String]) -> bool) -> Vec<usize> {
        let found = self.layout.headings.iter().enumerate().filter_map(|(k, heading)| {
            let (number, rest) = numbered(heading)?;
            fits(&rest).then_some((number, k))
        });
        let mut found: Vec<(usize, usize)> = found.collect();
        found.sort_unstable();
        let follows = found.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1);
        if follows { found.into_iter().map(|(_, k)| k).collect() } else { Vec::new() }
    }

    /// The log whose velocities are along its beams; `None` for a number of beams other than three or four.
    pub(super) fn beams_log(&self) -> Option<Found> {
        let columns = self.beams();
        if !COUNTS.contains(&columns.len()) {
            return None;
        }
        let values: Vec<Vec<f64>> = columns.iter().map(|k| self.layout.column(*k)).collect();
        let [a, b, c] = [0, 1, 2].map(|k| values[k].as_slice());
        let mut questions = Vec::new();
        let key = |(n, k): (usize, &usize)| {
            let heading = self.heading(*k);
            let bracket = heading.split_once(['[', '(']).map(|(_, unit)| unit);
            let ending = || heading.rsplit(['_', ' ']).next();
            let unit = bracket.or_else(ending).and_then(|unit| fitting(unit, "m/s"));
            let unit = unit.unwrap_or_else(|| {
                let unit = units::speed(&units::rows([a, b, c])).to_owned();
                questions.push(format!("the unit of {heading}: {unit} by its size"));
                unit
            });
            let more = String::new();
            let channel = format!("beam_{}", n + 1);
            Chosen { heading, unit, scale: 1.0, minutes: false, more, usual: false }.key(&channel)
        };
        let source = columns.iter().enumerate().filter_map(key).collect();
        let azimuths = self.by_number(|rest| {
            rest.iter().any(|w| AZIMUTH.contains(&w.as_str()))
                && rest.iter().all(|w| AZIMUTH.contains(&w.as_str()) || BEAMS.contains(&w.as_str()))
        });
        let azimuth: Option<Vec<f64>> = azimuths.iter().map(|k| self.constant(*k)).collect();
        let count = columns.len();
        let azimuth = azimuth.filter(|found| found.len() == count);
        let slanted = self.layout.headings.iter().position(|h| {
            let name = h.split(['[', '(']).next().unwrap_or_default();
            SLANT.contains(&words(name).concat().trim_end_matches("deg"))
        });
        let slant = slanted.and_then(|k| self.constant(k)).filter(|s| (5.0..60.0).contains(s));
        let beams = Some(Beams { count, slant, azimuth });
        Some(Found { kind: "dvl-beams", source, questions, beams, ..Found::default() })
    }

    /// The value of a column that does not change.
    fn constant(&self, k: usize) -> Option<f64> {
        let values = self.layout.column(k);
        let first = *values.first()?;
        values.iter().all(|v| *v == first).then_some(first).filter(|v| v.is_finite())
    }
}
