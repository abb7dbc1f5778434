//! The speed of sound over the depth, as a scenario gives it.

use crate::sound::SoundEquation;
use navfuse_core::compose::Composer;
use navfuse_core::input;
use navfuse_core::model::error::ComposeError;
use navfuse_core::units::Ratio;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// Water column, from which the speed of sound follows at every depth.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaterColumn {
    /// Temperature of the water, deg C, a number such as `8.5`.
    pub temperature: Option<Ratio>,
    /// Practical salinity, a number. Default: 35.
    pub salinity: Option<Ratio>,
    /// Equation for the speed of sound: `chen-millero` (default), `del-grosso` or `mackenzie`.
    pub equation: Option<SoundEquation>,
    /// File with the measured speed of sound, in place of the keys above: rows of depth (m) and speed
    /// (m/s), the depth growing, separated by a comma or spaces; `#` begins a comment.
    pub profile: Option<PathBuf>,
}

/// Largest file of a profile, bytes.
const LONGEST: u64 = 1 << 20;
/// Plausible speeds of sound in water, m/s.
const SPEEDS: std::ops::RangeInclusive<f64> = 1350.0..=1800.0;

/// The speed of sound over the depth.
#[derive(Clone, Debug)]
pub enum Column {
    /// The same water at every depth: temperature (deg C) and salinity.
    Mixed(SoundEquation, f64, f64),
    /// Depth (m) and speed (m/s), in the order of the depth, and at least one row.
    Profile(Vec<[f64; 2]>),
}

impl WaterColumn {
    /// The column, with its profile read from the file.
    ///
    /// # Errors
    /// When neither a temperature nor a profile is given, or both are, or the file has no such rows.
    pub fn build(&self, composer: &Composer, key: &str) -> Result<Column, ComposeError> {
        match (&self.profile, self.temperature) {
            (Some(path), None) if self.salinity.is_none() && self.equation.is_none() => {
                let key = format!("{key}.profile");
                let path = composer.file(&key, path)?;
                let text = input::read_text(&path, LONGEST).map_err(|e| e.to_string());
                let rows = text.and_then(|text| profile(&text));
                let named = |e| ComposeError::new(&key, format!("{}: {e}", path.display()));
                rows.map(Column::Profile).map_err(named)
            }
            (None, Some(temperature)) => {
                let (temperature, salinity) =
                    (temperature.si(), self.salinity.map_or(35.0, Ratio::si));
                Ok(Column::Mixed(self.equation.unwrap_or_default(), temperature, salinity))
            }
            _ => {
                let text =
                    "give `temperature`, with `salinity` and `equation`, or a `profile` alone";
                Err(ComposeError::new(key, text))
            }
        }
    }
}

/// Reads the rows of a profile.
fn profile(text: &str) -> Result<Vec<[f64; 2]>, String> {
    let mut rows: Vec<[f64; 2]> = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let numbers = line.split([',', ';', ' ', '\t', '\r']).filter(|word| !word.is_empty());
        let numbers: Vec<Option<f64>> = numbers.map(|word| word.parse().ok()).collect();
        match numbers[..] {
            [] => {}
            [Some(depth), Some(speed)]
                if SPEEDS.contains(&speed)
                    && depth.is_finite()
                    && rows.last().is_none_or(|last| depth > last[0]) =>
            {
                rows.push([depth, speed]);
            }
            _ => {
                let needed = "a row has a depth (m), larger than in the row before, and a speed of \
                              sound within 1350 and 1800 m/s";
                return Err(format!("line {}: {needed}", k + 1));
            }
        }
    }
    if rows.is_empty() { Err("it has no rows".into()) } else { Ok(rows) }
}

impl Column {
    /// Speed of sound (m/s) at a depth (m) and a latitude (rad). A profile is linear between its rows,
    /// and constant beyond them.
    pub fn speed(&self, depth: f64, latitude: f64) -> f64 {
        match self {
            Self::Mixed(equation, temperature, salinity) => {
                equation.speed(*temperature, *salinity, depth, latitude)
            }
            Self::Profile(rows) => {
                let below = rows.partition_point(|row| row[0] <= depth);
                let [above, below] =
                    [below.saturating_sub(1), below].map(|k| rows[k.min(rows.len() - 1)]);
                let span = below[0] - above[0];
                let part = if span > 0.0 { ((depth - above[0]) / span).max(0.0) } else { 0.0 };
                above[1] + part * (below[1] - above[1])
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_linear_between_its_rows_and_constant_beyond() {
        let rows = profile("# depth speed\n0, 1500\n\n50 1510 # thermocline\n100;1480\n");
        let column = Column::Profile(rows.unwrap());
        for (depth, speed) in
            [(-5.0, 1500.0), (0.0, 1500.0), (25.0, 1505.0), (75.0, 1495.0), (100.0, 1480.0)]
        {
            assert_eq!(column.speed(depth, 0.5), speed, "{depth}");
        }
        assert_eq!(column.speed(4000.0, 0.5), 1480.0);
    }

    #[test]
    fn a_row_that_no_water_has_is_named_by_its_line() {
        for (text, line) in [
            ("0 1500\n0 1501", "line 2"),
            ("depth speed", "line 1"),
            ("5", "line 1"),
            ("0 1500\n10 150", "line 2"),
            ("NaN 1500 1", "line 1"),
            ("", "no rows"),
        ] {
            let error = profile(text).unwrap_err();
            assert!(error.contains(line), "{text}: {error}");
        }
    }
}
