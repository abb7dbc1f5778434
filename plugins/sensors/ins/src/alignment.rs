//! Initial alignment: attitude and velocity at the start, found from samples.
//!
//! The alignment has two stages, coarse and fine. The coarse one ([`inertial`], `in_flight`,
//! [`optimisation`]) finds an attitude without a prior. The fine one is the filter itself. It starts at the same time
//! as the coarse stage, at the attitude which that stage found, with a prior sigma of about ten
//! times the expected error, and processes the same samples again. The coarse attitude is only the
//! point of linearisation: the information in the filter comes from the samples, used once, and its
//! covariance has the correlations of heading with gyro bias and of tilt with accelerometer bias.

mod aligner;
mod coarse;
mod config;
mod course;
mod error;
mod in_flight;
pub mod inertial;
pub mod optimisation;
mod sensors;
mod settings;
mod zero_velocity;

pub(crate) use aligner::Aligner;
pub use config::{Alignment, AlignmentConfig, AlignmentMethod, CoarseMethod, Formula};
pub(crate) use course::{CourseAlignment, CourseSettings};
pub(crate) use settings::AlignmentSettings;
pub(crate) use zero_velocity::ZeroVelocity;
