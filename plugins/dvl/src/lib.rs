//! Doppler velocity logs: the velocity of the body over the bottom or through the water, with the scale factor,
//! misalignment and lever arm that Pan & Wu calibrate in situ.
//!
//! ```text
//! y = k C_b^d (C_n^b (v^n - c^n) + w_eb^b x l)        [`Dvl`]
//! z_i = b_i . y                                       [`DvlBeams`]
//! ```
//! Pan & Wu eq. (7), with the lever arm `l` that the paper leaves out. `c` is the velocity of the water ([`WaterCurrent`]):
//! a sensor that tracks the bottom has none.

mod beams;
mod body;
mod geometry;
mod instrument;
mod sound;
mod water;

pub use beams::{DvlBeams, DvlBeamsModel};
pub use body::{Dvl, DvlModel};
pub use instrument::Track;
pub use sound::Array;
pub use water::WaterCurrent;

use navfuse_core::plugin::{Need, Plugin, Registry};

/// Registers the sensor types `dvl` and `dvl-beams` and the process type `water-current`.
#[derive(Clone, Copy, Debug)]
pub struct DvlPlugin;

impl Plugin for DvlPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Dvl>();
        registry.sensor::<DvlBeams>();
        registry.process::<WaterCurrent>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
