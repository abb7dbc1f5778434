//! Findings: faults that the filter or a monitor found in a run.

use crate::checkpoint::saved;
use crate::model::record::{Event, Level};
use crate::units::time::Time;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Consequence of a finding for the use of the run's result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The result may be used: a setting should be changed nevertheless.
    Note,
    /// A fault was found and contained: its samples were left out or replaced, or the covariance
    /// contains it. The result may be used.
    Contained,
    /// The result may be used with care: an engineer should look at the finding first.
    #[default]
    Doubtful,
    /// The result must not be used.
    DoNotUse,
}

saved!(
    enum Severity {
        Note,
        Contained,
        Doubtful,
        DoNotUse,
    }
);

impl Severity {
    /// All values.
    pub const ALL: [Self; 4] = [Self::Note, Self::Contained, Self::Doubtful, Self::DoNotUse];

    /// Words for a person: `note`, `contained`, `doubtful`, `do not use`.
    pub fn words(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Contained => "contained",
            Self::Doubtful => "doubtful",
            Self::DoNotUse => "do not use",
        }
    }

    /// Words for a verdict whose heaviest reason has this severity: the terminal, JSON, the pages, the
    /// log and the viewer have them from here.
    pub fn verdict(self) -> &'static str {
        match self {
            Self::Note => "consistent",
            Self::Contained => "usable, with a contained fault",
            Self::Doubtful => "doubtful",
            Self::DoNotUse => "do not use",
        }
    }

    /// Name in a log and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Contained => "contained",
            Self::Doubtful => "doubtful",
            Self::DoNotUse => "do_not_use",
        }
    }
}

/// Basis of a finding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Basis {
    /// The filter was without a sensor for a while, and then contradicts its first samples by more than its
    /// sigma: the sensor has no fault, and the sigma has grown too little.
    Silence,
    /// The filter compares sensors with each other, so that another sensor may be at fault.
    #[default]
    Comparison,
    /// An error of the sensor, with its size, explains what contradicts the filter: such a finding
    /// says more than that they contradict each other.
    Explanation,
    /// The samples of the sensor alone contradict physics or the sensor's settings. A fault of the
    /// driving sensor makes all others contradict the filter, so such a finding comes before those of
    /// comparisons.
    Samples,
}

saved!(
    enum Basis {
        Silence,
        Comparison,
        Explanation,
        Samples,
    }
);

impl Basis {
    /// All values.
    pub const ALL: [Self; 4] = [Self::Silence, Self::Comparison, Self::Explanation, Self::Samples];

    /// Name in a log and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Silence => "silence",
            Self::Comparison => "comparison",
            Self::Explanation => "explanation",
            Self::Samples => "samples",
        }
    }
}

/// Returns `true` if a part at fault is the sensor or one of its states: `dvl.scale`, or `imu, dvl`
/// where one of two is at fault.
pub(super) fn belongs(about: &str, sensor: &str) -> bool {
    about.split(", ").any(|part| part.split(['.', ' ']).next() == Some(sensor))
}

/// A fault that the filter or a monitor found, with its remedy. The verdict of a run lists its
/// findings.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Finding {
    /// Time at which the fault was found, on the run's clock.
    pub time: Time,
    /// Sensor or process at fault.
    pub about: String,
    /// Consequence for the result.
    pub severity: Severity,
    /// Basis of the finding.
    pub basis: Basis,
    /// Measured and expected values, in words.
    pub text: String,
    /// Remedy: the key or the part of the vehicle to look at.
    pub remedy: String,
}

saved!(Finding { time, about, severity, basis, text, remedy });

impl Finding {
    /// The finding as a warning for the log.
    pub fn event(&self) -> Event {
        let (about, text) = (self.about.clone(), self.to_string());
        Event { time: self.time, level: Level::Warning, about, text }
    }

    /// Returns `true` if the finding is about the sensor or one of its states: `dvl.scale`.
    pub fn is_about(&self, sensor: &str) -> bool {
        belongs(&self.about, sensor)
    }

    /// Weight among the findings of one part: the severity, and of equal ones how much it says.
    pub(crate) fn weight(&self) -> (Severity, Basis) {
        (self.severity, self.basis)
    }
}

impl fmt::Display for Finding {
    /// The evidence and the remedy, without the part at fault.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.text, self.remedy)
    }
}
