//! The state of a run while it goes on, as `live.json` has it.

use crate::delays::ClockStatus;
use navfuse_core::model::record::Epoch;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_links::{Known, Motion};
use navfuse_observability::Determination;
use serde::{Deserialize, Serialize};

/// State of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorState {
    /// No sample has arrived.
    #[default]
    Waiting,
    /// Its samples are used.
    Used,
    /// The gate refused its latest sample.
    Gated,
    /// Its latest sample could not be used.
    Rejected,
    /// No sample has arrived for longer than usual.
    Silent,
    /// It contradicts the other sensors, or a fault of it was found: the verdict doubts it.
    Doubted,
    /// A command switched it off.
    Off,
}

impl SensorState {
    /// The state in a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Used => "used",
            Self::Gated => "gated",
            Self::Rejected => "rejected",
            Self::Silent => "silent",
            Self::Doubted => "doubted",
            Self::Off => "off",
        }
    }
}

/// A sensor while the run goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorStatus {
    /// Name in the scenario.
    pub name: String,
    /// State.
    pub state: SensorState,
    /// Samples that arrived.
    pub samples: u64,
    /// Samples that were used.
    pub used: u64,
    /// Samples that the gate refused.
    pub gated: u64,
    /// Samples that could not be used.
    pub rejected: u64,
    /// Samples whose time stamp contradicts its arrival, which never reach the filter.
    pub refused: u64,
    /// Samples that arrived while a command had switched it off.
    #[serde(default)]
    pub left_out: u64,
    /// Mean NIS of its latest samples by their degrees of freedom, about 1 where its noise is right.
    #[serde(default)]
    pub nis: Option<f64>,
    /// Its share in the information that all sensors gave about the states, 0 to 1.
    #[serde(default)]
    pub share: Option<f64>,
    /// Usual rate of the samples, Hz.
    pub rate_hz: Option<f64>,
    /// Time since the latest sample, s.
    pub age_s: Option<f64>,
    /// Its clock.
    #[serde(default)]
    pub clock: ClockStatus,
}

/// A link while the run goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkStatus {
    /// Name in the scenario.
    pub name: String,
    /// Samples that it gave.
    pub samples: u64,
    /// Samples that were dropped, since the filter did not keep up with them.
    pub dropped: u64,
    /// Set once it has ended.
    pub ended: bool,
}

/// The newest estimate, as far as it is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Latitude, deg, longitude, deg, and height, m.
    pub position_deg_deg_m: Option<[f64; 3]>,
    /// Velocity north, east and down, m/s.
    pub velocity_ned_mps: Option<[f64; 3]>,
    /// Roll, pitch and heading, deg.
    pub roll_pitch_heading_deg: Option<[f64; 3]>,
}

/// The 1-sigma of the newest estimate along or about north, east and down, as far as it is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// Position, m.
    pub position_m: Option<[f64; 3]>,
    /// Velocity, m/s.
    pub velocity_mps: Option<[f64; 3]>,
    /// Attitude, deg.
    pub attitude_deg: Option<[f64; 3]>,
}

impl Estimate {
    /// The estimate of an epoch, and its accuracy.
    pub(crate) fn of(epoch: &Epoch<'_>) -> (Self, Accuracy) {
        let Motion { position, velocity, attitude } = Motion::of(&epoch.layout.vehicle(), epoch);
        let value = |known: Known| known.0;
        let sigma = |known: Known| known.1;
        let estimate = Self {
            position_deg_deg_m: position.map(value),
            velocity_ned_mps: velocity.map(value),
            roll_pitch_heading_deg: attitude.map(value),
        };
        let accuracy = Accuracy {
            position_m: position.map(sigma),
            velocity_mps: velocity.map(sigma),
            attitude_deg: attitude.map(sigma),
        };
        (estimate, accuracy)
    }
}

/// A component of the state, and whether the samples so far determine it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateStatus {
    /// Its name: `dvl.misalignment yaw`.
    pub title: String,
    /// Its 1-sigma, in `unit`.
    pub sigma: f64,
    /// Unit of the sigma; empty for a ratio.
    pub unit: String,
    /// How far it is determined.
    pub verdict: Determination,
    /// The reason why it is not determined.
    #[serde(default)]
    pub missing: Option<String>,
    /// The manoeuvre that helps to determine it.
    #[serde(default)]
    pub manoeuvre: Option<String>,
}

/// A run while it goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Name of the scenario.
    pub name: String,
    /// Set once there is an estimate.
    pub running: bool,
    /// Time of the newest estimate on the run's clock, s.
    pub time_s: Option<f64>,
    /// The estimate.
    #[serde(default)]
    pub estimate: Estimate,
    /// Its 1-sigma.
    #[serde(default)]
    pub accuracy: Accuracy,
    /// The components of the state, as far as they are uncertain; those that are constant are judged
    /// by the samples since the start of the program.
    #[serde(default)]
    pub states: Vec<StateStatus>,
    /// Verdict so far.
    pub verdict: VerdictLevel,
    /// Verdict so far, in one line.
    pub text: String,
    /// Sensors.
    pub sensors: Vec<SensorStatus>,
    /// Links.
    pub links: Vec<LinkStatus>,
    /// The last command, and what came of it.
    #[serde(default)]
    pub command: Option<String>,
    /// Latency from a sample to its estimate, ms: median, 99 %, largest.
    pub latency_ms: [f64; 3],
}
