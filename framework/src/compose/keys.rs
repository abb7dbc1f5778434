//! The keys that the tables of every sensor have beside the type's own.

use crate::model::gate::{Gate, Recovery};
use crate::units::{Positive, Time as Duration};
use schemars::JsonSchema;
use serde::Deserialize;

/// The keys that every sensor has beside its own.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorKeys {
    /// Innovation gate: the probability that a good sample passes, or "off". Default: 0.9999.
    #[serde(default)]
    pub gate: Gate,
    /// The way out when everything is gated for too long. Default: after 30 s, inflate.
    #[serde(default)]
    pub recovery: Recovery,
    /// How long the sensor may be silent before it is called lost. Default: three times its usual interval, at least 5 s.
    pub timeout: Option<Positive<Duration>>,
    /// By how much its samples lag: one stamped t tells of the state at t - time_offset. A state of its own, as a scale factor
    /// is one. Default: none, as if zero.
    pub time_offset: Option<crate::compose::calibration::TimeOffset>,
    /// How the sensor is simulated, where there is a simulated source.
    pub simulation: Option<crate::model::simulate::Faults>,
}
