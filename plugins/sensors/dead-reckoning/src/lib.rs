//! Navigation of a vehicle without an IMU.
//!
//! - [`Ahrs`]: an attitude and heading reference system, which drives the process.
//! - [`DeadReckoning`]: the process: attitude, velocity, position, and the slow error of the AHRS.

mod ahrs;
mod process;

pub use ahrs::Ahrs;
pub use process::DeadReckoning;

use navfuse_core::plugin::{Need, Plugin, Registry};

/// Registers the sensor type `ahrs` and the process type `dead-reckoning`.
#[derive(Clone, Copy, Debug)]
pub struct DeadReckoningPlugin;

impl Plugin for DeadReckoningPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Ahrs>();
        registry.process::<DeadReckoning>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
