//! Least squares for `k` and `C_b^d`.

use nalgebra::{Matrix3, Matrix3x4, Matrix4, Rotation3, Vector3, Vector4};
use navfuse_segments::Mounting;

/// Returns the mounting moved by `dk` and a rotation vector in instrument axes: `C_b^d <- exp(δ x)
/// C_b^d`.
pub fn moved(m: &Mounting, dk: f64, delta: &Vector3<f64>) -> Mounting {
    let mut c_b_d = Rotation3::from_scaled_axis(*delta) * m.c_b_d;
    c_b_d.renormalize();
    Mounting { k: m.k + dk, c_b_d }
}

/// Returns the derivative of `v^b = C_d^b y / k` by `k` and `δ`: `-v^b / k` and `C_d^b [y x] / k`.
pub fn sensitivity(m: &Mounting, y: &Vector3<f64>) -> Matrix3x4<f64> {
    let v = m.body(y);
    let turn = m.c_b_d.inverse().matrix() * y.cross_matrix() / m.k;
    let mut h = Matrix3x4::zeros();
    h.set_column(0, &(-v / m.k));
    h.fixed_view_mut::<3, 3>(0, 1).copy_from(&turn);
    h
}

/// Prior 1-sigma about the initial mounting, of `k` and of each angle in rad: wide enough to matter
/// only where the samples hold no information.
const WIDE: (f64, f64) = (0.5, 20.0 * std::f64::consts::PI / 180.0);
/// Largest 1-sigma of a determined `k`, and of a determined angle in rad.
const DETERMINED: (f64, f64) = (0.1, 1.0 * std::f64::consts::PI / 180.0);

/// Returns the wide prior's information, and its right-hand side at an estimate.
pub fn prior(initial: &Mounting, at: &Mounting) -> (Matrix4<f64>, Vector4<f64>) {
    let a = WIDE.1.powi(-2);
    let weight = Vector4::new(WIDE.0.powi(-2), a, a, a);
    let back = (initial.c_b_d * at.c_b_d.inverse()).scaled_axis();
    let off = Vector4::new(initial.k - at.k, back.x, back.y, back.z);
    (Matrix4::from_diagonal(&weight), weight.component_mul(&off))
}

/// Selects the determined components among `k`, roll, pitch and yaw, for a covariance of the
/// parameters of [`moved`].
pub fn determined(covariance: &Matrix4<f64>) -> [bool; 4] {
    std::array::from_fn(|i| {
        let limit = if i == 0 { DETERMINED.0 } else { DETERMINED.1 };
        covariance[(i, i)].max(0.0).sqrt() < limit
    })
}

/// Returns the rotation `C` that minimises `Σ w |b - C a|^2`, from `B = Σ w b a'` (Wahba's
/// problem). With the singular value decomposition `B = U S V'` the solution is `C = U diag(1, 1,
/// det U det V) V'`; the last entry keeps it a proper rotation. `None` if the pairs have fewer than
/// two directions: the second singular value is below `1e-9` of the first.
pub fn wahba(b: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let svd = b.svd(true, true);
    let (u, vt) = svd.u.zip(svd.v_t)?;
    if svd.singular_values[1] <= 1e-9 * svd.singular_values[0] {
        return None;
    }
    let sign = (u.determinant() * vt.determinant()).signum();
    Some(Rotation3::from_matrix_unchecked(
        u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * vt,
    ))
}

/// Returns the covariance that the residuals of a fit imply. Each row has the derivative by `k` and
/// `δ`, and the residual. The variance of the residuals is enlarged by `(1 + r) / (1 - r)` for a
/// correlation `r` between consecutive rows, as for a first-order Gauss-Markov sequence, in which
/// correlated rows hold less information.
pub fn covariance_of_residuals(
    rows: &[(Matrix3x4<f64>, Vector3<f64>)],
    initial: &Mounting,
    at: &Mounting,
) -> Matrix4<f64> {
    let square: f64 = rows.iter().map(|r| r.1.norm_squared()).sum();
    let next: f64 = rows.windows(2).map(|w| w[0].1.dot(&w[1].1)).sum();
    let r = if square > 0.0 { (next / square).clamp(0.0, 0.999) } else { 0.0 };
    let variance = square / (3.0 * rows.len() as f64 - 4.0).max(1.0) * (1.0 + r) / (1.0 - r);
    let variance = variance.max(1e-24);
    let information: Matrix4<f64> = rows.iter().map(|(h, _)| h.transpose() * h / variance).sum();
    (information + prior(initial, at).0).try_inverse().unwrap_or_else(Matrix4::zeros)
}

/// Row of a fit of integrals: the derivative by `k` and `δ`, and the residual, both less the mean
/// of their block.
pub struct Residual {
    /// Time, s.
    pub time: f64,
    pub h: Matrix3x4<f64>,
    pub z: Vector3<f64>,
    /// Rotation vector of the body while this sample is the nearest; later integrals keep this part
    /// of its noise.
    pub turn: Vector3<f64>,
}

