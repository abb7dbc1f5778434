//! Simulation of sensors: the scene, simulators of driving sensors, and faults.

pub mod fault;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod simulate;

pub use simulate::{DrivingSensor, Faults, Memory, Random, Scene, Simulate};
