//! The estimators.

mod cadence;
mod correct;
mod delay;
mod filter;
mod phase;
mod slot;
mod start;
mod step;

pub use filter::{Ekf, EstimatorError, Snapshot};
