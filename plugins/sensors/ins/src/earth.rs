//! Earth rotation and normal gravity in north-east-down axes.

use nalgebra::Vector3;
use navfuse_core::checkpoint::saved;
use navfuse_core::state::geodesy::{
    ECCENTRICITY_SQUARED, EQUATORIAL_RADIUS, FLATTENING, radii_of_curvature,
};

/// Earth rotation rate of WGS-84, rad/s.
pub const EARTH_RATE: f64 = 7.292_115e-5;
/// Earth's gravitational constant of WGS-84, m^3/s^2.
pub const GM: f64 = 3.986_004_418e14;
/// Normal gravity on the ellipsoid at the equator, m/s^2 (Groves eq. 2.134).
const EQUATORIAL_GRAVITY: f64 = 9.780_325_335_9;
/// The constant `k` of Somigliana's formula (Groves eq. 2.134).
const SOMIGLIANA: f64 = 0.001_931_853;

/// The ellipsoid, its rotation and its gravity at one latitude and height, computed in one pass.
///
/// Valid short of the poles, where `1 / cos` is finite.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalEarth {
    /// Sine of the latitude.
    pub sin: f64,
    /// Cosine of the latitude.
    pub cos: f64,
    /// `1 / cos` of the latitude.
    pub inv_cos: f64,
    /// `1 / (R_N + h)`, 1/m, of the meridian radius (Groves eq. 2.105).
    pub inv_n: f64,
    /// `1 / (R_E + h)`, 1/m, of the transverse radius (Groves eq. 2.106).
    pub inv_e: f64,
    /// `d R_N / d L`, m/rad.
    pub r_n_slope: f64,
    /// `d R_E / d L`, m/rad.
    pub r_e_slope: f64,
    /// Normal gravity, down, m/s^2: Somigliana's formula (Groves eq. 2.134) and its second-order
    /// change with height (eq. 2.139). The north component above the ellipsoid, 8e-9 h sin 2L
    /// (eq. 2.140), is omitted.
    pub gravity: f64,
    /// Derivative of gravity by the latitude, m/s^2/rad.
    pub gravity_latitude: f64,
    /// Derivative of gravity by the height, 1/s^2.
    pub gravity_height: f64,
}

saved!(LocalEarth {
    sin,
    cos,
    inv_cos,
    inv_n,
    inv_e,
    r_n_slope,
    r_e_slope,
    gravity,
    gravity_latitude,
    gravity_height
});

impl LocalEarth {
    /// The Earth at a latitude (rad) and height (m).
    pub fn at(latitude: f64, height: f64) -> Self {
        let (sin, cos) = latitude.sin_cos();
        Self::from_sin_cos(sin, cos, height)
    }

    /// The Earth at the latitude with this sine and cosine, and a height (m).
    #[inline]
    pub fn from_sin_cos(sin: f64, cos: f64, height: f64) -> Self {
        const E2: f64 = ECCENTRICITY_SQUARED;
        const A: f64 = EQUATORIAL_RADIUS;
        /// Ratio of centrifugal to gravitational acceleration at the equator, `w^2 a^2 b / GM`.
        const M: f64 = EARTH_RATE * EARTH_RATE * A * A * A * (1.0 - FLATTENING) / GM;
        // R_E = a / sqrt(1 - e^2 s^2) and R_N = R_E (1 - e^2) / (1 - e^2 s^2) (Groves eqs 2.106,
        // 2.105)
        let s2 = sin * sin;
        let w2 = 1.0 - E2 * s2;
        let inv_w = 1.0 / w2.sqrt();
        let inv_w2 = inv_w * inv_w;
        let r_e = A * inv_w;
        let r_n = r_e * (1.0 - E2) * inv_w2;
        let r_e_slope = r_e * E2 * sin * cos * inv_w2;

        // g0 = g_e (1 + k s^2) / sqrt(1 - e^2 s^2) (Groves eq. 2.134)
        let shape = 1.0 + SOMIGLIANA * s2;
        let g0 = EQUATORIAL_GRAVITY * shape * inv_w;
        // d g0 / d s2, from g0 = g_e (1 + k s2) w2^(-1/2).
        let g0_s2 = EQUATORIAL_GRAVITY * inv_w * (SOMIGLIANA + 0.5 * E2 * shape * inv_w2);
        // g(h) = g0 (1 - 2/a (1 + f (1 - 2 s^2) + m) h + 3/a^2 h^2) (Groves eq. 2.139)
        let gradient = 2.0 / A * (1.0 + FLATTENING * (1.0 - 2.0 * s2) + M);
        let with_height = 1.0 - (gradient - 3.0 / (A * A) * height) * height;
        Self {
            sin,
            cos,
            inv_cos: 1.0 / cos,
            inv_n: 1.0 / (r_n + height),
            inv_e: 1.0 / (r_e + height),
            r_n_slope: 3.0 * r_n * E2 * sin * cos * inv_w2,
            r_e_slope,
            gravity: g0 * with_height,
            gravity_latitude: 2.0
                * sin
                * cos
                * (g0_s2 * with_height + g0 * 4.0 * FLATTENING / A * height),
            gravity_height: g0 * (6.0 / (A * A) * height - gradient),
        }
    }

