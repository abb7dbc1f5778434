//! A sensor as it was found in a file.

use crate::beams::Beams;
use crate::class::FixClass;
use crate::pressure::Pressure;

/// The place of a point in a key, from which positions of a table count, until an answer gives it.
pub const ORIGIN: &str = "{ORIGIN}";

/// A point as the value of a key: latitude, longitude (deg) and height (m).
pub fn point([latitude, longitude, height]: [f64; 3]) -> String {
    format!(
        "{{ latitude = \"{latitude} deg\", longitude = \"{longitude} deg\", height = \"{height} m\" }}"
    )
}

/// A sensor that was found in a file.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Registered type of the sensor.
    pub kind: &'static str,
    /// Keys of the sensor.
    pub sensor: Vec<String>,
    /// Keys of its file.
    pub source: Vec<String>,
    /// Questions about the file.
    pub questions: Vec<String>,
    /// Set if a position comes with a velocity.
    pub velocity: bool,
    /// First and last time of the rows of a table that were looked at, s.
    pub span: Option<[f64; 2]>,
    /// The beams of a log whose velocities are along them.
    pub beams: Option<Beams>,
    /// Set if a sample of zeros is none.
    pub zeros: bool,
    /// The columns of a table that has one half of an inertial unit, for a message.
    pub others: String,
    /// The pressure of which the depth is made.
    pub pressure: Option<Pressure>,
    /// The receiver and the attitude of a table of poses, which are used where no file has an inertial unit.
    pub apart: Vec<Found>,
    /// Interval between the times that rows share, s, of which each may be the begin of its rows or their end.
    pub burst: f64,
    /// The best class of fixes that a receiver reports.
    pub class: Option<FixClass>,
}

/// The use of an odometry in a bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OdometryUse {
    /// The reference, from which the filter starts and with which it is compared.
    Reference,
    /// A sensor that measures the motion since its previous message.
    RelativePose,
}
