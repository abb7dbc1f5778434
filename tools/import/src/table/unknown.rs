//! The reason why a table has no sensor, with a remedy.

use super::columns::Table;
use super::units::median;
use super::vocabulary::{self, words};

/// Words of coordinates east and north of a point.
const EAST: [&str; 3] = ["east", "easting", "e"];
const NORTH: [&str; 3] = ["north", "northing", "n"];
/// Words of the velocities along the beams of a log, with the number of the beam.
const BEAMS: [&str; 4] = ["beam", "beams", "b", "radial"];
/// Least number of beams.
const LEAST: usize = 3;
/// Metres, from which coordinates are no velocities.
const FAR: f64 = 30.0;

impl Table<'_> {
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
        if self.is_local() {
            return format!(
                "its positions are metres east and north of a point that no column among {list} names: \
                 write latitude, longitude and height (`enu2geodetic` of pymap3d converts them), or \
                 a column `zone` beside easting and northing of UTM"
            );
        }
        if self.beams() >= LEAST {
            return format!(
                "its velocities are along the beams of a velocity log ({list}), whose angles no column \
                 has: write the velocities along its own axes (vel_x_mps, vel_y_mps, vel_z_mps), or a \
                 scenario with a sensor of type dvl-beams and its beam_angle"
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

    /// Tests whether columns have coordinates east and north of a point.
    fn is_local(&self) -> bool {
        let column = |names: [&str; 3]| {
            let named = |h: &String| words(h).first().is_some_and(|w| names.contains(&w.as_str()));
            self.layout.headings.iter().position(named).map(|k| self.layout.column(k))
        };
        let far = |values: Vec<f64>| {
            let first = values.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
            median(values.iter().map(|v| v.abs())) > FAR
                || values.iter().any(|v| (v - first).abs() > FAR)
        };
        column(EAST).zip(column(NORTH)).is_some_and(|(east, north)| far(east) || far(north))
    }

    /// Number of columns with the velocity along a beam.
    fn beams(&self) -> usize {
        let numbered = |heading: &String| {
            let text = words(heading.split(['[', '(']).next().unwrap_or_default()).concat();
            let digits = |c: char| c.is_ascii_digit();
            let number = text.contains(['1', '2', '3', '4', '0']);
            number && BEAMS.iter().any(|b| text.split(digits).any(|part| part == *b))
        };
        self.layout.headings.iter().filter(|h| numbered(h)).count()
    }
}
