//! Estimators: the error-state extended Kalman filter.

mod alignment;
mod cadence;
mod correct;
mod delay;
mod filter;
mod lockout;
mod slot;
mod stage;
mod start;
mod step;

pub use filter::{Ekf, EstimatorError, Snapshot};
