//! Physics of sea water that sensors share: the speed of sound, and pressure and depth.

mod column;
mod pressure;
mod sound;

pub use column::{Column, WaterColumn};
pub use pressure::{depth_at, pressure_at};
pub use sound::SoundEquation;
