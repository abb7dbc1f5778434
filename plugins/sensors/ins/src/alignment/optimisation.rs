//! Attitude from vectors known in two frames.

use super::config::CoarseMethod;
use crate::earth::LocalEarth;
use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};
use navfuse_core::checkpoint::saved;

/// Sine of the angle below which two vectors count as one direction.
const COLLINEAR: f64 = 1e-6;

/// Computes `C_b^n` of a vehicle at rest from the means of its specific force (m/s^2) and angular
/// rate (rad/s), biases removed: gravity determines down, the Earth rate north (Groves, 2nd ed.,
/// section 5.6.2). The method is TRIAD (Black, AIAA J. 2(7), 1964) with gravity as the vector that
/// is fitted exactly, because it is known better. `None` if the two vectors are parallel, as at a
/// pole, or if one of them is zero.
///
/// Errors: tilt `db_a / g`, heading `db_E / (W cos L)`.
pub fn analytic(
    force: &Vector3<f64>,
    rate: &Vector3<f64>,
    earth: &LocalEarth,
) -> Option<UnitQuaternion<f64>> {
    two_vectors((&Vector3::z(), &-force), (&earth.earth_rate(), rate))
}

/// The rotation `C` with `a = C b` for the first pair `(a, b)`, and for the second in the plane of both.
fn two_vectors(
    first: (&Vector3<f64>, &Vector3<f64>),
    second: (&Vector3<f64>, &Vector3<f64>),
) -> Option<UnitQuaternion<f64>> {
    let (a, b) = (triad(first.0, second.0)?, triad(first.1, second.1)?);
    let matrix = Rotation3::from_matrix_unchecked(a * b.transpose());
    Some(UnitQuaternion::from_rotation_matrix(&matrix))
}

/// The rotation `C` that fits pairs `(a, b)` in order of time, `a = C b`, by a method: by all of them
/// ([`Pairs`]), or by two.
///
/// Silson (*Coarse alignment of a ship's strapdown inertial attitude reference system using velocity
/// loci*, IEEE Trans. Instrum. Meas. 60(6), 2011) takes the vectors at two times, which the rotation of
/// the Earth has turned against one another: those of the end and half way there.
pub fn fit(
    pairs: &[(Vector3<f64>, Vector3<f64>)],
    method: CoarseMethod,
) -> Option<UnitQuaternion<f64>> {
    if method == CoarseMethod::VelocityLoci {
        let (end, half) = (pairs.last()?, pairs.get(pairs.len() / 2)?);
        return two_vectors((&end.0, &end.1), (&half.0, &half.1));
    }
    let mut sum = Pairs::default();
    pairs.iter().for_each(|(a, b)| sum.add(a, b));
    sum.solve().map(|fit| fit.rotation)
}

/// Builds an orthonormal triad: along `first`, normal to both, and normal to these two.
fn triad(first: &Vector3<f64>, second: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let x = first.try_normalize(f64::MIN_POSITIVE)?;
    let y = x.cross(&second.try_normalize(f64::MIN_POSITIVE)?).try_normalize(COLLINEAR)?;
    Some(Matrix3::from_columns(&[x, y, x.cross(&y)]))
}

/// The rotation `C` that minimises `sum |C b - a|^2` over pairs of vectors, in which long vectors
/// have more weight: Wahba's problem in quaternions (Davenport's q method; Wu, Wang & Hu, IEEE
/// Trans. Aerosp. Electron. Syst. 49(2), 2013).
///
/// `C b = a` is `q b = a q` in quaternions, linear in `q`. With `[b]+` the matrix of multiplication
/// by `b` on the right and `[a]-` that of `a` on the left, `q` is the eigenvector of the least
/// eigenvalue of `K = sum ([b]+ - [a]-)' ([b]+ - [a]-)`, and the eigenvalue is the minimum of the
/// sum. `K` has a fixed size, so the pairs need not be stored.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pairs {
    k: Matrix4<f64>,
}

saved!(Pairs { k });

/// Solution of Wahba's problem.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// The rotation from the frame of `b` to that of `a`.
    pub rotation: UnitQuaternion<f64>,
    /// `sum |C b - a|^2` at the rotation.
    pub residual: f64,
}

