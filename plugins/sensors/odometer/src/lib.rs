//! Odometer of a wheeled vehicle: the speed of a wheel along the vehicle's axis, and the
//! non-holonomic constraint that the wheel neither slides sideways nor leaves the ground (Wu, Wu,
//! Hu & Hu 2009; Dissanayake et al. 2001).
//!
//! `z = diag(k, 1, 1) C_b^v (C_n^b v^n + w_eb^b x l)`, where a real wheel has `z = [speed, 0, 0]`.
//!
//! [`SpeedLog`] measures the speed through the water in the same way.

mod water;

pub use water::SpeedLog;

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{Calibration, LeverArm, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3};
use navfuse_core::plugin::{Need, Plugin, Registry, SensorType};
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Scalar, Vector};
use navfuse_core::state::{Handle, View};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Angle, AngularRateNoise, Sigma, Speed};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;

/// Odometer of a wheeled vehicle: speed of a wheel, which neither slides nor jumps. A recording
/// needs the speed alone: the sideways and vertical speeds are then taken as zero, each with its
/// own sigma.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Odometer {
    /// 1-sigma noise of one speed.
    pub noise: Sigma<Speed>,
    /// 1-sigma of the sideways speed of the wheel, which the constraint takes as zero.
    pub lateral_noise: Sigma<Speed>,
    /// 1-sigma of the speed of the wheel normal to the road, which the constraint takes as zero:
    /// suspension and bumps.
    pub vertical_noise: Sigma<Speed>,
    /// Scale factor k: the output is k times the speed. Default: k = 1.
    #[serde(default)]
    pub scale: ScaleFactor,
    /// Pitch of the vehicle's axis relative to the IMU: C_b^v = R_y(pitch) R_z(yaw). There is no
    /// roll, because a rotation about the axis of motion changes nothing. Default: zero.
    #[serde(default)]
    pub pitch: Calibration<Angle, AngularRateNoise>,
    /// Yaw of the vehicle's axis relative to the IMU. Default: zero.
    #[serde(default)]
    pub yaw: Calibration<Angle, AngularRateNoise>,
    /// Position of the wheel from the IMU, in body axes. The constraint holds in turns only on the
    /// axle that is not steered. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process whose motion the odometer measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

const LATERAL: usize = 1;
const VERTICAL: usize = 2;

impl SensorType for Odometer {
    const TYPE: &'static str = "odometer";

    fn channels(&self) -> Vec<Channel> {
        ["speed", "lateral", "vertical"].map(|name| Channel::new(name, "mps")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let turns = self.lever_arm != LeverArm::default();
        let model = OdometerModel {
            navigation: Navigation::find_turning(composer, &self.navigation, "lever_arm", turns)?,
            scale: self.scale.block(composer, "scale", &[1.0], display::RATIO)?,
            pitch: self.pitch.block(composer, "pitch", &[0.0], display::PITCH)?,
            yaw: self.yaw.block(composer, "yaw", &[0.0], display::YAW)?,
            lever_arm: self.lever_arm.block(
                composer,
                "lever_arm",
                &[0.0; 3],
                display::LEVER_ARM,
            )?,
            sigma: Vector3::new(
                self.noise.value().si(),
                self.lateral_noise.value().si(),
                self.vertical_noise.value().si(),
            ),
        };
        let mounting = Mounting::at(model.lever_arm).pointed(model.pitch, model.yaw);
        composer.mounted(mounting);
        Ok(Role::measurement(model))
    }
}

/// The measurement model of an [`Odometer`].
#[derive(Clone, Debug)]
pub struct OdometerModel {
    navigation: Navigation,
    scale: Handle<Scalar>,
    pitch: Handle<Scalar>,
    yaw: Handle<Scalar>,
    lever_arm: Handle<Vector<3>>,
    sigma: Vector3<f64>,
}

impl MeasurementModel<3> for OdometerModel {
    /// `z = diag(k, 1, 1) R_y(pitch) R_z(yaw) v` of the velocity `v` of the wheel in body axes,
    /// multiplied out: pitch and yaw are scalar states, since a rotation state would carry a roll
    /// that nothing observes. The scale factor multiplies the measured speed alone, because the
    /// constraint of zero speed has none.
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let v = self.navigation.velocity_at(x, &x.get(self.lever_arm));
        let (sin_pitch, cos_pitch) = x.get(self.pitch).sin_cos();
        let (sin_yaw, cos_yaw) = x.get(self.yaw).sin_cos();
        let along = cos_yaw * v.x + sin_yaw * v.y;
        let forward = cos_pitch * along - sin_pitch * v.z;
        let lateral = cos_yaw * v.y - sin_yaw * v.x;
        let vertical = sin_pitch * along + cos_pitch * v.z;
        SVector::from([x.get(self.scale) * forward, lateral, vertical])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal(&self.sigma.map(|s| s * s))
    }

    /// Sets the sideways and vertical speeds to zero where a sample has a speed but not these: the
    /// non-holonomic constraint as a measurement.
    fn complete(&self, sample: &mut Sample) {
        if sample.get(0).is_some() {
            for channel in [LATERAL, VERTICAL] {
                if sample.get(channel).is_none() {
                    sample.set(channel, 0.0);
                }
            }
        }
    }
}

/// Registers the sensor types `odometer` and `speed-log`.
#[derive(Clone, Copy, Debug)]
pub struct OdometerPlugin;

impl Plugin for OdometerPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Odometer>();
        registry.sensor::<SpeedLog>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