    /// Earth rate `w_ie^n`, rad/s (Groves eq. 2.123).
    #[inline]
    pub fn earth_rate(&self) -> Vector3<f64> {
        Vector3::new(EARTH_RATE * self.cos, 0.0, -EARTH_RATE * self.sin)
    }

    /// Transport rate `w_en^n` of a velocity (m/s, NED), rad/s (Groves eq. 5.44).
    #[inline]
    pub fn transport_rate(&self, velocity: &Vector3<f64>) -> Vector3<f64> {
        let east = velocity.y * self.inv_e;
        Vector3::new(east, -velocity.x * self.inv_n, -east * self.sin * self.inv_cos)
    }
}

/// A node of a grid of latitudes: sine and cosine of latitudes near it are short series, many times
/// faster than the functions themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LatitudeNode {
    latitude: f64,
    sin: f64,
    cos: f64,
    /// Meridian radius of curvature, m (Groves eq. 2.105), and its slope, m/rad.
    r_n: f64,
    r_n_slope: f64,
}

saved!(LatitudeNode { latitude, sin, cos, r_n, r_n_slope });

impl LatitudeNode {
    /// Distance of the nodes, rad: 6 km.
    const STEP: f64 = 1.0 / 1024.0;

    /// The node nearest to a latitude, rad.
    pub fn near(latitude: f64) -> Self {
        let latitude = (latitude / Self::STEP).round() * Self::STEP;
        let LocalEarth { sin, cos, r_n_slope, .. } = LocalEarth::at(latitude, 0.0);
        let (r_n, _) = radii_of_curvature(latitude);
        Self { latitude, sin, cos, r_n, r_n_slope }
    }

    /// Returns `true` if it is the nearest node to a latitude, rad.
    #[inline]
    pub fn is_nearest(&self, latitude: f64) -> bool {
        (latitude - self.latitude).abs() <= 0.5 * Self::STEP
    }

    /// Sine and cosine of a latitude (rad) for which this is the nearest node, or nearly so. With
    /// `x` below 5e-4, the first terms omitted are `x^7 / 7!` and `x^6 / 6!`, below 3e-23.
    #[inline]
    pub fn sin_cos(&self, latitude: f64) -> (f64, f64) {
        let x = latitude - self.latitude;
        let x2 = x * x;
        let sin_x = x * (1.0 - x2 * (1.0 / 6.0) * (1.0 - x2 * (1.0 / 20.0)));
        // 1 - cos x
        let versine = 0.5 * x2 * (1.0 - x2 * (1.0 / 12.0));
        let sin = self.sin + (self.cos * sin_x - self.sin * versine);
        let cos = self.cos - (self.sin * sin_x + self.cos * versine);
        (sin, cos)
    }

    /// Meridian radius of curvature, m, at a latitude (rad) for which this is the nearest node: the
    /// second-order term, 3 a e^2 x^2 / 2, is omitted and below 1.6 cm.
    #[inline]
    pub fn r_n(&self, latitude: f64) -> f64 {
        self.r_n + self.r_n_slope * (latitude - self.latitude)
    }
}

/// Earth rate `w_ie^n` at a latitude (rad), rad/s (Groves eq. 2.123).
pub fn earth_rate_ned(latitude: f64) -> Vector3<f64> {
    let (s, c) = latitude.sin_cos();
    Vector3::new(EARTH_RATE * c, 0.0, -EARTH_RATE * s)
}

