//! Estimators: the error-state extended Kalman filter and the unscented Kalman filter.

mod course;
mod ekf;
mod judge;
mod late;
mod past;
mod propagate;
mod screen;
mod start;
mod step;
mod transients;
mod ukf;
mod update;

pub use crate::model::estimator_error::EstimatorError;
pub(crate) use course::guide::Course;
pub use ekf::{Ekf, Snapshot};
pub use late::timeline::Timeline;
pub use ukf::Ukf;
