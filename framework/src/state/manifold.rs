//! The manifolds on which states live.
//!
//! A manifold defines the value that a model computes with, the retraction `x [+] d` of a tangent
//! vector, and its inverse `y [-] x`. The estimator needs nothing else of a state, so any type that
//! implements [`Manifold`] can be one.

use crate::Real;
use crate::state::geodesy::Geodetic;
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, UnitQuaternion, Vector3, convert};
use num_dual::Dual64;

/// Largest tangent dimension of one block.
pub const MAX_TANGENT: usize = 16;

/// Largest number of stored numbers of a value, where the coordinates give its derivative.
const MAX_AMBIENT: usize = 64;

/// A manifold, on which the value of a state block lives.
///
/// A positive number, whose error is a ratio:
/// ```
/// use navfuse_core::prelude::*;
/// struct PositiveNumber;
/// impl Manifold for PositiveNumber {
///     const AMBIENT: usize = 1;
///     const TANGENT: usize = 1;
///     type Value<T: Real> = T;
///     fn load<T: Real>(ambient: &[f64]) -> T {
///         convert(ambient[0])
///     }
///     fn store(value: &f64, ambient: &mut [f64]) {
///         ambient[0] = *value;
///     }
///     fn retract<T: Real>(x: &T, delta: &[T]) -> T {
///         *x * delta[0].exp()
///     }
///     fn local(to: &f64, from: &f64, delta: &mut [f64]) {
///         delta[0] = (to / from).ln();
///     }
///     fn coordinates<T: Real>(x: &T, out: &mut [T]) {
///         out[0] = *x;
///     }
///     fn from_coordinates(coordinates: &[f64]) -> f64 {
///         coordinates[0]
///     }
/// }
/// let mut delta = [0.0];
/// PositiveNumber::local(&3.0, &2.0, &mut delta);
/// assert!((PositiveNumber::retract::<f64>(&2.0, &delta) - 3.0).abs() < 1e-15);
/// ```
pub trait Manifold: Send + Sync + 'static {
    /// Number of stored numbers per value.
    const AMBIENT: usize;
    /// Dimension of the tangent space, at most [`MAX_TANGENT`].
    const TANGENT: usize;
    /// Coordinates in which sigma and error are read, see [`Reading`].
    const READING: Reading = Reading::Coordinates;
    /// `true` where the coordinates of `x [+] delta` are those of `x` plus `delta`.
    const FLAT: bool = false;
    /// A value with scalars of type `T`.
    type Value<T: Real>: Clone + 'static;

    /// Reads a value from its [`Self::AMBIENT`] numbers.
    fn load<T: Real>(ambient: &[f64]) -> Self::Value<T>;
    /// Writes a value to its [`Self::AMBIENT`] numbers.
    fn store(value: &Self::Value<f64>, ambient: &mut [f64]);
    /// `x [+] delta`, with [`Self::TANGENT`] numbers.
    fn retract<T: Real>(x: &Self::Value<T>, delta: &[T]) -> Self::Value<T>;
    /// `to [-] from`: the tangent vector at `from` that retracts to `to`.
    fn local(to: &Self::Value<f64>, from: &Self::Value<f64>, delta: &mut [f64]);
    /// Jacobian of the error about `x [+] delta` with respect to the error about `x`, row-major, by
    /// which the covariance changes when `delta` is injected (Sola, *Quaternion kinematics for the
    /// error-state Kalman filter*, section 6.3). Returns `false` where it is the identity.
    fn reset(_delta: &[f64], _jacobian: &mut [f64]) -> bool {
        false
    }
    /// The [`Self::TANGENT`] coordinates for presentation, in SI.
    fn coordinates<T: Real>(x: &Self::Value<T>, out: &mut [T]);
    /// The value with the given coordinates, the inverse of [`Self::coordinates`].
    fn from_coordinates(coordinates: &[f64]) -> Self::Value<f64>;
    /// Derivative of a value along its tangent. Default: the derivative of the coordinates times the
    /// inverse of [`Self::coordinate_jacobian`]. A manifold whose coordinates are singular
    /// somewhere defines it without them.
    fn slope(value: &Self::Value<Dual64>, tangent: &mut [f64]) {
        slope_by_coordinates::<Self>(value, tangent);
    }
    /// Jacobian of the coordinates with respect to the tangent, row-major; not finite where
    /// coordinates are singular. By default from dual numbers.
    fn coordinate_jacobian(ambient: &[f64], jacobian: &mut [f64]) {
        coordinate_jacobian::<Self>(ambient, jacobian);
    }
}

