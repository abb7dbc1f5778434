//! A vehicle without an IMU, located by ranges to transponders: every kind of type that a plugin
//! can register, in a crate outside of the workspace.

mod circle;
mod eight;
mod lines;
mod pressure;
mod ranges;
mod steady;

pub use circle::Circle;
pub use eight::Eight;
pub use lines::{LinesSink, LinesSource};
pub use pressure::PressureGauge;
pub use ranges::Ranges;
pub use steady::Steady;

use navfuse_core::plugin::Need;
use navfuse_core::prelude::*;
use navfuse_simulation::On;

// ANCHOR: plugin
/// The vehicle and its sensors.
pub struct VehiclePlugin;

impl Plugin for VehiclePlugin {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Steady>();
        registry.sensor::<Ranges>();
        registry.sensor::<PressureGauge>();
        registry.source::<On<Eight>>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-simulation", version: "0.1" }]
    }
}

/// Samples as lines of text.
pub struct LinesPlugin;

impl Plugin for LinesPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<LinesSource>();
        registry.sink::<LinesSink>();
    }
}

/// Group of both plugins: a group is a plugin that adds others.
pub struct OutsideVehicle;

impl Plugin for OutsideVehicle {
    fn build(&self, registry: &mut Registry) {
        registry.add(&VehiclePlugin).add(&LinesPlugin);
    }
}
// ANCHOR_END: plugin
