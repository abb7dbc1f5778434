//! Numbers that a channel receives from the fields of a message.

use std::f64::consts::{PI, TAU};

/// Radius of the Earth in the projection of PX4, m.
const RADIUS: f64 = 6_371_000.0;

/// A number made from fields, where `P` is the name of a field, or its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term<P> {
    /// A field.
    Field(P),
    /// A field divided by another one.
    Ratio(P, P),
    /// The sum of two fields, and their difference.
    Sum(P, P),
    Minus(P, P),
    /// The root mean square of two fields.
    MeanSquare(P, P),
    /// Roll, pitch or yaw of a quaternion w, x, y, z from the body to north, east, down.
    Euler(usize, [P; 4]),
    /// Latitude or longitude (rad) of a local position north and east (m) of a reference point with
    /// latitude and longitude (deg), as PX4 projects it.
    Projected(usize, [P; 4]),
    /// North or east component of a speed with a course, and the radians of the unit of the course.
    Component(usize, P, P, f64),
    /// North or east component of a velocity along the axes x and y of a wander frame. The heading is
    /// the platform's minus the wander angle `a`, so the azimuth of x is `-a`:
    /// `v_n = v_x cos a + v_y sin a`, `v_e = v_y cos a - v_x sin a`.
    Unwandered(usize, [P; 3]),
    /// The difference of two angles, as an angle from minus pi to pi.
    AngleBetween(P, P),
}

impl<P: Copy> Term<P> {
    /// The same number with other names of the fields; `None` if a field has none.
    pub fn map<Q>(self, place: impl Fn(P) -> Option<Q>) -> Option<Term<Q>> {
        let four = |[a, b, c, d]: [P; 4]| Some([place(a)?, place(b)?, place(c)?, place(d)?]);
        Some(match self {
            Self::Field(a) => Term::Field(place(a)?),
            Self::Ratio(a, b) => Term::Ratio(place(a)?, place(b)?),
            Self::Sum(a, b) => Term::Sum(place(a)?, place(b)?),
            Self::Minus(a, b) => Term::Minus(place(a)?, place(b)?),
            Self::MeanSquare(a, b) => Term::MeanSquare(place(a)?, place(b)?),
            Self::Euler(axis, q) => Term::Euler(axis, four(q)?),
            Self::Projected(axis, p) => Term::Projected(axis, four(p)?),
            Self::Component(axis, a, b, unit) => Term::Component(axis, place(a)?, place(b)?, unit),
            Self::Unwandered(axis, [a, b, c]) => {
                Term::Unwandered(axis, [place(a)?, place(b)?, place(c)?])
            }
            Self::AngleBetween(a, b) => Term::AngleBetween(place(a)?, place(b)?),
        })
    }
}

impl Term<usize> {
    /// The number for the fields of a message; NaN beyond their end.
    pub fn value(&self, fields: &[f64]) -> f64 {
        let at = |k: usize| fields.get(k).copied().unwrap_or(f64::NAN);
        match *self {
            Self::Field(a) => at(a),
            Self::Ratio(a, b) => at(a) / at(b),
            Self::Sum(a, b) => at(a) + at(b),
            Self::Minus(a, b) => at(a) - at(b),
            Self::MeanSquare(a, b) => (0.5 * (at(a).powi(2) + at(b).powi(2))).sqrt(),
            Self::Euler(axis, q) => euler(axis, q.map(at)),
            Self::Projected(axis, p) => projected(p.map(at))[axis.min(1)],
            Self::Component(axis, speed, course, unit) => {
                let (sin, cos) = (at(course) * unit).sin_cos();
                at(speed) * [cos, sin][axis.min(1)]
            }
            Self::Unwandered(axis, [x, y, angle]) => {
                let (sin, cos) = at(angle).sin_cos();
                let (x, y) = (at(x), at(y));
                [x * cos + y * sin, y * cos - x * sin][axis.min(1)]
            }
            Self::AngleBetween(a, b) => (at(a) - at(b) + PI).rem_euclid(TAU) - PI,
        }
    }
}

/// Roll, pitch or yaw of a quaternion. A quaternion of zeros has none.
fn euler(axis: usize, q: [f64; 4]) -> f64 {
    let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    if !(norm > 0.5 && norm < 2.0) {
        return f64::NAN;
    }
    let [w, x, y, z] = q.map(|c| c / norm);
    match axis {
        0 => (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
        1 => (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
        _ => (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
    }
}

/// Latitude and longitude of a point in an azimuthal equidistant projection.
fn projected([north, east, latitude, longitude]: [f64; 4]) -> [f64; 2] {
    let (lat, lon) = (latitude.to_radians(), longitude.to_radians());
    let (x, y) = (north / RADIUS, east / RADIUS);
    let c = x.hypot(y);
    if c == 0.0 {
        return [lat, lon];
    }
    let (sin, cos) = c.sin_cos();
    let sine = cos * lat.sin() + x * sin * lat.cos() / c;
    let turn = (y * sin).atan2(c * lat.cos() * cos - x * lat.sin() * sin);
    [sine.clamp(-1.0, 1.0).asin(), lon + turn]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_local_position_is_along_the_meridian_and_the_parallel() {
        let here = [47.0, 8.0];
        let at = |north, east| projected([north, east, here[0], here[1]]);
        assert_eq!(at(0.0, 0.0), here.map(f64::to_radians));
        let [lat, lon] = at(100.0, 0.0);
        assert!((lat - here[0].to_radians() - 100.0 / RADIUS).abs() < 1e-15 * 10.0);
        assert!((lon - here[1].to_radians()).abs() < 1e-15);
        // the second order of the meridians' convergence is 100^2 / R tan(lat) / 2 = 0.8 mm
        let [lat, lon] = at(0.0, 100.0);
        assert!(
            (lon - here[1].to_radians() - 100.0 / (RADIUS * 47_f64.to_radians().cos())).abs()
                < 1e-12
        );
        assert!(((lat - here[0].to_radians()) * RADIUS + 0.000_84).abs() < 1e-5, "{lat}");
    }

    #[test]
    fn a_quaternion_has_the_angles_from_which_it_is_made() {
        let angles = [0.3_f64, -0.2, 2.5];
        let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|a| (0.5 * a).sin_cos());
        let q = [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ];
        for (axis, angle) in angles.iter().enumerate() {
            // minus the quaternion is the same rotation
            for sign in [1.0, -1.0] {
                assert!((euler(axis, q.map(|c| sign * c)) - angle).abs() < 1e-14);
            }
        }
        assert!(euler(0, [0.0; 4]).is_nan());
    }
}
