//! The blocks that are the motion of the vehicle.

use crate::state::layout::Handle;
use crate::state::manifold::{Position, Rotation, Vector};

/// What the blocks of a process mean for the motion of a body. A process declares it with
/// [`crate::compose::Composer::moves`]; viewers, logs and the summary read it from
/// [`crate::state::Layout::vehicle`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Vehicle {
    /// Geodetic position.
    pub position: Option<Handle<Position>>,
    /// Attitude: body (forward, right, down) to navigation frame (north, east, down).
    pub attitude: Option<Handle<Rotation>>,
    /// Earth-referenced velocity, north, east, down, m/s.
    pub velocity: Option<Handle<Vector<3>>>,
}
