//! Estimators: the error-state extended Kalman filter.

mod alignment;
mod cadence;
mod correct;
mod delay;
mod filter;
mod lockout;
mod repeats;
mod screen;
mod screened;
mod slot;
mod stage;
mod start;
mod step;
mod usual;

pub use filter::{Ekf, EstimatorError, Snapshot};
