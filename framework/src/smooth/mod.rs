//! Smoothing of any composition: the estimate of every time from all samples of the run, or from
//! those up to a fixed lag after it.
//!
//! The filter runs as always, and leaves snapshots of itself on the way. Then each segment between
//! two snapshots is computed again, the last one first: this time its transitions, corrections and
//! estimates are recorded, and the backward recursion of `adjoint.rs` passes over the records. So
//! the records of one segment are in memory at a time, however long the run.
//!
//! A further pass linearises at the smoothed trajectory of the one before (`passes.rs`). A filter
//! makes such passes over its first samples while it runs (`relinearised.rs`), with their records in
//! memory and without the covariance of the smoothed estimates (`means.rs`).
//!
//! The recursion needs only what every filter run gives, and nothing from models or plugins: each
//! step is a linear map of the error, and each correction one with an innovation.

mod adjoint;
mod again;
mod change;
mod course;
mod error;
mod estimate;
mod forward;
mod interval;
mod lag;
mod means;
mod passes;
mod quality;
mod recording;
mod relinearised;
mod segment;
mod sentences;
mod smoother;
mod stretch;
mod tape;
mod watch;

pub use change::Passes;
pub use error::SmoothError;
pub use quality::{QualityReport, SensorFit};
pub(crate) use relinearised::Relinearised;
pub use sentences::SMOOTHER;
pub(crate) use smoother::Smoother;
pub(crate) use watch::products_matter;
