//! Estimators: the error-state extended Kalman filter.

mod alignment;
mod bias;
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
mod stuck;
mod timeline;
mod usual;

pub use filter::{Ekf, EstimatorError, Snapshot};
pub use timeline::Timeline;
