//! Simulation of every sensor of a scenario on a trajectory, which is made of motion segments or
//! written as a type of its own.

mod carried;
mod course;
pub mod cursor;
mod error;
mod ideal;
mod phase;
mod profile;
pub mod segment;
mod source;
pub mod trajectory;
#[cfg(test)]
mod trajectory_tests;

pub use course::{On, Stretch, TrajectoryType};
pub use cursor::{Cursor, Kinematics};
pub use error::TrajectoryError;
pub use phase::{Motion, Phase, Piece};
pub use segment::{Direction, SegmentConfig};
pub use source::{Simulation, simulate};
pub use trajectory::{Span, StartConfig, Trajectory, TrajectoryConfig};

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the source type `simulation`.
#[derive(Clone, Copy, Debug)]
pub struct SimulationPlugin;

impl Plugin for SimulationPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<Simulation>();
    }

    navfuse_core::named_after_crate!();
}
