//! Positioning under water by sound, and by known places.
//!
//! - [`Usbl`]: an ultra-short baseline on a ship measures the place of the vehicle.
//! - [`Ship`]: the ship as another body than the vehicle, and its navigation ([`ShipNavigation`]).
//! - [`AcousticRange`]: the two-way range to a transponder, of a long baseline or alone.
//! - [`Landmark`]: a known place that an instrument of the vehicle sees: a docking station, a mark, a transponder.
//! - [`SoundSpeed`]: the error of the speed of sound, a state that both share.

mod direction;
mod landmark;
mod line;
mod place;
mod range;
mod ship;
mod sound;
mod usbl;

pub use landmark::{Landmark, Sight};
pub use place::Place;
pub use range::AcousticRange;
pub use ship::{Course, Ship, ShipNavigation};
pub use sound::SoundSpeed;
pub use usbl::Usbl;

use navfuse_core::plugin::{Need, Plugin, Registry};

/// Registers the sensor types `usbl`, `ship-navigation`, `acoustic-range` and `landmark`, and the process
/// types `ship` and `sound-speed`.
#[derive(Clone, Copy, Debug)]
pub struct AcousticPlugin;

impl Plugin for AcousticPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Usbl>();
        registry.sensor::<AcousticRange>();
        registry.sensor::<Landmark>();
        registry.sensor::<ShipNavigation>();
        registry.process::<Ship>();
        registry.process::<SoundSpeed>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
