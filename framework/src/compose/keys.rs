//! Keys that the tables of all sensors share.

use crate::model::gate::{Gate, Recovery};
use crate::units::{Positive, Time as Duration};
use schemars::JsonSchema;
use serde::Deserialize;

/// Keys of every sensor's table beside those of its type.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorKeys {
    /// Innovation gate: the probability that a good sample passes, or "off". Default: 0.9999.
    #[serde(default)]
    pub gate: Gate,
    /// Recovery from lock-out, when every sample is gated for too long. Default: after 30 s,
    /// inflate.
    #[serde(default)]
    pub recovery: Recovery,
    /// Silence after which the sensor counts as lost. Default: three times its usual interval, at
    /// least 5 s.
    pub timeout: Option<Positive<Duration>>,
    /// Lag of the samples: a sample stamped t measures the state at t - time_offset. A calibration
    /// state, as a scale factor is. Default: zero.
    pub time_offset: Option<crate::compose::calibration::TimeOffset>,
    /// Simulation of the sensor, where there is a simulated source.
    pub simulation: Option<crate::model::simulate::Faults>,
}
