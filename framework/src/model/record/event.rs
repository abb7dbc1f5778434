//! Events for the log and the user.

use crate::units::time::Time;
use serde::Serialize;

/// Severity of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Information for the log.
    Info,
    /// The run continues, but not as intended.
    Warning,
    /// The run, or a part of it, ends.
    Error,
}

/// An event for the log and the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Time, on the run's clock.
    pub time: Time,
    /// Severity.
    pub level: Level,
    /// Sensor, process, source or sink concerned.
    pub about: String,
    /// Message.
    pub text: String,
}
