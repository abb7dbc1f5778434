//! Doppler velocity log: the velocity of the body over the bottom, with the scale factor, misalignment and lever arm that
//! Pan & Wu calibrate in situ.
//!
//! `y = k C_b^d (C_n^b v^n + w_eb^b x l)`: Pan & Wu eq. (7), with the lever arm `l` that the paper leaves out.

use navfuse_core::Real;
use navfuse_core::calibration::{LeverArm, Misalignment, ScaleFactor, display};
use navfuse_core::compose::{ComposeError, Composer, Role};
use navfuse_core::manifold::{Rotation, Scalar, Vector};
use navfuse_core::measurement::MeasurementModel;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3};
use navfuse_core::registry::{Plugin, Registry, SensorType};
use navfuse_core::sample::Channel;
use navfuse_core::state::{Handle, View};
use navfuse_core::units::{Sigma, Speed, Triple};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;

/// Doppler velocity log that gives the velocity over the bottom along its own three axes.
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
    /// The process whose motion it measures.
    #[serde(default = "ins")]
    pub navigation: String,
}

fn ins() -> String {
    "ins".into()
}

impl SensorType for Dvl {
    const TYPE: &'static str = "dvl";

    fn channels(&self) -> Vec<Channel> {
        ["vel_x", "vel_y", "vel_z"].map(|name| Channel::new(name, "mps")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(DvlModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            scale: self.scale.block(composer, "scale", &[1.0], display::RATIO)?,
            c_b_d: self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?,
            lever_arm: self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?,
            sigma: self.noise.value().si(),
        }))
    }
}

/// The measurement model of a [`Dvl`].
#[derive(Clone, Debug)]
pub struct DvlModel {
    navigation: Navigation,
    scale: Handle<Scalar>,
    c_b_d: Handle<Rotation>,
    lever_arm: Handle<Vector<3>>,
    sigma: Vector3<f64>,
}

impl MeasurementModel<3> for DvlModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        x.get(self.c_b_d) * self.navigation.velocity_at(x, &x.get(self.lever_arm)) * x.get(self.scale)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal(&self.sigma.map(|s| s * s))
    }
}

/// Registers the sensor type `dvl`.
#[derive(Clone, Copy, Debug)]
pub struct DvlPlugin;

impl Plugin for DvlPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Dvl>();
    }
}
