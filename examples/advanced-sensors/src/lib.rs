//! Plugins as an outsider would write them, which the how-to guides of the book explain.

mod g_sensitivity;
mod imu_errors;
mod landmarks;
mod vessel_receiver;

pub use g_sensitivity::GyroSensitivity;
pub use imu_errors::ImuErrors;
pub use landmarks::Landmarks;
pub use vessel_receiver::VesselReceiver;

use navfuse_core::prelude::*;

/// Registers the types of this crate.
#[derive(Clone, Copy, Debug)]
pub struct AdvancedSensors;

impl Plugin for AdvancedSensors {
    fn build(&self, registry: &mut Registry) {
        registry.process::<ImuErrors>();
        registry.process::<GyroSensitivity>();
        registry.sensor::<Landmarks>();
        registry.sensor::<VesselReceiver>();
    }

    navfuse_core::named_after_crate!();
}
