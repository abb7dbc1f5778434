//! Estimators: the error-state extended Kalman filter and the unscented Kalman filter.

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
mod judge;
mod lockout;
mod passage;
mod past;
mod points;
mod pool;
mod refine;
mod reject;
mod repeats;
mod screen;
mod screened;
mod slot;
mod stage;
mod start;
mod step;
mod stuck;
mod timeline;
mod ukf;
mod unscented;
mod usual;

pub use crate::model::estimator_error::EstimatorError;
pub use filter::{Ekf, Snapshot};
pub use timeline::Timeline;
pub use ukf::Ukf;