/// Jacobian of the coordinates by dual numbers, one pass for each axis of the tangent.
fn coordinate_jacobian<M: Manifold + ?Sized>(ambient: &[f64], jacobian: &mut [f64]) {
    let n = M::TANGENT;
    let base = M::load::<Dual64>(ambient);
    for k in 0..n {
        let mut delta = [Dual64::from(0.0); MAX_TANGENT];
        delta[k] = Dual64::from(0.0).derivative();
        let mut c = [Dual64::from(0.0); MAX_TANGENT];
        M::coordinates(&M::retract(&base, &delta[..n]), &mut c[..n]);
        for i in 0..n {
            jacobian[n * i + k] = c[i].eps;
        }
    }
}

/// The derivative along the tangent, by the coordinates. Without memory from the heap: the system of
/// equations is filled up with the identity.
fn slope_by_coordinates<M: Manifold + ?Sized>(value: &M::Value<Dual64>, tangent: &mut [f64]) {
    const { assert!(M::AMBIENT <= MAX_AMBIENT) };
    let n = M::TANGENT;
    let mut c = [Dual64::from(0.0); MAX_TANGENT];
    M::coordinates(value, &mut c[..n]);
    let mut ambient = [0.0; MAX_AMBIENT];
    let ambient = &mut ambient[..M::AMBIENT];
    M::store(&M::from_coordinates(&c.map(|c| c.re)[..n]), ambient);
    let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
    M::coordinate_jacobian(ambient, &mut jacobian);
    let entry = |i, k| if i < n && k < n { jacobian[n * i + k] } else { f64::from(i == k) };
    let jacobian = SMatrix::<f64, MAX_TANGENT, MAX_TANGENT>::from_fn(entry);
    let mut slope = SVector::from(c.map(|c| c.eps));
    if !jacobian.lu().solve_mut(&mut slope) {
        slope.fill(f64::NAN);
    }
    tangent.copy_from_slice(&slope.as_slice()[..n]);
}

/// Coordinates in which sigma and error of a block are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// In the block's coordinates: the sigma through their Jacobian, the error as their difference.
    Coordinates,
    /// In the block's coordinates, which are angles: differences are wrapped into +-pi.
    Angles,
    /// In the tangent: a position's coordinates are angles, its sigma and error metres.
    Tangent,
}

/// A real number.
#[derive(Debug)]
pub struct Scalar;

impl Manifold for Scalar {
    const AMBIENT: usize = 1;
    const TANGENT: usize = 1;
    const FLAT: bool = true;
    type Value<T: Real> = T;

    fn load<T: Real>(ambient: &[f64]) -> T {
        convert(ambient[0])
    }
    fn store(value: &f64, ambient: &mut [f64]) {
        ambient[0] = *value;
    }
    fn retract<T: Real>(x: &T, delta: &[T]) -> T {
        *x + delta[0]
    }
    fn local(to: &f64, from: &f64, delta: &mut [f64]) {
        delta[0] = to - from;
    }
    fn coordinates<T: Real>(x: &T, out: &mut [T]) {
        out[0] = *x;
    }
    fn from_coordinates(coordinates: &[f64]) -> f64 {
        coordinates[0]
    }
    fn slope(value: &Dual64, tangent: &mut [f64]) {
        tangent[0] = value.eps;
    }
}

