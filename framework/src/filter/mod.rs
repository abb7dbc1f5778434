//! Estimators: the error-state extended Kalman filter and the unscented Kalman filter.

mod course;
mod ekf;
mod estimate;
mod finish;
mod judge;
mod late;
mod linearised;
mod parts;
mod past;
mod propagate;
mod screen;
mod start;
mod transients;
mod ukf;
mod update;
mod view;

pub use crate::compose::snapshot::Snapshot;
pub use crate::model::estimator_error::EstimatorError;
pub use ekf::Ekf;
pub(crate) use judge::signature::untested;
pub use late::timeline::Timeline;
pub use ukf::Ukf;
pub(crate) use update::iekf::Iterated;
pub(crate) use update::ukf::Unscented;
