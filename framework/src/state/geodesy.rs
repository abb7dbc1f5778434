//! The WGS-84 ellipsoid, and positions on it.
//!
//! Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed.,
//! section 2.4.

use crate::Real;
use crate::checkpoint::saved;
use nalgebra::{Vector3, convert};

/// Equatorial radius of WGS-84, m.
pub const EQUATORIAL_RADIUS: f64 = 6_378_137.0;
/// Flattening of WGS-84.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// First eccentricity of WGS-84, squared.
pub const ECCENTRICITY_SQUARED: f64 = FLATTENING * (2.0 - FLATTENING);

/// A geodetic position on WGS-84.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geodetic<T = f64> {
    /// Geodetic latitude, rad.
    pub latitude: T,
    /// Longitude, rad.
    pub longitude: T,
    /// Height above the ellipsoid, m.
    pub height: T,
}

saved!(Geodetic { latitude, longitude, height });

/// Radii of curvature of the ellipsoid at a latitude (rad): meridian `R_N` and transverse `R_E`, m
/// (Groves eqs 2.105 and 2.106).
pub fn radii_of_curvature<T: Real>(latitude: T) -> (T, T) {
    let e2: T = convert(ECCENTRICITY_SQUARED);
    let a: T = convert(EQUATORIAL_RADIUS);
    let s = latitude.sin();
    let w2 = T::one() - e2 * s * s;
    let r_e = a / w2.sqrt();
    let r_n = r_e * (T::one() - e2) / w2;
    (r_n, r_e)
}

impl Geodetic {
    /// The position as a constant with scalars of type `T`.
    pub fn cast<T: Real>(&self) -> Geodetic<T> {
        let Self { latitude, longitude, height } = *self;
        Geodetic {
            latitude: convert(latitude),
            longitude: convert(longitude),
            height: convert(height),
        }
    }

    /// The position of a point in Earth-fixed axes, m, at least 100 km from the centre: the inverse
    /// of [`Geodetic::earth_fixed`]. `tan L = (z + e^2 R_E sin L) / p` (Groves eq. 2.113) is
    /// iterated; each step leaves less than 0.7 % of the error.
    pub fn from_earth_fixed(point: &Vector3<f64>) -> Self {
        let e2 = ECCENTRICITY_SQUARED;
        let axis = point.x.hypot(point.y);
        let mut latitude = point.z.atan2(axis * (1.0 - e2));
        for _ in 0..7 {
            let (_, r_e) = radii_of_curvature(latitude);
            latitude = (point.z + e2 * r_e * latitude.sin()).atan2(axis);
        }
        let (_, r_e) = radii_of_curvature(latitude);
        let (sin, cos) = latitude.sin_cos();
        // p cos L + z sin L = R_E (1 - e^2 sin^2 L) + h, which holds at the poles as well
        let height = axis * cos + point.z * sin - r_e * (1.0 - e2 * sin * sin);
        Self { latitude, longitude: point.y.atan2(point.x), height }
    }
}

/// Cosine of the latitude below which positions move along great circles: within 0.5 deg of a pole,
/// where degrees of longitude are no length.
const NEAR_POLE: f64 = 0.0087;

/// `1 - cos` of an angle, of its square.
fn versine<T: Real>(square: T) -> T {
    let half: T = convert(0.5);
    if square < convert(1e-8) {
        return square * half * (T::one() - square * convert(1.0 / 12.0));
    }
    let sine = (square.sqrt() * half).sin();
    sine * sine * convert(2.0)
}

/// Sine of an angle over the angle, of its square.
fn sinc<T: Real>(square: T) -> T {
    if square < convert(1e-8) {
        return T::one() - square * convert(1.0 / 6.0);
    }
    let angle = square.sqrt();
    angle.sin() / angle
}

impl<T: Real> Geodetic<T> {
    /// The position after a move along a great circle of the normals of the ellipsoid, by angles to
    /// the north and to the east at its beginning, rad. It has no singularity: beyond a pole the
    /// longitude is that of the other side.
    #[must_use]
    pub fn along(&self, north: T, east: T) -> Self {
        let square = north * north + east * east;
        let (sinc, cos_way) = (sinc(square), T::one() - versine(square));
        let (sin, cos) = self.latitude.sin_cos();
        // the normal in axes of the meridian: away from the axis of the Earth, east, and north pole
        let away = cos * cos_way - sin * north * sinc;
        let aside = east * sinc;
        let axis = sin * cos_way + cos * north * sinc;
        let flat = away * away + aside * aside;
        // at the pole itself the root has no derivative
        let flat = if flat > T::zero() { flat.sqrt() } else { T::zero() };
        Self {
            latitude: axis.atan2(flat),
            longitude: self.longitude + aside.atan2(away),
            height: self.height,
        }
    }

    /// Angles to the north and to the east, rad, by which [`Self::along`] leads from `origin` here.
    fn way_from(&self, origin: &Self) -> [T; 2] {
        let ((sin, cos), (sin_o, cos_o)) = (self.latitude.sin_cos(), origin.latitude.sin_cos());
        let (sin_lon, cos_lon) = (self.longitude - origin.longitude).sin_cos();
        let north = cos_o * sin - sin_o * cos * cos_lon;
        let east = cos * sin_lon;
        let up = cos_o * cos * cos_lon + sin_o * sin;
        let square = north * north + east * east;
        let over = if square < convert(1e-8) && up > T::zero() {
            T::one() + square * convert(1.0 / 6.0)
        } else {
            let sine = square.sqrt();
            sine.atan2(up) / sine
        };
        [north * over, east * over]
    }

