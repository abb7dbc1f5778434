//! Composition: the composer, with which types build their models, and its result.

mod bodies;
pub mod calibration;
mod composer;
mod composition;
pub mod correlated;
pub mod course;
pub(crate) mod covariance_rate;
pub mod draw;
pub mod estimator;
pub mod keys;
pub mod settings;
pub mod snapshot;
pub(crate) mod time_offset;
mod transients;
pub mod truth;

pub use composer::Composer;
pub(crate) use composition::moved;
pub use composition::{Composition, Process};
