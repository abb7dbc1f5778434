//! The velocity along the instrument's own three axes.

use crate::instrument::{Instrument, Settings, Track};
use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LeverArm, Misalignment, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::measurement::MeasurementModel;
use navfuse_core::model::sensor::Role;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::View;
use navfuse_core::units::sample::Channel;
use navfuse_core::units::{Sigma, Speed, Triple};
use schemars::JsonSchema;
use serde::Deserialize;

/// Doppler velocity log that gives the velocity over the bottom, or through the water, along its own three axes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dvl {
    /// 1-sigma noise of one sample, one value or one an axis.
    pub noise: Sigma<Triple<Speed>>,
    /// Scale factor k: the output is k times the velocity. Without it k = 1.
    #[serde(default)]
    pub scale: ScaleFactor,
    /// Roll, pitch and yaw of the instrument: C_d^b = R_x(roll) R_y(pitch) R_z(yaw). Without it they are zero.
    #[serde(default)]
    pub misalignment: Misalignment,
    /// Where the instrument is, from the IMU, in body axes. Without it at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Another DVL, above this one, of the same transducer: its misalignment and lever arm are those of this one too. For
    /// one instrument that tracks both bottom and water.
    pub transducer: Option<String>,
    /// The process whose motion it measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
    /// What the velocity is relative to: `bottom` (default) or `water`.
    #[serde(default)]
    pub track: Track,
    /// With track = "water", the current: the name of a `[process.NAME]` of type water-current.
    pub current: Option<String>,
}

impl SensorType for Dvl {
    const TYPE: &'static str = "dvl";

    fn channels(&self) -> Vec<Channel> {
        ["vel_x", "vel_y", "vel_z"].map(|name| Channel::new(name, "mps")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let settings = Settings {
            scale: self.scale,
            misalignment: self.misalignment,
            lever_arm: self.lever_arm,
            transducer: self.transducer.as_deref(),
            navigation: &self.navigation,
            track: self.track,
            current: self.current.as_deref(),
        };
        Ok(Role::measurement(DvlModel {
            instrument: settings.build(composer)?,
            sigma: self.noise.value().si(),
        }))
    }
}

/// The measurement model of a [`Dvl`].
#[derive(Clone, Debug)]
pub struct DvlModel {
    instrument: Instrument,
    sigma: Vector3<f64>,
}

impl MeasurementModel<3> for DvlModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        self.instrument.velocity(x)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal(&self.sigma.map(|s| s * s))
    }
}
