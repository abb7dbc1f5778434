//! Acoustic positioning under water.
//!
//! - [`Usbl`]: an ultra-short baseline on a ship measures the place of the vehicle.
//! - [`AcousticRange`]: the two-way range to a transponder, of a long baseline or alone.
//! - [`SoundSpeed`]: the error of the speed of sound, a state that both share.

mod line;
mod range;
mod ship;
mod sound;
mod usbl;

pub use range::AcousticRange;
pub use sound::SoundSpeed;
pub use usbl::Usbl;

use navfuse_core::plugin::{Need, Plugin, Registry};

/// Registers the sensor types `usbl` and `acoustic-range` and the process type `sound-speed`.
#[derive(Clone, Copy, Debug)]
pub struct AcousticPlugin;

impl Plugin for AcousticPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Usbl>();
        registry.sensor::<AcousticRange>();
        registry.process::<SoundSpeed>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
