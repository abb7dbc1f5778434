//! Presentation of the common states: unit, scale and names of the components.

use crate::state::block::Display;
use std::f64::consts::PI;

/// A ratio.
pub const RATIO: Display = Display { unit: "", scale: 1.0, components: &["k"] };
/// A ratio for each of three axes.
pub const RATIOS: Display = Display { unit: "", scale: 1.0, components: &["x", "y", "z"] };
/// Roll, pitch and yaw in degrees.
pub const ANGLES: Display =
    Display { unit: "deg", scale: PI / 180.0, components: &["roll", "pitch", "yaw"] };
/// One angle in degrees.
pub const ANGLE: Display = Display { unit: "deg", scale: PI / 180.0, components: &["angle"] };
/// Pitch in degrees.
pub const PITCH: Display = Display { components: &["pitch"], ..ANGLE };
/// Yaw in degrees.
pub const YAW: Display = Display { components: &["yaw"], ..ANGLE };
/// Three body axes in metres.
pub const LEVER_ARM: Display = Display { unit: "m", scale: 1.0, components: &["x", "y", "z"] };
/// A length in metres.
pub const LENGTH: Display = Display { unit: "m", scale: 1.0, components: &["bias"] };
/// A time in seconds.
pub const TIME: Display = Display { unit: "s", scale: 1.0, components: &["offset"] };
/// North, east and down in metres per second.
pub const VELOCITY: Display =
    Display { unit: "m/s", scale: 1.0, components: &["north", "east", "down"] };
/// Latitude, longitude and height; sigma and error north, east and down in metres.
pub const POSITION: Display =
    Display { unit: "m", scale: 1.0, components: &["latitude", "longitude", "height"] };
/// Three gyros in degrees per hour.
pub const GYRO_BIAS: Display =
    Display { unit: "deg/h", scale: PI / 180.0 / 3600.0, components: &["x", "y", "z"] };
/// Three accelerometers in millionths of standard gravity.
pub const ACCEL_BIAS: Display =
    Display { unit: "ug", scale: 9.80665e-6, components: &["x", "y", "z"] };

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::parse_unit;

    /// A scale is the product of at most three factors, of which each is rounded by 2^-53.
    #[test]
    fn the_scale_of_a_presentation_is_its_unit_in_si() {
        let all = [
            ANGLES, ANGLE, PITCH, YAW, LEVER_ARM, LENGTH, TIME, VELOCITY, POSITION, GYRO_BIAS,
            ACCEL_BIAS,
        ];
        for Display { unit, scale, .. } in all {
            let si = parse_unit(unit).map(|unit| unit.to_si(1.0)).unwrap_or(f64::NAN);
            assert!((si / scale - 1.0).abs() <= 4.0 * f64::EPSILON / 2.0, "{unit}: {scale}");
        }
        assert_eq!((RATIO.scale, RATIOS.scale), (1.0, 1.0));
    }
}
