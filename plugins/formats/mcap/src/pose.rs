//! Poses and velocities, and the rotations between the axes of navfuse and of ROS.

use nalgebra::{Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};
use std::f64::consts::FRAC_1_SQRT_2;

/// A frame in its parent.
#[derive(Clone, Copy, Debug)]
pub struct Link<'a> {
    /// Name of the parent.
    pub parent: &'a str,
    /// Name of the child.
    pub child: &'a str,
    /// Origin of the child along the axes of the parent, m.
    pub translation: Vector3<f64>,
    /// Rotation from the child to the parent.
    pub rotation: UnitQuaternion<f64>,
}

/// Half a turn about the bisector of two horizontal axes, which exchanges these and turns the
/// third: from north, east, down to east, north, up.
pub fn ned_in_map() -> UnitQuaternion<f64> {
    let (x, y) = (FRAC_1_SQRT_2, FRAC_1_SQRT_2);
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, x, y, 0.0))
}

/// Half a turn about the forward axis: from forward, left, up to forward, right, down.
pub fn ros_in_body() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}

/// North, east, down along east, north, up, and the other way round.
pub const ENU_NED: Matrix3<f64> = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
/// Forward, right, down along forward, left, up, and the other way round.
const FLU_FRD: Matrix3<f64> = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);

/// The body in a fixed frame: north, east, down unless it was turned.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Along the axes of the frame, m.
    pub position: Vector3<f64>,
    /// Body to frame.
    pub attitude: UnitQuaternion<f64>,
    /// Of position (m) and rotation (rad) about the axes of the frame.
    pub covariance: Matrix6<f64>,
}

impl Pose {
    /// The covariance of the position.
    pub fn position_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// The pose of an output that has an offset of position, m, and attitude, rad: it is in the
    /// covariance.
    #[must_use]
    pub fn widened(self, [p, turn]: [[f64; 3]; 2]) -> Self {
        let offset = Vector6::new(p[0], p[1], p[2], turn[0], turn[1], turn[2]);
        Self { covariance: self.covariance + offset * offset.transpose(), ..self }
    }

    /// The same pose in east, north, up, of the body forward, left, up (REP 103): with the rotation
    /// `S` from north, east, down and the half turn `F` of the body, `C_flu^enu = S C_b^n F`. `S`
    /// turns a rotation vector as it turns a position.
    pub fn of_ros(&self) -> Self {
        let mut turn = Matrix6::zeros();
        turn.fixed_view_mut::<3, 3>(0, 0).copy_from(&ENU_NED);
        turn.fixed_view_mut::<3, 3>(3, 3).copy_from(&ENU_NED);
        Self {
            position: ENU_NED * self.position,
            attitude: ned_in_map() * self.attitude * ros_in_body(),
            covariance: turn * self.covariance * turn.transpose(),
        }
    }
}

/// The velocity in body axes.
#[derive(Clone, Copy, Debug)]
pub struct Velocity {
    /// m/s.
    pub body: Vector3<f64>,
    /// (m/s)^2; the first element is -1 where there is no velocity.
    pub covariance: Matrix3<f64>,
}

impl Velocity {
    /// The same velocity along forward, left, up.
    pub fn of_ros(&self) -> Self {
        Self { body: FLU_FRD * self.body, covariance: FLU_FRD * self.covariance * FLU_FRD }
    }
}
