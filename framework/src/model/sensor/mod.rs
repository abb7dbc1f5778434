//! Sensors: their roles, measurement models, and what a scenario states about each of them.

pub mod body;
pub mod conversion;
pub mod delivery;
pub mod detector;
pub mod dynamic;
pub mod gate;
pub mod limits;
pub mod measurement;
pub mod motion;
pub mod mounting;
pub mod robust;
pub mod roster;
pub mod rule;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod sensor;

pub use sensor::{Accuracy, Purpose, Reference, Role, Sensor, SensorInfo};
