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

use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::units::sample::Sample;
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

/// Types of the sensors whose velocities have the marks of a Doppler velocity log.
const LOGS: [&str; 2] = ["dvl", "dvl-beams"];
/// The accuracies of a receiver, and the channels that each is about.
const ACCURACIES: [(&str, &[&str]); 3] =
    [("h_acc", &["lat", "lon"]), ("v_acc", &["height"]), ("s_acc", &["vel_n", "vel_e", "vel_d"])];

/// The reason why a sample has no measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// The position is none.
    Place,
    /// A velocity of a log is none.
    Velocity,
}

/// The judgement on the samples of a sensor, whatever its format.
#[derive(Clone, Debug)]
pub struct Judge {
    /// Channels of latitude and longitude.
    place: Option<[usize; 2]>,
    /// Channels with the velocities of a log.
    velocities: Vec<usize>,
    /// Channels of accuracies, and the channels that each is about.
    accuracies: Vec<(usize, Vec<usize>)>,
}

impl Judge {
    /// The judgement for the channels of a sensor.
    pub fn new(info: &SensorInfo) -> Self {
        let at = |name: &str| info.position(name);
        let log = LOGS.contains(&info.kind.as_str());
        let velocity = |name: &str| name.starts_with("vel_") || name.starts_with("beam_");
        let channels = info.channels.iter().enumerate();
        let velocities = channels.filter(|(_, c)| log && velocity(&c.name)).map(|(k, _)| k);
        let about = |names: &[&str]| names.iter().filter_map(|name| at(name)).collect();
        let accuracies = ACCURACIES.iter().filter_map(|(name, of)| Some((at(name)?, about(of))));
        Self {
            place: at("lat").zip(at("lon")).map(|(lat, lon)| [lat, lon]),
            velocities: velocities.collect(),
            accuracies: accuracies.collect(),
        }
    }

    /// The reason why a sample has no measurement. An accuracy of zero, which is unknown, and one that
    /// declares no measurement are taken from the sample; the latter with the channels that it is
    /// about, so that the sample may have none left.
    pub fn refuses(&self, sample: &mut Sample) -> Option<Missing> {
        let place = self.place.and_then(|[lat, lon]| sample.get(lat).zip(sample.get(lon)));
        if place.is_some_and(|(lat, lon)| !is_place(lat, lon)) {
            return Some(Missing::Place);
        }
        let none = |k: &usize| sample.get(*k).is_some_and(|v| !is_velocity(v));
        if self.velocities.iter().any(none) {
            return Some(Missing::Velocity);
        }
        for (accuracy, about) in &self.accuracies {
            let Some(value) = sample.get(*accuracy) else { continue };
            let refused = value < 0.0 || is_refused(value * value);
            if refused || value == 0.0 {
                sample.clear(*accuracy);
            }
            about.iter().filter(|_| refused).for_each(|k| sample.clear(*k));
        }
        None
    }
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
