//! Estimators: the error-state extended Kalman filter.

mod alignment;
mod bias;
mod cadence;
mod clones;
mod correct;
mod curvature;
mod delay;
mod drivers;
mod filter;
mod held;
mod inputs;
mod iterated;
mod lockout;
mod past;
mod points;
mod repeats;
mod screen;
mod screened;
mod slot;
mod stage;
mod start;
mod step;
mod stuck;
mod timeline;
mod unscented;
mod usual;

pub use filter::{Ekf, EstimatorError, Snapshot};
pub use timeline::Timeline;
