//! Axes: those of ROS (REP 103) and of marine instruments, turned to the axes of navfuse.
//!
//! | | ROS | navfuse |
//! |---|---|---|
//! | body | forward, left, up | forward, right, down |
//! | world | east, north, up | north, east, down |

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};
use schemars::JsonSchema;
use serde::Deserialize;

/// Axes of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(rename = "BodyAxes")] // the schema of a scenario has other axes, too
pub enum Axes {
    /// Forward, left, up, as REP 103 has them.
    Flu,
    /// Forward, right, down.
    Frd,
}

/// A vector along forward, left, up, or one along forward, right, down: the other one.
pub const fn flip([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -y, -z]
}

/// A vector along east, north, up, or one along north, east, down: the other one.
pub const fn swap([x, y, z]: [f64; 3]) -> [f64; 3] {
    [y, x, -z]
}

impl Axes {
    /// A vector along these axes, along forward, right, down.
    pub fn body(self, vector: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Flu => flip(vector),
            Self::Frd => vector,
        }
    }
}

/// The attitude of a body in the world: `C_b^n` from the quaternion `x, y, z, w` of a message, whose
/// body has these axes. With `F` from [`flip`] and `S` from [`swap`], `C_b^n = S C_flu^enu F`. A
/// message whose body is forward, right, down has the world north, east, down, too. Returns `None`
/// for a quaternion that is no rotation.
pub fn attitude([x, y, z, w]: [f64; 4], axes: Axes) -> Option<Rotation3<f64>> {
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    if norm.is_nan() || (norm - 1.0).abs() > 0.01 {
        return None;
    }
    let c = UnitQuaternion::from_quaternion(q).to_rotation_matrix();
    Some(match axes {
        Axes::Frd => c,
        Axes::Flu => {
            let columns = Matrix3::from_columns(&[0, 1, 2].map(|k| {
                let unit = std::array::from_fn(|i| f64::from(u8::from(i == k)));
                (c.matrix() * nalgebra::Vector3::from(flip(unit))).into_owned()
            }));
            let row = |k: usize| columns.row(k).into_owned();
            Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[row(1), row(0), -row(2)]))
        }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use nalgebra::Vector3;

    fn degrees(q: UnitQuaternion<f64>, axes: Axes) -> [f64; 3] {
        let (roll, pitch, yaw) = attitude([q.i, q.j, q.k, q.w], axes).unwrap().euler_angles();
        [roll, pitch, yaw].map(f64::to_degrees)
    }

    fn close(found: [f64; 3], expected: [f64; 3]) {
        let near = found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near, "{found:?} {expected:?}");
    }

    #[test]
    fn poses_that_one_can_imagine_have_the_angles_that_one_expects() {
        // forward along east
        close(degrees(UnitQuaternion::identity(), Axes::Flu), [0.0, 0.0, 90.0]);
        // turned left by 90 degrees: forward along north
        let left =
            |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle.to_radians());
        close(degrees(left(90.0), Axes::Flu), [0.0, 0.0, 0.0]);
        // nose up: a positive pitch here, a negative angle about the left axis there
        let up = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -10_f64.to_radians());
        close(degrees(left(90.0) * up, Axes::Flu), [0.0, 10.0, 0.0]);
        // right side down
        let roll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 5_f64.to_radians());
        close(degrees(left(60.0) * up * roll, Axes::Flu), [5.0, 10.0, 30.0]);
        close(degrees(left(60.0), Axes::Frd), [0.0, 0.0, 60.0]);
    }

    #[test]
    fn the_attitude_turns_vectors_as_the_axes_are_turned() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.7, 2.1);
        let c_b_n = attitude([q.i, q.j, q.k, q.w], Axes::Flu).unwrap();
        let v = [0.3, -1.2, 0.8];
        let there = swap((q * Vector3::from(v)).into());
        let here = c_b_n * Vector3::from(flip(v));
        close(here.into(), there);
        assert!((c_b_n.matrix().determinant() - 1.0).abs() < 1e-12);
        assert_eq!((flip(flip(v)), swap(swap(v))), (v, v));
    }

    #[test]
    fn what_is_no_rotation_gives_no_attitude() {
        for q in [[0.0; 4], [1.0, 1.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0, 1.0]] {
            assert_eq!(attitude(q, Axes::Flu), None);
        }
    }
}
