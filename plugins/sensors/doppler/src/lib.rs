//! Doppler instruments: velocity logs (DVL) over the bottom or through the water, and the laser
//! velocimeter, with the scale factor, misalignment and lever arm that Pan & Wu calibrate in situ.
//!
//! All of them read the velocity `y` in their own axes, whole or along beams `b_i`:
//! ```text
//! y   = k C_b^d (C_n^b (v^n - c^n) + w_eb^b x l) + b    [`Dvl`]
//! z_i = b_i . y                                         [`DvlBeams`], [`LaserDoppler`]
//! ```
//! Pan & Wu eq. (7), with the lever arm `l` and the bias `b` that the paper omits. `c` is the velocity of the water
//! ([`WaterCurrent`]); it is zero for an instrument that tracks the bottom.

mod beam;
mod dvl;
mod instrument;
mod keys;
mod laser;
mod profile;
mod water;

pub use beam::{Beam, PerBeam};
pub use dvl::{Array, Dvl, DvlBeams, DvlBeamsModel, DvlModel, SoundSpeed};
pub use instrument::TrackingMode;
pub use laser::{LaserDoppler, LaserDopplerModel};
pub use profile::{Cells, ProfileModel, WaterProfile};
pub use water::WaterCurrent;

use navfuse_core::plugin::{Need, Plugin, Registry};

const NEEDS: &[Need] = &[Need { plugin: "navfuse-ins", version: "0.1" }];

/// Adds [`DvlPlugin`] and [`LaserDopplerPlugin`].
#[derive(Clone, Copy, Debug)]
pub struct DopplerPlugin;

impl Plugin for DopplerPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.add(&DvlPlugin).add(&LaserDopplerPlugin);
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        NEEDS
    }
}

/// Registers the sensor types `dvl`, `dvl-beams` and `water-profile` and the process type
/// `water-current`.
#[derive(Clone, Copy, Debug)]
pub struct DvlPlugin;

impl Plugin for DvlPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Dvl>();
        registry.sensor::<DvlBeams>();
        registry.sensor::<WaterProfile>();
        registry.process::<WaterCurrent>();
    }

    fn version(&self) -> &'static str {
        env!("CARGO_PKG_VERSION")
    }

    fn needs(&self) -> &[Need] {
        NEEDS
    }
}

/// Registers the sensor type `laser-doppler`.
#[derive(Clone, Copy, Debug)]
pub struct LaserDopplerPlugin;

impl Plugin for LaserDopplerPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<LaserDoppler>();
    }

    fn version(&self) -> &'static str {
        env!("CARGO_PKG_VERSION")
    }

    fn needs(&self) -> &[Need] {
        NEEDS
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    /// All instruments read the motion of an inertial navigation, also those that are added alone.
    #[test]
    fn without_inertial_navigation_the_instruments_name_what_is_missing() {
        let plugins: [&dyn Plugin; 3] = [&DopplerPlugin, &DvlPlugin, &LaserDopplerPlugin];
        for plugin in plugins {
            let mut registry = Registry::new();
            let error = registry.add(plugin).check().unwrap_err().to_string();
            let need = format!("the plugin {} ", plugin.name());
            assert!(error.contains(&need) && error.contains("navfuse-ins 0.1"), "{error}");
            registry.add(&navfuse_ins::InsPlugin).check().unwrap();
        }
    }
}