    /// Angle about the vertical, rad, by which the azimuth of a direction grows that is carried along
    /// the great circle from here to `to` (Napier's analogies):
    /// `tan(g/2) = tan(dlon/2) sin((L + L')/2) / cos((L' - L)/2)`.
    pub fn turn_to(&self, to: &Self) -> T {
        let half: T = convert(0.5);
        let (sin, cos) = ((to.longitude - self.longitude) * half).sin_cos();
        let middle = ((to.latitude + self.latitude) * half).sin();
        let apart = ((to.latitude - self.latitude) * half).cos();
        // a difference of the longitudes beyond half a turn is taken the short way round
        let (sin, cos) = if cos < T::zero() { (-sin, -cos) } else { (sin, cos) };
        (sin * middle).atan2(cos * apart) * convert(2.0)
    }

    /// The position in Earth-fixed axes, m: x through the equator at Greenwich, z through the north
    /// pole (Groves eq. 2.112).
    pub fn earth_fixed(&self) -> Vector3<T> {
        let (_, r_e) = radii_of_curvature(self.latitude);
        let ((sin, cos), (sin_lon, cos_lon)) = (self.latitude.sin_cos(), self.longitude.sin_cos());
        let axis = (r_e + self.height) * cos;
        let e2: T = convert(ECCENTRICITY_SQUARED);
        let z = (r_e * (T::one() - e2) + self.height) * sin;
        Vector3::new(axis * cos_lon, axis * sin_lon, z)
    }

    /// The position displaced by north, east and down metres along the local tangent; within 0.5 deg of
    /// a pole along a great circle, which leads across the pole.
    pub fn displaced(&self, ned: &Vector3<T>) -> Self {
        let (r_n, r_e) = radii_of_curvature(self.latitude);
        let cos = self.latitude.cos();
        if cos < convert(NEAR_POLE) {
            let moved = self.along(ned.x / (r_n + self.height), ned.y / (r_e + self.height));
            return Self { height: self.height - ned.z, ..moved };
        }
        Self {
            latitude: self.latitude + ned.x / (r_n + self.height),
            longitude: self.longitude + ned.y / ((r_e + self.height) * cos),
            height: self.height - ned.z,
        }
    }

    /// North, east and down metres from `origin` to this position, in the tangent at `origin`: the
    /// inverse of [`Self::displaced`]. The longitude difference is taken the short way round the
    /// antimeridian.
    pub fn ned_from(&self, origin: &Self) -> Vector3<T> {
        let (r_n, r_e) = radii_of_curvature(origin.latitude);
        let cos = origin.latitude.cos();
        if cos < convert(NEAR_POLE) {
            let [north, east] = self.way_from(origin);
            let down = origin.height - self.height;
            return Vector3::new(north * (r_n + origin.height), east * (r_e + origin.height), down);
        }
        let two_pi = T::two_pi();
        let mut d_lon = self.longitude - origin.longitude;
        if d_lon > T::pi() {
            d_lon -= two_pi;
        } else if d_lon < -T::pi() {
            d_lon += two_pi;
        }
        Vector3::new(
            (self.latitude - origin.latitude) * (r_n + origin.height),
            d_lon * (r_e + origin.height) * cos,
            origin.height - self.height,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without its height the point lies on the ellipsoid, whose normal has the latitude and the
    /// longitude. Rounding of 6e6 m is 1e-9 m.
    #[test]
    fn a_point_in_earth_fixed_axes_is_its_height_above_the_ellipsoid_along_the_normal() {
        let (a, e2) = (6_378_137.0, ECCENTRICITY_SQUARED);
        for (latitude, longitude, height) in
            [(0.0, 0.0, 0.0), (0.7, 2.0, 1e4), (-1.2, -0.3, -11e3), (1.57, 1.0, 2e5)]
        {
            let (latitude, longitude): (f64, f64) = (latitude, longitude);
            let found = Geodetic { latitude, longitude, height }.earth_fixed();
            let back = Geodetic::from_earth_fixed(&found);
            let errors = [back.latitude - latitude, back.longitude - longitude];
            assert!(errors.iter().all(|e| e.abs() < 1e-12), "{errors:?}");
            assert!((back.height - height).abs() < 5e-9, "{back:?}");
            let (sin, cos) = latitude.sin_cos();
            let normal = Vector3::new(cos * longitude.cos(), cos * longitude.sin(), sin);
            let foot = found - normal * height;
            // (x^2 + y^2) / a^2 + z^2 / b^2 = 1 with b^2 = a^2 (1 - e^2), and the normal is along
            // its gradient
            let scaled = Vector3::new(foot.x, foot.y, foot.z / (1.0 - e2)) / a;
            let size = foot.x * scaled.x + foot.y * scaled.y + foot.z * scaled.z;
            assert!((size / a - 1.0).abs() < 1e-15, "{latitude}: {size}");
            assert!((scaled.normalize() - normal).norm() < 1e-15, "{latitude}");
        }
    }
}
