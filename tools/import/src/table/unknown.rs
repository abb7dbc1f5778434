//! The reason why a table has no sensor, with a remedy.

use super::columns::Table;
use super::vocabulary;

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
