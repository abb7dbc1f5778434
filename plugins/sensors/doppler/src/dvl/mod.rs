//! Doppler velocity logs, by axes and by beams.

mod altitude;
mod beams;
mod geometry;
mod sound;
mod velocity;

pub use beams::{DvlBeams, DvlBeamsModel};
pub use sound::{Array, SoundSpeed};
pub use velocity::{Dvl, DvlModel};