/// Returns the covariance of an equally weighted fit to integrals over time.
///
/// The errors of the integrals are white noise plus a random walk, so the information of the fit,
/// which assumes white noise of one variance, would be far too large. The variances `s` and `q` of
/// each axis follow from the residuals by their variogram `<|z(t + L) - z(t)|^2> = 2 s + q L` at
/// two lags. `q` is at least the stated value, m^2/s: the fit absorbs a part of the walk, so the
/// residuals of one run underestimate it. The estimate is linear in the errors, so its covariance
/// follows from the normal equations:
///
/// ```text
/// δ = A^-1 Σ h' z     A = Σ h' h     cov(Σ h' z) = Σ_j g_j' s g_j + c_j' q c_j dt_j
/// c_j = Σ_(t > j) h   g_j = h_j + [turn_j x]' c_j
/// ```
pub fn covariance_of_integrals(
    blocks: &[Vec<Residual>],
    stated: Vector3<f64>,
    initial: &Mounting,
    at: &Mounting,
) -> Matrix4<f64> {
    let rows = || blocks.iter().flatten();
    let count = rows().count().max(1) as f64;
    let variance = (rows().map(|r| r.z.norm_squared()).sum::<f64>() / (3.0 * count)).max(1e-24);
    let prior = prior(initial, at).0;
    let normal = rows().map(|r| r.h.transpose() * r.h).sum::<Matrix4<f64>>() / variance + prior;
    let Some(inverse) = normal.try_inverse() else { return Matrix4::zeros() };
    let noise: [(f64, f64); 3] = std::array::from_fn(|axis| white_and_walk(blocks, axis));
    let white = Matrix3::from_diagonal(&Vector3::from_fn(|i, _| noise[i].0));
    let walk = Matrix3::from_diagonal(&Vector3::from_fn(|i, _| noise[i].1.max(stated[i])));
    let mut score = Matrix4::zeros();
    for block in blocks {
        let (mut after, mut next) = (Matrix3x4::zeros(), None);
        for row in block.iter().rev() {
            let dt = next.map_or(0.0, |t: f64| t - row.time);
            let g = row.h + row.turn.cross_matrix().transpose() * after;
            score += g.transpose() * white * g + after.transpose() * walk * after * dt;
            after += row.h;
            next = Some(row.time);
        }
    }
    inverse * (score / variance.powi(2) + prior) * inverse
}

/// Returns the variance of the white noise, m^2, and of the random walk, m^2/s, in the residuals of
/// one axis. It uses their variogram at one step and at a tenth of the covered time, or half of the
/// longest block: long enough for the walk to dominate, short enough for several independent
/// differences.
fn white_and_walk(blocks: &[Vec<Residual>], axis: usize) -> (f64, f64) {
    let spans = || blocks.iter().filter_map(|b| Some(b.last()?.time - b.first()?.time));
    let (covered, longest) = (spans().sum::<f64>(), spans().fold(0.0, f64::max));
    let at = |lag: f64| {
        let (mut sum, mut length, mut count) = (0.0, 0.0, 0.0);
        for block in blocks {
            let mut k = 0;
            for first in block {
                while k < block.len() && block[k].time < first.time + lag {
                    k += 1;
                }
                let Some(second) = block.get(k) else { break };
                sum += (second.z[axis] - first.z[axis]).powi(2);
                length += second.time - first.time;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| (sum / count, length / count))
    };
    let Some((near, step)) = at(1e-9) else { return (0.0, 0.0) };
    let (far, lag) = at((0.1 * covered).min(0.5 * longest).max(2.0 * step)).unwrap_or((near, step));
    let walk = if lag > step { ((far - near) / (lag - step)).max(0.0) } else { 0.0 };
    ((0.5 * (near - walk * step)).max(0.0), walk)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns blocks of one-second steps with white noise of 1 m^2 and a random walk of 0.1 m^2/s
    /// on all axes. Uniform numbers in -1..1 have a variance of 1/3.
    fn noisy(blocks: usize, length: usize) -> Vec<Vec<Residual>> {
        let mut seed = 1_u64;
        let mut number = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0) * 3_f64.sqrt()
        };
        let block = |_| {
            let mut walk = Vector3::zeros();
            let row = |k: usize| {
                walk += Vector3::from_fn(|_, _| number() * 0.1_f64.sqrt());
                let z = walk + Vector3::from_fn(|_, _| number());
                Residual { time: k as f64, h: Matrix3x4::zeros(), z, turn: Vector3::zeros() }
            };
            (0..length).map(row).collect()
        };
        (0..blocks).map(block).collect()
    }

    /// The random walk is found to a factor of two, the white noise to a quarter: 1000 s are ten
    /// times the lag of 100 s, and twenty blocks of 50 s are forty times half of their length.
    #[test]
    fn white_noise_and_random_walk_are_separated_in_one_block_and_in_many_short_ones() {
        for (blocks, length) in [(1, 1000), (20, 50)] {
            let residuals = noisy(blocks, length);
            for axis in 0..3 {
                let (white, walk) = white_and_walk(&residuals, axis);
                assert!(
                    (0.75..1.25).contains(&white) && (0.05..0.2).contains(&walk),
                    "{blocks}: {white} {walk}"
                );
            }
        }
    }
}