/// Transport rate `w_en^n` at a latitude (rad) and height (m) for a velocity (m/s, NED), rad/s
/// (Groves eq. 5.44).
pub fn transport_rate_ned(latitude: f64, height: f64, velocity: &Vector3<f64>) -> Vector3<f64> {
    LocalEarth::at(latitude, height).transport_rate(velocity)
}

/// Magnitude of normal gravity at a latitude (rad) and height (m), m/s^2 (see
/// [`LocalEarth::gravity`]).
pub fn normal_gravity(latitude: f64, height: f64) -> f64 {
    LocalEarth::at(latitude, height).gravity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_gravity_has_the_published_values() {
        // WGS-84: equator 9.7803253359, pole 9.8321849378 (NIMA TR8350.2); 45 degrees 9.80620
        // (Somigliana).
        let at = |degrees: f64| normal_gravity(degrees.to_radians(), 0.0);
        assert!((at(0.0) - 9.780_325_335_9).abs() < 1e-12);
        // The formula's k has seven digits, so 5e-10 * g_e = 5e-9 m/s^2.
        assert!((at(90.0) - 9.832_184_937_8).abs() < 1e-8, "{}", at(90.0));
        assert!((at(45.0) - 9.806_20).abs() < 5e-6, "{}", at(45.0));
        // The free-air gradient, -0.3086 mGal/m.
        assert!((normal_gravity(0.8, 1.0) - normal_gravity(0.8, 0.0) + 3.086e-6).abs() < 2e-9);
    }

    #[test]
    fn the_slopes_are_the_derivatives() {
        for degrees in [-80.0_f64, -33.0, 0.0, 12.0, 45.0, 79.0] {
            let (latitude, height) = (degrees.to_radians(), -2_000.0);
            let here = LocalEarth::at(latitude, height);
            // Central differences: the third derivatives are of the order of the slopes, so 1e-8 of
            // their scale.
            let d = 1e-4;
            let (north, south) =
                (radii_of_curvature(latitude + d), radii_of_curvature(latitude - d));
            let g = |l: f64, h: f64| normal_gravity(latitude + l, height + h);
            assert!((here.r_n_slope - (north.0 - south.0) / (2.0 * d)).abs() < 1e-2);
            assert!((here.r_e_slope - (north.1 - south.1) / (2.0 * d)).abs() < 1e-2);
            assert!((here.gravity_latitude - (g(d, 0.0) - g(-d, 0.0)) / (2.0 * d)).abs() < 1e-8);
            assert!((here.gravity_height - (g(0.0, 50.0) - g(0.0, -50.0)) / 100.0).abs() < 1e-15);
            let (r_n, r_e) = radii_of_curvature(latitude);
            assert!((here.inv_n * (r_n + height) - 1.0).abs() < 1e-15);
            assert!((here.inv_e * (r_e + height) - 1.0).abs() < 1e-15);
        }
    }

    /// Rounding of two products and two sums below one: 2 eps. The radius: `LatitudeNode::r_n`.
    #[test]
    fn sine_cosine_and_radius_near_a_node_are_those_of_the_functions() {
        for k in -15_000..=15_000 {
            let latitude = 1e-4 * f64::from(k);
            let node = LatitudeNode::near(latitude);
            assert!(node.is_nearest(latitude));
            let ((sin, cos), exact) = (node.sin_cos(latitude), latitude.sin_cos());
            let error = (sin - exact.0).abs().max((cos - exact.1).abs());
            assert!(error <= 2.0 * f64::EPSILON, "{latitude}: {error:e}");
            let off = node.r_n(latitude) - radii_of_curvature(latitude).0;
            assert!(off.abs() < 0.016, "{latitude}: {off} m");
        }
    }

    #[test]
    fn a_node_is_the_nearest_one_up_to_half_a_step() {
        let node = LatitudeNode::near(0.3);
        let half = 0.5 * LatitudeNode::STEP;
        for (offset, nearest) in [(-0.99, true), (0.99, true), (-1.01, false), (1.01, false)] {
            assert_eq!(node.is_nearest(node.latitude + offset * half), nearest, "{offset}");
        }
        assert!(!node.is_nearest(f64::NAN));
    }
}
