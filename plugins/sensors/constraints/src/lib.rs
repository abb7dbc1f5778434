//! Pseudo-measurements of land vehicles: knowledge about the motion that no instrument gives.
//!
//! - [`NonHolonomic`]: a wheel neither slides sideways nor leaves the ground.
//! - [`ZeroVelocity`]: the vehicle stands still, as the IMU or an odometer shows.
//!
//! Both are sensors of a scenario without samples of their own: a
//! [`Detector`](navfuse_core::model::sensor::detector::Detector) decides when they hold. With the key
//! `simulation` their samples are simulated, with noise, which campaigns use.

mod non_holonomic;
mod standstill;
mod zero_velocity;

pub use non_holonomic::NonHolonomic;
pub use zero_velocity::ZeroVelocity;

use navfuse_core::plugin::{Need, Plugin, Registry};

/// Registers the sensor types `non-holonomic` and `zero-velocity`.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintsPlugin;

impl Plugin for ConstraintsPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<NonHolonomic>();
        registry.sensor::<ZeroVelocity>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