/// A vector of `N` real numbers.
#[derive(Debug)]
pub struct Vector<const N: usize>;

impl<const N: usize> Manifold for Vector<N> {
    const AMBIENT: usize = N;
    const TANGENT: usize = N;
    const FLAT: bool = true;
    type Value<T: Real> = SVector<T, N>;

    fn load<T: Real>(ambient: &[f64]) -> SVector<T, N> {
        SVector::from_fn(|i, _| convert(ambient[i]))
    }
    fn store(value: &SVector<f64, N>, ambient: &mut [f64]) {
        ambient.copy_from_slice(value.as_slice());
    }
    fn retract<T: Real>(x: &SVector<T, N>, delta: &[T]) -> SVector<T, N> {
        SVector::from_fn(|i, _| x[i] + delta[i])
    }
    fn local(to: &SVector<f64, N>, from: &SVector<f64, N>, delta: &mut [f64]) {
        delta.copy_from_slice((to - from).as_slice());
    }
    fn coordinates<T: Real>(x: &SVector<T, N>, out: &mut [T]) {
        out.copy_from_slice(x.as_slice());
    }
    fn from_coordinates(coordinates: &[f64]) -> SVector<f64, N> {
        SVector::from_column_slice(coordinates)
    }
    fn slope(value: &SVector<Dual64, N>, tangent: &mut [f64]) {
        tangent.iter_mut().zip(value).for_each(|(t, v)| *t = v.eps);
    }
}

/// A rotation, SO(3), held as a unit quaternion (w, x, y, z).
///
/// `C [+] delta = exp([delta x]) C`: the error is resolved in the frame that the rotation maps
/// *to*: the navigation frame for `c_b_n`, the instrument frame for `c_b_d`. Coordinates are roll,
/// pitch and yaw of `C^T = R_x(roll) R_y(pitch) R_z(yaw)` (coordinate transformations, Groves eq.
/// 2.22, Pan & Wu eq. 16).
#[derive(Debug)]
pub struct Rotation;

impl Rotation {
    /// Rotation matrix to roll, pitch and yaw (Groves eq. 2.23).
    fn euler<T: Real>(c: &Rotation3<T>) -> [T; 3] {
        let m = c.matrix();
        // atan2 instead of the arc sine, which loses half of the digits near 90 deg
        let cos_pitch = (m[(2, 1)] * m[(2, 1)] + m[(2, 2)] * m[(2, 2)]).sqrt();
        [m[(2, 1)].atan2(m[(2, 2)]), (-m[(2, 0)]).atan2(cos_pitch), m[(1, 0)].atan2(m[(0, 0)])]
    }
}

impl Manifold for Rotation {
    const AMBIENT: usize = 4;
    const TANGENT: usize = 3;
    const READING: Reading = Reading::Angles;
    type Value<T: Real> = Rotation3<T>;

