//! Numbers that stand for no measurement, as formats and messages define them.
//!
//! | number | meaning | source |
//! |---|---|---|
//! | variance below zero | no measurement | `sensor_msgs/Imu`, `marine_acoustic_msgs/Dvl`: "-1" |
//! | variance of 1e5 or more | no measurement | `robot_localization`, Gazebo, `nav2`: 1e5, 1e6, 1e9 |
//! | variance of zero | a measurement of unknown accuracy | `sensor_msgs/NavSatFix`: "all zeros" |
//! | 0 N 0 E | no position | MAVLink `GLOBAL_POSITION_INT`, receivers without a fix |
//! | latitude beyond 90 deg | no position | u-blox, Septentrio: -2e10 as "do not use" |
//! | velocity of -32.768 m/s or -32 768 | no velocity | Teledyne PD0, Nortek: 0x8000 in mm/s |
//! | figure of merit of 10 m/s or more | no velocity | Nortek: the limit of its estimate |
//! | accuracy of 4 294 967 m | no position | MAVLink, UBX: 0xffffffff mm |

use std::f64::consts::{FRAC_PI_2, TAU};

/// Variance from which a number is no measurement, in the square of its SI unit.
const LARGEST: f64 = 1e5;
/// Distance from 0 N 0 E, rad, within which a position is none: 6 m.
const ORIGIN: f64 = 1e-6;
/// Least velocity of a log, m/s: 0x8000 and the numbers below in mm/s.
const SLOWEST: f64 = -32.7;
/// Figure of merit, m/s, at which an instrument gives up.
const WORST: f64 = 10.0;

/// Tests whether a variance declares that there is no measurement. NaN is no such declaration.
#[allow(clippy::manual_range_contains, reason = "NaN is in no range, and no declaration")]
pub fn is_refused(variance: f64) -> bool {
    variance < 0.0 || variance >= LARGEST
}

/// The standard deviation of a variance; `None` where the accuracy is unknown.
pub fn accuracy(variance: f64) -> Option<f64> {
    (variance > 0.0 && !is_refused(variance)).then(|| variance.sqrt())
}

/// Tests whether latitude and longitude, rad, are a position.
pub fn is_place(latitude: f64, longitude: f64) -> bool {
    let origin = latitude.abs() < ORIGIN && longitude.abs() < ORIGIN;
    !origin && latitude.abs() <= FRAC_PI_2 && longitude.abs() <= TAU
}

/// Tests whether a number is a velocity of a log, m/s.
pub fn is_velocity(value: f64) -> bool {
    value > SLOWEST && value < -SLOWEST
}

/// Tests whether an instrument trusts a velocity with this figure of merit, m/s.
pub fn is_trusted(merit: f64) -> bool {
    merit < WORST
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_for_no_measurement_is_none() {
        assert!([-1.0, 1e5, 1e9, f64::INFINITY].into_iter().all(is_refused));
        assert!([0.0, 1e-6, 400.0, f64::NAN].into_iter().all(|v| !is_refused(v)));
        assert_eq!([0.0, -1.0, 4.0, f64::NAN].map(accuracy), [None, None, Some(2.0), None]);
        assert!(!is_place(0.0, 0.0) && !is_place(-350.0, 0.1) && !is_place(f64::NAN, 0.1));
        assert!(is_place(0.0, 0.1) && is_place(-1.5, -3.0));
        assert!(is_velocity(-3.0) && !is_velocity(-32.768) && !is_velocity(f64::NAN));
        assert!(is_trusted(0.01) && !is_trusted(10.0) && !is_trusted(f64::NAN));
    }
}
