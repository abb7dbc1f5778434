//! Pressure and depth in the standard ocean: salinity 35, 0 deg C.
//!
//! P. M. Saunders, *Practical conversion of pressure to depth*, J. Physical Oceanography 11 (1981)
//! 573-574: `z = (1 - c) p - 2.21e-6 p^2` with `c = (5.92 + 5.25 sin^2 L) 1e-3`, for `p` in dbar. It
//! agrees with the equation of UNESCO 44 within 0.5 m down to 5 km, and within 1.4 m down to 7.5 km.

use navfuse_core::Real;
use navfuse_core::nalgebra::convert;

/// Pascals of one dbar.
const DECIBAR: f64 = 1e4;
/// Curvature of the depth, m/dbar^2.
const CURVATURE: f64 = 2.21e-6;

/// The slope `1 - c` at the surface, m/dbar.
fn slope<T: Real>(latitude: T) -> T {
    let sin = latitude.sin();
    convert::<f64, T>(1.0 - 5.92e-3) - sin * sin * convert(5.25e-3)
}

/// Depth (m) at a pressure above that of the atmosphere (Pa) and a latitude (rad).
pub fn depth_at<T: Real>(pressure: T, latitude: T) -> T {
    let p = pressure * convert(1.0 / DECIBAR);
    (slope(latitude) - p * convert(CURVATURE)) * p
}

/// Pressure above that of the atmosphere (Pa) at a depth (m) and a latitude (rad): the inverse of
/// [`depth_at`]. It is not finite below 111 km.
pub fn pressure_at<T: Real>(depth: T, latitude: T) -> T {
    let slope = slope(latitude);
    let root = (slope * slope - depth * convert(4.0 * CURVATURE)).sqrt();
    // 2 z / (s + r), in which nothing cancels near the surface
    depth * convert(2.0 * DECIBAR) / (slope + root)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of the paper: 7500 dbar at 30 deg are 7321.45 m.
    #[test]
    fn a_depth_is_the_check_value_of_saunders() {
        let latitude = 30_f64.to_radians();
        assert!((depth_at(7500e4, latitude) - 7321.45).abs() < 0.01);
        assert!((pressure_at(7321.45, latitude) / DECIBAR - 7500.0).abs() < 0.01);
    }

    #[test]
    fn pressure_is_the_inverse_of_depth_above_and_below_the_surface() {
        for depth in [-20.0, 0.0, 1e-3, 50.0, 11_000.0_f64] {
            let back = depth_at(pressure_at(depth, 0.8), 0.8);
            assert!((back - depth).abs() < 1e-11 * f64::max(1.0, depth), "{depth}: {back}");
        }
    }

    /// Depth of UNESCO 44 (Fofonoff and Millard 1983), from dbar and degrees.
    fn unesco(p: f64, latitude: f64) -> f64 {
        let x = latitude.to_radians().sin().powi(2);
        let gravity = 9.780_318 * (1.0 + (5.2788e-3 + 2.36e-5 * x) * x) + 1.092e-6 * p;
        (((-1.82e-15 * p + 2.279e-10) * p - 2.2512e-5) * p + 9.72659) * p / gravity
    }

    /// UNESCO 44 has the check value 9712.653 m for 10 000 dbar at 30 deg.
    #[test]
    fn down_to_5_km_the_depth_agrees_with_unesco_44_within_half_a_metre() {
        assert!((unesco(1e4, 30.0) - 9712.653).abs() < 1e-3);
        for latitude in [0.0_f64, 30.0, 60.0, 85.0] {
            for decibar in [1.0, 100.0, 1000.0, 2500.0, 5000.0] {
                let found = depth_at(decibar * DECIBAR, latitude.to_radians());
                let expected = unesco(decibar, latitude);
                assert!((found - expected).abs() < 0.5, "{latitude} {decibar}: {found} {expected}");
            }
        }
    }
}
