//! Simulated faults of sensors: their keys in a scenario, their checks, and their effect on samples.
//!
//! A source that simulates applies the faults of a sensor with an [`Injector`]. A fault changes
//! samples that are complete otherwise, and draws from random numbers of its own. So the samples
//! outside of its span are equal to the bit with and without the fault.

mod check;
mod config;
mod inject;

pub use config::{Fault, FaultType};
pub use inject::Injector;

#[cfg(test)]
mod tests;
