//! Position, attitude and velocity of the vehicle at an epoch, with their covariances.

use crate::pose::{Pose, Velocity};
use nalgebra::{Matrix3, Matrix6, SMatrix, UnitQuaternion, Vector3};
use navfuse_core::model::record::Epoch;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::{Manifold, Position, load_quaternion};
use navfuse_core::state::{Handle, Layout};

/// The blocks of a state that has a position and an attitude, by their slots.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    position: usize,
    attitude: usize,
    velocity: Option<usize>,
    /// Origin of the local frame.
    origin: Option<Geodetic>,
    /// Set where down counts from height zero.
    from_height_zero: bool,
}

/// The motion at an epoch.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    /// Geodetic position.
    pub position: Geodetic,
    /// In the tangent at the origin, north, east, down.
    pub pose: Pose,
    /// Along forward, right, down.
    pub velocity: Velocity,
}

impl Motion {
    /// The blocks of a layout; `None` without a position or an attitude.
    pub fn of(layout: &Layout) -> Option<Self> {
        let vehicle = layout.vehicle();
        Some(Self {
            position: vehicle.position?.slot(),
            attitude: vehicle.attitude?.slot(),
            velocity: vehicle.velocity.map(Handle::slot),
            origin: None,
            from_height_zero: false,
        })
    }

    /// The same blocks with down from height zero, so that a vehicle at the surface is near zero
    /// whatever its first estimate was.
    #[must_use]
    pub fn from_height_zero(self) -> Self {
        Self { from_height_zero: true, ..self }
    }

    /// North and east of a position from the origin, and down.
    fn ned(&self, position: &Geodetic, origin: &Geodetic) -> Vector3<f64> {
        let ned = position.ned_from(origin);
        let down = if self.from_height_zero { -position.height } else { ned.z };
        Vector3::new(ned.x, ned.y, down)
    }

    /// The same blocks with an origin of the local frame, in place of the position of the first epoch.
    #[must_use]
    pub fn with_origin(self, origin: Option<Geodetic>) -> Self {
        Self { origin, ..self }
    }

    /// The motion at an epoch. Without another origin, the first epoch gives it.
    pub fn at(&mut self, epoch: &Epoch<'_>) -> Moved {
        let position = Position::load::<f64>(value(epoch, self.position));
        let origin = *self.origin.get_or_insert(position);
        let pose = Pose {
            position: self.ned(&position, &origin),
            attitude: load_quaternion(value(epoch, self.attitude)),
            covariance: covariance(epoch, self.position, self.attitude),
        };
        let velocity = match self.velocity {
            Some(slot) => body_velocity(epoch, slot, self.attitude, &pose.attitude),
            None => Velocity { body: Vector3::zeros(), covariance: Matrix3::from_element(-1.0) },
        };
        Moved { position, pose, velocity }
    }
}

impl Motion {
    /// The true pose and velocity at an epoch, without covariance, where the truth has them; the origin
    /// is the one of [`Self::at`].
    pub fn truth(&self, epoch: &Epoch<'_>) -> Option<(Pose, Velocity)> {
        let truth = epoch.truth.filter(|t| t.known[self.position] && t.known[self.attitude])?;
        let value = |slot: usize| &truth.state.values[epoch.layout.blocks[slot].range()];
        let attitude = load_quaternion(value(self.attitude));
        let position = self.ned(&Position::load::<f64>(value(self.position)), &self.origin?);
        let pose = Pose { position, attitude, covariance: Matrix6::zeros() };
        let known = self.velocity.filter(|slot| truth.known[*slot]);
        let (body, covariance) = match known {
            Some(slot) => {
                let velocity = Vector3::from_column_slice(value(slot));
                (attitude.inverse() * velocity, Matrix3::zeros())
            }
            None => (Vector3::zeros(), Matrix3::from_element(-1.0)),
        };
        Some((pose, Velocity { body, covariance }))
    }
}

fn value<'a>(epoch: &'a Epoch<'_>, slot: usize) -> &'a [f64] {
    &epoch.state.values[epoch.layout.blocks[slot].range()]
}

/// The joint covariance of two blocks of three components; zero for a fixed block.
fn covariance(epoch: &Epoch<'_>, first: usize, second: usize) -> Matrix6<f64> {
    let tangent = [first, second].map(|slot| epoch.layout.blocks[slot].tangent);
    Matrix6::from_fn(|i, j| {
        let (row, column) = (tangent[i / 3], tangent[j / 3]);
        row.zip(column).map_or(0.0, |(r, c)| epoch.covariance.get(r + i % 3, c + j % 3))
    })
}

/// The body velocity `v^b = C_n^b v^n` and its covariance. With the attitude error `phi` about the
/// navigation axes, the first-order error is `dv^b = C_n^b (dv^n + v^n x phi)`, which is the
/// Jacobian below.
fn body_velocity(
    epoch: &Epoch<'_>,
    velocity: usize,
    attitude: usize,
    c_b_n: &UnitQuaternion<f64>,
) -> Velocity {
    let v = Vector3::from_column_slice(value(epoch, velocity));
    let c_n_b = c_b_n.inverse().to_rotation_matrix().into_inner();
    let mut jacobian = SMatrix::<f64, 3, 6>::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&c_n_b);
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(c_n_b * v.cross_matrix()));
    let joint = covariance(epoch, velocity, attitude);
    Velocity { body: c_n_b * v, covariance: jacobian * joint * jacobian.transpose() }
}
