//! Doppler velocity logs, by axes and by beams.

mod altitude;
mod beams;
mod geometry;
mod sound;
mod velocity;

pub use beams::{DvlBeams, DvlBeamsModel};
pub use sound::Array;
pub use velocity::{Dvl, DvlModel};

/// Largest plausible speed of a vehicle with a DVL, m/s.
const FASTEST: f64 = 30.0;