    fn load<T: Real>(ambient: &[f64]) -> Rotation3<T> {
        let (w, x, y, z) = (ambient[0], ambient[1], ambient[2], ambient[3]);
        let m = Matrix3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        );
        Rotation3::from_matrix_unchecked(m.map(convert))
    }
    fn store(value: &Rotation3<f64>, ambient: &mut [f64]) {
        // normalised, so that rounding does not accumulate over many corrections
        let q = UnitQuaternion::from_rotation_matrix(value);
        store_quaternion(&UnitQuaternion::new_normalize(q.into_inner()), ambient);
    }
    fn retract<T: Real>(x: &Rotation3<T>, delta: &[T]) -> Rotation3<T> {
        rotation_vector(&Vector3::new(delta[0], delta[1], delta[2])) * x
    }
    fn local(to: &Rotation3<f64>, from: &Rotation3<f64>, delta: &mut [f64]) {
        let q = UnitQuaternion::from_rotation_matrix(&(to * from.inverse()));
        delta.copy_from_slice(q.scaled_axis().as_slice());
    }
    fn reset(delta: &[f64], jacobian: &mut [f64]) -> bool {
        // error' = log(exp(error) exp(-delta)), so that its derivative at error = delta is the left
        // Jacobian of SO(3)
        let g = left_jacobian(&Vector3::new(delta[0], delta[1], delta[2]));
        for i in 0..3 {
            for j in 0..3 {
                jacobian[3 * i + j] = g[(i, j)];
            }
        }
        true
    }
    fn coordinates<T: Real>(x: &Rotation3<T>, out: &mut [T]) {
        out.copy_from_slice(&Self::euler(x));
    }
    fn from_coordinates(c: &[f64]) -> Rotation3<f64> {
        Rotation3::from_euler_angles(c[0], c[1], c[2])
    }
    /// From `dC = [w x] C`.
    fn slope(value: &Rotation3<Dual64>, tangent: &mut [f64]) {
        let (c, d) = (value.matrix().map(|v| v.re), value.matrix().map(|v| v.eps));
        let w = d * c.transpose();
        let half = [w[(2, 1)] - w[(1, 2)], w[(0, 2)] - w[(2, 0)], w[(1, 0)] - w[(0, 1)]];
        tangent.copy_from_slice(&half.map(|w| 0.5 * w));
    }
    /// Rates of roll, pitch and yaw for rotations about the axes of the frame that the rotation maps
    /// to, from `C = R_z R_y R_x` (the transposes of the coordinate transformations).
    fn coordinate_jacobian(ambient: &[f64], jacobian: &mut [f64]) {
        let c = Self::load::<f64>(ambient);
        // the first column is (cos pitch cos yaw, cos pitch sin yaw, -sin pitch)
        let (x, y, sin_pitch) = (c[(0, 0)], c[(1, 0)], -c[(2, 0)]);
        let cos2 = x * x + y * y;
        let cos_pitch = cos2.sqrt();
        jacobian[..9].copy_from_slice(&[
            x / cos2,
            y / cos2,
            0.0,
            -y / cos_pitch,
            x / cos_pitch,
            0.0,
            sin_pitch * x / cos2,
            sin_pitch * y / cos2,
            1.0,
        ]);
    }
}

/// The left Jacobian `J` of SO(3) at a rotation vector: `J [phi x] = exp([phi x]) - I`.
pub(crate) fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle2 = phi.norm_squared();
    let (a, b) = if angle2 < 1e-8 {
        (0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0)
    } else {
        let angle = angle2.sqrt();
        // 1 - cos by the half angle, without cancellation
        (2.0 * ((0.5 * angle).sin() / angle).powi(2), (angle - angle.sin()) / (angle2 * angle))
    };
    let skew = phi.cross_matrix();
    Matrix3::identity() + skew * a + skew * skew * b
}

/// Writes a quaternion as a [`Rotation`] block holds it.
pub fn store_quaternion(q: &UnitQuaternion<f64>, ambient: &mut [f64]) {
    ambient.copy_from_slice(&[q.w, q.i, q.j, q.k]);
}

/// Reads the quaternion of a [`Rotation`] block.
pub fn load_quaternion(ambient: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(
        ambient[0], ambient[1], ambient[2], ambient[3],
    ))
}

/// `exp([v x])` (Rodrigues), differentiable at zero.
fn rotation_vector<T: Real>(v: &Vector3<T>) -> Rotation3<T> {
    let angle2 = v.norm_squared();
    let (a, b): (T, T) = if angle2 < convert(1e-8) {
        (
            T::one() - angle2 * convert(1.0 / 6.0),
            convert::<f64, T>(0.5) - angle2 * convert(1.0 / 24.0),
        )
    } else {
        let angle = angle2.sqrt();
        (angle.sin() / angle, (T::one() - angle.cos()) / angle2)
    };
    let skew = v.cross_matrix();
    Rotation3::from_matrix_unchecked(Matrix3::identity() + skew * a + skew * skew * b)
}

