//! The straight line between two positions, as sound takes it.

use navfuse_core::nalgebra::Matrix3;
use navfuse_core::prelude::*;

/// The straight line from one position to another, m: north, east and down at its beginning. The
/// difference of both in Earth-fixed axes, turned by `C_e^n` (Groves eq. 2.150); over 3 km, the
/// tangent plane of [`Geodetic::ned_from`] is 0.7 m too high.
pub(crate) fn line<T: navfuse_core::Real>(from: &Geodetic<T>, to: &Geodetic<T>) -> Vector3<T> {
    let ((sin, cos), (sin_lon, cos_lon)) = (from.latitude.sin_cos(), from.longitude.sin_cos());
    #[rustfmt::skip]
    let c_e_n = Matrix3::new(
        -sin * cos_lon, -sin * sin_lon, cos,
        -sin_lon, cos_lon, T::zero(),
        -cos * cos_lon, -cos * sin_lon, -sin,
    );
    c_e_n * (to.earth_fixed() - from.earth_fixed())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point 3 km to the north at the same height is below the horizon by `s^2 / 2R`, 0.706 m with
    /// the meridian radius of 6 368 km at 45 deg; the chord is shorter than the arc by 3e-5 m.
    #[test]
    fn a_distant_point_is_below_the_horizon() {
        let here = Geodetic { latitude: 45_f64.to_radians(), longitude: 3.0, height: 0.0 };
        let there = here.displaced(&Vector3::new(3000.0, 0.0, 0.0));
        let found = line(&here, &there);
        // the meridian radius changes by 5e-6 over 3 km
        assert!((found - Vector3::new(3000.0, 0.0, 0.7067)).norm() < 0.01, "{found}");
    }
}
