//! Events for the log and the user.

use crate::checkpoint::saved;
use crate::units::time::Time;
use serde::Serialize;

/// Severity of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Information for the log.
    #[default]
    Info,
    /// The run continues, but not as intended.
    Warning,
    /// The run, or a part of it, ends.
    Error,
}

saved!(
    enum Level {
        Info,
        Warning,
        Error,
    }
);

/// An event for the log and the user.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
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

saved!(Event { time, level, about, text });
