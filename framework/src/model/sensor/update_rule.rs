//! Update rules: the linearisation by which a sample corrects the estimate.

use schemars::JsonSchema;
use serde::Deserialize;

/// Rule by which a sample corrects the estimate. The three agree where the model is linear over the
/// uncertainty of the states that it reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum UpdateRule {
    /// Extended Kalman filter: one linearisation, at the estimate before the update.
    #[default]
    Ekf,
    /// Iterated extended Kalman filter: linearises again at the estimate after the update, until it
    /// stays. For an accurate sensor and an estimate that is far off.
    Iekf,
    /// Unscented update: linear regression over sigma points of the uncertainty. For a model that
    /// is curved within the uncertainty, however accurate the sensor.
    Ukf,
}

impl UpdateRule {
    /// Value of the key `update`.
    pub fn key(self) -> &'static str {
        match self {
            Self::Ekf => "ekf",
            Self::Iekf => "iekf",
            Self::Ukf => "ukf",
        }
    }
}
