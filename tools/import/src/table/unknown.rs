//! The reason why a table has no sensor, with a remedy.

use super::columns::Table;
use super::vocabulary::{self, words};

/// Words of the velocities along the beams of a log, with the number of the beam.
const BEAMS: [&str; 4] = ["beam", "beams", "b", "radial"];
/// Least number of beams.
const LEAST: usize = 3;

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