impl Pairs {
    /// Adds a pair, where `a = C b`.
    pub fn add(&mut self, a: &Vector3<f64>, b: &Vector3<f64>) {
        let (sum, difference) = (-(a + b).cross_matrix(), b - a);
        let mut m = Matrix4::zeros();
        m.fixed_view_mut::<3, 3>(0, 0).copy_from(&sum);
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&difference);
        m.fixed_view_mut::<1, 3>(3, 0).copy_from(&-difference.transpose());
        self.k += m.transpose() * m;
    }

    /// Computes the rotation; `None` where the pairs have fewer than two directions.
    pub fn solve(&self) -> Option<Fit> {
        let eigen = SymmetricEigen::new(self.k);
        let mut order = [0, 1, 2, 3];
        order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
        let value = |i: usize| eigen.eigenvalues[order[i]];
        // with one direction only, a rotation about it changes nothing: the two least eigenvalues
        // agree
        if !value(3).is_finite() || value(1) - value(0) <= COLLINEAR * COLLINEAR * value(3) {
            return None;
        }
        let q = eigen.eigenvectors.column(order[0]);
        let rotation = UnitQuaternion::new_normalize(Quaternion::from_vector(q.into_owned()));
        Some(Fit { rotation, residual: value(0).max(0.0) })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::testing::Uniform;

    fn rotation(random: &mut Uniform) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(random.vector(3.0))
    }

    #[test]
    fn exact_pairs_give_the_rotation() {
        let mut random = Uniform::new(1);
        for _ in 0..500 {
            let c = rotation(&mut random);
            let mut pairs = Pairs::default();
            for _ in 0..3 {
                let b = random.vector(10.0);
                pairs.add(&(c * b), &b);
            }
            let fit = pairs.solve().unwrap();
            // the error of an eigenvector is about rounding divided by the gap of the eigenvalues
            assert!(fit.rotation.angle_to(&c) < 1e-6, "{}", fit.rotation.angle_to(&c));
            assert!(fit.residual < 1e-10);
        }
    }

    #[test]
    fn no_rotation_near_it_fits_noisy_pairs_better() {
        let mut random = Uniform::new(2);
        for _ in 0..100 {
            let c = rotation(&mut random);
            let vectors: Vec<_> =
                (0..5).map(|_| (random.vector(10.0), random.vector(1.0))).collect();
            let pairs_of = |(b, e): &(Vector3<f64>, Vector3<f64>)| (c * b + e, *b);
            let mut pairs = Pairs::default();
            vectors.iter().map(pairs_of).for_each(|(a, b)| pairs.add(&a, &b));
            let cost = |c: &UnitQuaternion<f64>| {
                vectors.iter().map(pairs_of).map(|(a, b)| (c * b - a).norm_squared()).sum::<f64>()
            };
            let fit = pairs.solve().unwrap();
            assert!((cost(&fit.rotation) - fit.residual).abs() < 1e-9 * fit.residual.max(1.0));
            for _ in 0..20 {
                let other = UnitQuaternion::from_scaled_axis(random.vector(0.1)) * fit.rotation;
                assert!(cost(&other) >= fit.residual - 1e-9);
            }
        }
    }

    #[test]
    fn one_direction_is_not_enough() {
        let mut pairs = Pairs::default();
        assert!(pairs.solve().is_none(), "no vector at all");
        for length in 1..5 {
            pairs.add(&(Vector3::z() * f64::from(length)), &(Vector3::x() * f64::from(length)));
        }
        assert!(pairs.solve().is_none());
        pairs.add(&Vector3::y(), &Vector3::y());
        assert!(pairs.solve().is_some());
    }

    #[test]
    fn gravity_and_earth_rate_tell_the_attitude() {
        let mut random = Uniform::new(3);
        for _ in 0..500 {
            let earth = LocalEarth::at(random.within(1.5), 0.0);
            let c = rotation(&mut random);
            let force = c.inverse() * Vector3::new(0.0, 0.0, -earth.gravity);
            let rate = c.inverse() * earth.earth_rate();
            let found = analytic(&force, &rate, &earth).unwrap();
            // rounding of the angle between both, which is 4 deg at least
            assert!(found.angle_to(&c) < 1e-12, "{}", found.angle_to(&c));
        }
        let pole = LocalEarth::at(std::f64::consts::FRAC_PI_2, 0.0);
        assert!(analytic(&-Vector3::z(), &-Vector3::z(), &pole).is_none());
    }

    /// Errors of the analytic alignment: `dpsi = -db_E / (W cos L)`, Groves section 5.6.3.
    #[test]
    fn an_east_gyro_bias_turns_the_heading_by_what_the_closed_form_says() {
        let earth = LocalEarth::at(0.5, 0.0);
        let bias = 1e-3 * earth.earth_rate().norm();
        let force = Vector3::new(0.0, 0.0, -earth.gravity);
        let found = analytic(&force, &(earth.earth_rate() + Vector3::y() * bias), &earth).unwrap();
        let expected = -bias / earth.earth_rate().x;
        // the closed form is of first order; the second order is the square of 1e-3
        assert!(
            (found.euler_angles().2 / expected - 1.0).abs() < 1e-5,
            "{}",
            found.euler_angles().2 / expected
        );
    }
}
