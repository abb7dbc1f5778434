//! Zero velocity as a measurement, for a vehicle at rest.

use navfuse_core::Real;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::nalgebra::{SMatrix, SVector};
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{Handle, View};

/// The zero-velocity update (Groves section 15.3): `z = v^n` with `z = 0`, so that accelerometer
/// errors show as velocity and gyro errors as its change.
pub(crate) struct ZeroVelocity {
    pub velocity: Handle<Vector<3>>,
    /// 1-sigma of the velocity at rest, m/s.
    pub sigma: f64,
}

impl ZeroVelocity {
    /// Name under which the updates are recorded.
    pub const NAME: &'static str = "zero_velocity";
    /// Velocity north, east, down.
    pub const CHANNELS: [(&str, &str); 3] = [("vel_n", "mps"), ("vel_e", "mps"), ("vel_d", "mps")];
}

impl MeasurementModel<3> for ZeroVelocity {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        x.get(self.velocity)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal_element(self.sigma * self.sigma)
    }
}
