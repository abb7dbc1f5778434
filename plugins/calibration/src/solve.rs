//! Least squares for `k` and `C_b^d`.

use nalgebra::{Matrix3, Matrix3x4, Matrix4, Rotation3, Vector3, Vector4};
use navfuse_segments::Mounting;

/// The mounting moved by `dk` and by a rotation vector in instrument axes: `C_b^d <- exp(δ x) C_b^d`.
pub fn moved(m: &Mounting, dk: f64, delta: &Vector3<f64>) -> Mounting {
    let mut c_b_d = Rotation3::from_scaled_axis(*delta) * m.c_b_d;
    c_b_d.renormalize();
    Mounting { k: m.k + dk, c_b_d }
}

/// The derivative of `v^b = C_d^b y / k` by `k` and `δ`: `-v^b / k` and `C_d^b [y x] / k`.
pub fn sensitivity(m: &Mounting, y: &Vector3<f64>) -> Matrix3x4<f64> {
    let v = m.body(y);
    let turn = m.c_b_d.inverse().matrix() * y.cross_matrix() / m.k;
    let mut h = Matrix3x4::zeros();
    h.set_column(0, &(-v / m.k));
    h.fixed_view_mut::<3, 3>(0, 1).copy_from(&turn);
    h
}

/// Sigma of what is known before any sample, about the initial mounting: so wide that it matters only to what the samples
/// do not tell. `k`, and each angle in rad.
const WIDE: (f64, f64) = (0.5, 20.0 * std::f64::consts::PI / 180.0);
/// With a sigma below these `k` and an angle count as determined.
const DETERMINED: (f64, f64) = (0.1, 1.0 * std::f64::consts::PI / 180.0);

/// The wide prior's information and what it asks for, at an estimate.
pub fn prior(initial: &Mounting, at: &Mounting) -> (Matrix4<f64>, Vector4<f64>) {
    let a = WIDE.1.powi(-2);
    let weight = Vector4::new(WIDE.0.powi(-2), a, a, a);
    let back = (initial.c_b_d * at.c_b_d.inverse()).scaled_axis();
    let off = Vector4::new(initial.k - at.k, back.x, back.y, back.z);
    (Matrix4::from_diagonal(&weight), weight.component_mul(&off))
}

/// Which of `k`, roll, pitch and yaw a covariance of [`moved`]'s parameters determines.
pub fn determined(covariance: &Matrix4<f64>) -> [bool; 4] {
    std::array::from_fn(|i| {
        let limit = if i == 0 { DETERMINED.0 } else { DETERMINED.1 };
        covariance[(i, i)].max(0.0).sqrt() < limit
    })
}

/// The rotation `C` that makes `Σ w |b - C a|^2` least, from `B = Σ w b a'` (Wahba's problem, by singular values).
/// `None` where the pairs have fewer than two directions: the second singular value is below `1e-9` of the first.
pub fn wahba(b: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let svd = b.svd(true, true);
    let (u, vt) = svd.u.zip(svd.v_t)?;
    if svd.singular_values[1] <= 1e-9 * svd.singular_values[0] {
        return None;
    }
    let sign = (u.determinant() * vt.determinant()).signum();
    Some(Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * vt))
}

/// The covariance that the residuals of a fit show: each row has the derivative by `k` and `δ`, and the residual. Their variance is
/// that of white noise, made larger by `(1 + r) / (1 - r)` for a correlation `r` from one row to the next, with which so
/// many of them are worth one.
pub fn shown(rows: &[(Matrix3x4<f64>, Vector3<f64>)], initial: &Mounting, at: &Mounting) -> Matrix4<f64> {
    let square: f64 = rows.iter().map(|r| r.1.norm_squared()).sum();
    let next: f64 = rows.windows(2).map(|w| w[0].1.dot(&w[1].1)).sum();
    let r = if square > 0.0 { (next / square).clamp(0.0, 0.999) } else { 0.0 };
    let variance = square / (3.0 * rows.len() as f64 - 4.0).max(1.0) * (1.0 + r) / (1.0 - r);
    let variance = variance.max(1e-24);
    let information: Matrix4<f64> = rows.iter().map(|(h, _)| h.transpose() * h / variance).sum();
    (information + prior(initial, at).0).try_inverse().unwrap_or_else(Matrix4::zeros)
}
