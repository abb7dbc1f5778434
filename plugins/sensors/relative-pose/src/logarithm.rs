//! The rotation vector of a rotation, differentiable at zero.

use navfuse_core::Real;
use navfuse_core::nalgebra::{Rotation3, Vector3, convert};

/// Squared sine of the angle below which the series replaces the arc tangent. The first term that
/// the series leaves out is 35/1152 of its fourth power, 3e-18.
const SMALL: f64 = 1e-4;

/// `log(C)`: the axis times the angle, rad, for angles below half a turn.
///
/// `C - C' = 2 sin(angle) [axis x]` and `trace C = 1 + 2 cos(angle)` (Rodrigues).
pub fn rotation_vector<T: Real>(c: &Rotation3<T>) -> Vector3<T> {
    let half = |i, j| (c[(i, j)] - c[(j, i)]) * convert::<f64, T>(0.5);
    let sine = Vector3::new(half(2, 1), half(0, 2), half(1, 0));
    let cosine = (c[(0, 0)] + c[(1, 1)] + c[(2, 2)] - T::one()) * convert::<f64, T>(0.5);
    let square = sine.norm_squared();
    let factor = if square < convert(SMALL) && cosine > T::zero() {
        // asin(s) / s = 1 + s^2 / 6 + 3 s^4 / 40 + 5 s^6 / 112 + ...
        let last = square * convert::<f64, T>(5.0 / 112.0) + convert::<f64, T>(3.0 / 40.0);
        (last * square + convert::<f64, T>(1.0 / 6.0)) * square + T::one()
    } else {
        let s = square.sqrt();
        s.atan2(cosine) / s
    };
    sine * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::nalgebra::Matrix3;

    /// Near half a turn the sine loses digits: 1e-6 rad from there, ten remain.
    #[test]
    fn the_logarithm_is_the_inverse_of_the_exponential() {
        let axis = Vector3::new(2.0, -1.0, 0.5).normalize();
        for angle in [0.0, 1e-9, 1e-4, 0.00999, 0.01001, 0.3, 1.5, 1.7, 3.0, 3.141_591] {
            let found = rotation_vector(&Rotation3::new(axis * angle));
            assert!((found - axis * angle).norm() < 1e-9, "{angle}: {found}");
        }
    }

    /// Where the series is used the result keeps all digits: three roundings of 1.1e-16 each, and
    /// 3e-18 that the series leaves out.
    #[test]
    fn the_logarithm_of_a_small_rotation_has_all_digits() {
        for angle in [1e-3, 3e-3, 9e-3, 0.0099] {
            // about z, where the sine of the angle stands in the matrix as it is
            let (s, c) = f64::sin_cos(angle);
            let matrix = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
            let found = rotation_vector(&Rotation3::from_matrix_unchecked(matrix)).z;
            assert!((found / angle - 1.0).abs() < 4e-16, "{angle}: {found:e}");
        }
    }
}
