//! The segments of a run that determine observability: Pan & Wu (2016), section 2.2.
//!
//! ```text
//! Scenario ──▶ Recording ──▶ Attitude ──▶ find ──▶ Segment ──▶ Directions   rank of fdot^b
//! (Theorem 1)
//!              all samples    by gyros             I, II  ├──▶ Increments   β and γ of eq. (18)
//!                                                         └──▶ Sphere       α of eq. (13) (Lemma
//!                                                         2)
//! ```
//! This crate does not run the filter. [`Recording::read`] gathers all samples of a scenario's
//! sources, or of a log, as they are. [`Gatherer`] gathers them while another program runs the
//! filter, in bounded memory.

mod attitude;
mod directions;
mod finder;
mod gather;
mod gatherer;
mod increments;
mod lever_arm;
mod recording;
mod series;
mod sphere;

pub use attitude::{Attitude, AttitudeStart};
pub use directions::Directions;
pub use finder::{Kind, Segment, Settings, find};
pub use gatherer::Gatherer;
pub use increments::Increments;
pub use lever_arm::LeverArm;
pub use recording::{BodyVelocity, Imu, Inertial, Mounting, PositionFix, Positions, Recording};
pub use series::Series;
pub use sphere::Sphere;

use navfuse_core::document::DocumentError;

/// Error of the segments.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// The scenario, or one of its sources, does not fit.
    #[error(transparent)]
    Scenario(#[from] navfuse_core::plugin::BuildError),
    /// A source failed while it was read.
    #[error("source {name}: {error}")]
    Source {
        /// Name of the source.
        name: String,
        /// Reason.
        error: navfuse_core::model::stream::StreamError,
    },
    /// Samples are missing.
    #[error("{0}")]
    Missing(String),
}

impl From<DocumentError> for SegmentError {
    fn from(error: DocumentError) -> Self {
        Self::Scenario(error.into())
    }
}
