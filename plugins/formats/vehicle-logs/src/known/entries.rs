//! The channels that the fields of a message fill.

use crate::term::Term;
use std::f64::consts::PI;

/// A number for a channel.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    pub channel: &'static str,
    pub term: Term<&'static str>,
    /// Factor to SI, and the offset that is added afterwards.
    pub factor: f64,
    pub offset: f64,
    /// Value of a field that stands for no measurement.
    pub absent: Option<f64>,
}

/// A message and the channels that it fills. Where a message has several, the first one whose first
/// field the message has is used. Of several entries for a channel the first with a value is used.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    pub message: &'static str,
    /// Field whose value must be at least this for the message to be used.
    pub valid: Option<(&'static str, f64)>,
    pub entries: &'static [Entry],
}

/// Radians of 1e-7 degrees.
pub const E7: f64 = 1e-7 * DEGREE;
/// Radians of a degree.
pub const DEGREE: f64 = PI / 180.0;
/// Standard gravity in m/s^2 of a thousandth of it.
pub const MILLI_G: f64 = 9.806_65e-3;
/// Metres of water of a pascal, at 1025 kg/m^3, and of the standard atmosphere.
pub const PASCAL: f64 = 1.0 / (1025.0 * 9.806_65);
pub const SEA_LEVEL: f64 = 101_325.0 * PASCAL;

pub const fn entry(channel: &'static str, term: Term<&'static str>, factor: f64) -> Entry {
    Entry { channel, term, factor, offset: 0.0, absent: None }
}

pub const fn field(channel: &'static str, name: &'static str, factor: f64) -> Entry {
    entry(channel, Term::Field(name), factor)
}

/// Fields of an inertial unit: three of gyros, then three of accelerometers.
pub const fn inertial(names: [&'static str; 6], gyro: f64, accel: f64) -> [Entry; 6] {
    [
        field("gyro_x", names[0], gyro),
        field("gyro_y", names[1], gyro),
        field("gyro_z", names[2], gyro),
        field("accel_x", names[3], accel),
        field("accel_y", names[4], accel),
        field("accel_z", names[5], accel),
    ]
}

/// Fields of an attitude, whose yaw is a heading as well.
pub const fn attitude([roll, pitch, yaw]: [&'static str; 3], factor: f64) -> [Entry; 4] {
    [
        field("roll", roll, factor),
        field("pitch", pitch, factor),
        field("yaw", yaw, factor),
        field("heading", yaw, factor),
    ]
}

/// A field that is absent at some value.
pub const fn unless(entry: Entry, absent: f64) -> Entry {
    Entry { absent: Some(absent), ..entry }
}

pub const fn known(message: &'static str, entries: &'static [Entry]) -> Known {
    Known { message, valid: None, entries }
}

pub const fn valid(field: &'static str, least: f64, known: Known) -> Known {
    Known { valid: Some((field, least)), ..known }
}

/// Fields that are named after their channels.
pub const OWN: [&str; 6] = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"];

pub const INCREMENTS: &[Entry] = &[
    field("dtheta_x", "dtheta_x", 1.0),
    field("dtheta_y", "dtheta_y", 1.0),
    field("dtheta_z", "dtheta_z", 1.0),
    field("dvel_x", "dvel_x", 1.0),
    field("dvel_y", "dvel_y", 1.0),
    field("dvel_z", "dvel_z", 1.0),
];