/// A geodetic position on WGS-84; the tangent is north, east, down in metres.
#[derive(Debug)]
pub struct Position;

impl Manifold for Position {
    const AMBIENT: usize = 3;
    const TANGENT: usize = 3;
    const READING: Reading = Reading::Tangent;
    type Value<T: Real> = Geodetic<T>;

    fn load<T: Real>(a: &[f64]) -> Geodetic<T> {
        Geodetic { latitude: convert(a[0]), longitude: convert(a[1]), height: convert(a[2]) }
    }
    fn store(value: &Geodetic, ambient: &mut [f64]) {
        ambient.copy_from_slice(&[value.latitude, value.longitude, value.height]);
    }
    fn retract<T: Real>(x: &Geodetic<T>, delta: &[T]) -> Geodetic<T> {
        let mut y = x.displaced(&Vector3::new(delta[0], delta[1], delta[2]));
        if y.longitude > T::pi() {
            y.longitude -= T::two_pi();
        } else if y.longitude < -T::pi() {
            y.longitude += T::two_pi();
        }
        y
    }
    fn local(to: &Geodetic, from: &Geodetic, delta: &mut [f64]) {
        delta.copy_from_slice(to.ned_from(from).as_slice());
    }
    fn coordinates<T: Real>(x: &Geodetic<T>, out: &mut [T]) {
        out.copy_from_slice(&[x.latitude, x.longitude, x.height]);
    }
    fn from_coordinates(c: &[f64]) -> Geodetic {
        Geodetic { latitude: c[0], longitude: c[1], height: c[2] }
    }
    fn slope(value: &Geodetic<Dual64>, tangent: &mut [f64]) {
        let Geodetic { latitude, longitude, height } = value;
        let here = Geodetic { latitude: latitude.re, longitude: longitude.re, height: height.re };
        let moved = value.ned_from(&here.cast());
        tangent.iter_mut().zip(&moved).for_each(|(t, m)| *t = m.eps);
    }
}

/// Operations of a manifold on plain numbers, for the estimator, which does not know the type.
#[derive(Clone, Copy, Debug)]
pub struct Operations {
    /// [`Manifold::AMBIENT`].
    pub ambient: usize,
    /// [`Manifold::TANGENT`].
    pub tangent: usize,
    /// [`Manifold::READING`].
    pub reading: Reading,
    /// [`Manifold::FLAT`].
    pub flat: bool,
    /// Identity of the manifold's type, with which a handle of another type is rejected.
    pub kind: std::any::TypeId,
    /// `x = x [+] delta`.
    pub retract: fn(&mut [f64], &[f64]),
    /// `delta = to [-] from`.
    pub local: fn(&[f64], &[f64], &mut [f64]),
    /// [`Manifold::reset`].
    pub reset: fn(&[f64], &mut [f64]) -> bool,
    /// [`Manifold::coordinates`].
    pub coordinates: fn(&[f64], &mut [f64]),
    /// [`Manifold::coordinate_jacobian`].
    pub coordinate_jacobian: fn(&[f64], &mut [f64]),
    /// [`Manifold::from_coordinates`].
    pub from_coordinates: fn(&[f64], &mut [f64]),
}

impl Operations {
    /// Operations of the manifold `M`.
    pub fn of<M: Manifold>() -> Self {
        const { assert!(M::TANGENT <= MAX_TANGENT) };
        Self {
            ambient: M::AMBIENT,
            tangent: M::TANGENT,
            reading: M::READING,
            flat: M::FLAT,
            kind: std::any::TypeId::of::<M>(),
            retract: |x, delta| M::store(&M::retract(&M::load::<f64>(x), delta), x),
            local: |to, from, delta| M::local(&M::load(to), &M::load(from), delta),
            reset: M::reset,
            coordinates: |x, out| M::coordinates::<f64>(&M::load(x), out),
            coordinate_jacobian: M::coordinate_jacobian,
            from_coordinates: |c, out| M::store(&M::from_coordinates(c), out),
        }
    }
}
