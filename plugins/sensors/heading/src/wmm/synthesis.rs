//! The World Magnetic Model 2025: spherical-harmonic synthesis of the main field of the Earth
//! (Chulliat et al. 2025, *The US/UK World Magnetic Model for 2025-2030: Technical Report*).
//!
//! ```text
//! V = a sum_n (a/r)^(n+1) sum_m (g_nm cos m l + h_nm sin m l) P_nm(sin f),      B = -grad V
//! ```
//!
//! The sum is taken in Earth-fixed Cartesian axes, where it has no singularity at the poles
//! (Cunningham 1970; Montenbruck & Gill, *Satellite Orbits*, section 3.2.4, eqs 3.29 to 3.33). The two
//! harmonics of a degree and order are one complex number, `U = (a/r)^(n+1) P_nm e^(i m l)`.

use super::coefficients::{DEGREE, GAUSS};
use navfuse_core::nalgebra::{Complex, Vector3};
use navfuse_core::state::geodesy::Geodetic;

/// Reference radius of the model, m.
const RADIUS: f64 = 6_371_200.0;
/// Epoch of the coefficients, and the end of their validity, as years.
pub(super) const VALID: [f64; 2] = [2025.0, 2030.0];

/// `U` of all degrees and orders up to one above the model's, by degree and order.
type Harmonics = [[Complex<f64>; DEGREE + 2]; DEGREE + 2];

/// Magnetic field of the Earth, T, north, east and down, at a position and a time in years.
pub(super) fn field(at: &Geodetic, year: f64) -> Vector3<f64> {
    let u = harmonics(&(at.earth_fixed() / RADIUS));
    let fixed = GAUSS.iter().fold(Vector3::zeros(), |sum, &(n, m, main, change)| {
        let gauss = |k: usize| main[k] + change[k] * (year - VALID[0]);
        sum + gradient(&u, n, m, Complex::new(gauss(0), -gauss(1)) * schmidt(n, m))
    });
    let ((sin, cos), (east, north)) = (at.latitude.sin_cos(), at.longitude.sin_cos());
    let outward = fixed.x * north + fixed.y * east;
    let ned = Vector3::new(
        fixed.z * cos - outward * sin,
        fixed.y * north - fixed.x * east,
        -outward * cos - fixed.z * sin,
    );
    -1e-9 * ned
}

/// The harmonics at a point in units of the reference radius, by recursion from degree zero (eqs
/// 3.29 and 3.30).
fn harmonics(point: &Vector3<f64>) -> Harmonics {
    let square = point.norm_squared();
    let (equatorial, z) = (Complex::new(point.x, point.y) / square, point.z / square);
    let mut u = [[Complex::new(0.0, 0.0); DEGREE + 2]; DEGREE + 2];
    u[0][0].re = 1.0 / square.sqrt();
    for m in 0..DEGREE + 2 {
        if m > 0 {
            u[m][m] = u[m - 1][m - 1] * equatorial * (2 * m - 1) as f64;
        }
        for n in m + 1..DEGREE + 2 {
            let before = if n > m + 1 { u[n - 2][m] } else { Complex::new(0.0, 0.0) };
            let sum = u[n - 1][m] * (z * (2 * n - 1) as f64);
            u[n][m] = (sum - before * ((n + m - 1) as f64 / square)) / (n - m) as f64;
        }
    }
    u
}

/// Gradient of `Re(c U)` of one degree and order, in Earth-fixed axes (eq. 3.33).
fn gradient(u: &Harmonics, n: usize, m: usize, c: Complex<f64>) -> Vector3<f64> {
    let above = c * u[n + 1][m + 1];
    let across = match m {
        0 => -above,
        _ => (((c * u[n + 1][m - 1]).conj() * ((n - m + 2) * (n - m + 1)) as f64) - above) * 0.5,
    };
    Vector3::new(across.re, across.im, -((n - m + 1) as f64) * (c * u[n + 1][m]).re)
}

/// Ratio of Schmidt's semi-normalised Legendre functions to those without normalisation,
/// `sqrt((2 - d_m0) (n - m)! / (n + m)!)`.
fn schmidt(n: usize, m: usize) -> f64 {
    let orders: f64 = (n - m + 1..=n + m).map(|k| k as f64).product();
    if m == 0 { 1.0 } else { (2.0 / orders).sqrt() }
}
