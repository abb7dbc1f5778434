//! navfuse-simulation

pub mod cursor;
mod phase;
mod profile;
pub mod segment;
pub mod trajectory;
#[cfg(test)]
mod trajectory_tests;

pub use cursor::{Cursor, Kinematics};
pub use segment::{Direction, SegmentConfig};
pub use trajectory::{Span, StartConfig, Trajectory, TrajectoryConfig, TrajectoryError};
