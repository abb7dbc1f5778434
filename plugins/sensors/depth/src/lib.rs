//! Sensors of the depth.
//!
//! - [`Depth`]: the depth of its port below the reference surface of heights, with scale factor, bias and
//!   lever arm.
//! - [`PressureSensor`]: the pressure at its port, from which the depth follows by latitude and density.
//!
//! The equation of the first is
//! `z = k (-h + e_D . C_b^n l) + b` (Groves section 6.2.2, for a sensor that already converts pressure
//! to depth). The scale factor `k` is the true density of the water over the assumed one.

mod pressure;

pub use pressure::PressureSensor;

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LengthBias, LeverArm, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::model::sensor::measurement::{Jacobian, MeasurementModel};
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::nalgebra::{SMatrix, SVector};
use navfuse_core::plugin::{Need, Plugin, Registry, SensorType};
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Scalar, Vector};
use navfuse_core::state::{Handle, View};
use navfuse_core::units::sample::Channel;
use navfuse_core::units::{Length, Sigma};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;

/// Depth sensor: metres below height zero, positive down.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Depth {
    /// 1-sigma noise of one sample.
    pub noise: Sigma<Length>,
    /// Bias: the reading at depth zero, which includes tide and air pressure. Default: zero.
    #[serde(default)]
    pub bias: LengthBias,
    /// Scale factor k: the true density of the water over the one that the instrument assumes, such
    /// as `{ sigma = "2.5 %" }`. Default: k = 1.
    pub scale: Option<ScaleFactor>,
    /// Position of the sensor's port from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process whose motion the sensor measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

impl SensorType for Depth {
    const TYPE: &'static str = "depth";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("depth", "m")]
    }

    fn limits(&self) -> Vec<Limit> {
        // air pressure and waves above the surface; the deepest trench has 10 900 m
        vec![Limit::range("depth", -100.0, 12_000.0)]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let model = DepthModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            bias: self.bias.block(composer, "bias", &[0.0], display::LENGTH)?,
            lever_arm: self.lever_arm.block(
                composer,
                "lever_arm",
                &[0.0; 3],
                display::LEVER_ARM,
            )?,
            scale: self
                .scale
                .map(|scale| scale.block(composer, "scale", &[1.0], display::RATIO))
                .transpose()?,
            sigma: self.noise.value().si(),
        };
        composer.mounted(Mounting::at(model.lever_arm));
        Ok(Role::measurement(model))
    }
}

/// The measurement model of a [`Depth`].
#[derive(Clone, Debug)]
pub struct DepthModel {
    navigation: Navigation,
    bias: Handle<Scalar>,
    lever_arm: Handle<Vector<3>>,
    scale: Option<Handle<Scalar>>,
    sigma: f64,
}

impl MeasurementModel<1> for DepthModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let port = self.navigation.position_at(x, &x.get(self.lever_arm));
        let height = self.scale.map_or(port.height, |scale| port.height * x.get(scale));
        SVector::from([x.get(self.bias) - height])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }

    /// The analytic Jacobian, which saves the evaluation with dual numbers: k times 1 for the
    /// downward displacement, `(C l) x e_D` for the attitude (from `e_D . (phi x C l)`) and the down
    /// row of `C_b^n` for the lever arm; the depth for k, and 1 for the bias.
    fn jacobian(&self, x: &View<'_, f64>, h: &mut Jacobian<'_, 1>) -> bool {
        let c_b_n = x.get(self.navigation.attitude);
        let l = c_b_n * x.get(self.lever_arm);
        let k = self.scale.map_or(1.0, |scale| x.get(scale));
        h.set(self.navigation.position, &SMatrix::<f64, 1, 3>::new(0.0, 0.0, k));
        h.set(self.navigation.attitude, &(SMatrix::<f64, 1, 3>::new(l.y, -l.x, 0.0) * k));
        h.set(self.lever_arm, &(c_b_n.matrix().fixed_view::<1, 3>(2, 0) * k));
        if let Some(scale) = self.scale {
            let port = self.navigation.position_at(x, &x.get(self.lever_arm));
            h.set(scale, &SMatrix::<f64, 1, 1>::new(-port.height));
        }
        h.set(self.bias, &SMatrix::<f64, 1, 1>::new(1.0));
        true
    }
}

/// Registers the sensor types `depth` and `pressure`.
#[derive(Clone, Copy, Debug)]
pub struct DepthPlugin;

impl Plugin for DepthPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Depth>();
        registry.sensor::<PressureSensor>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
