//! The directions of the error state that the measurements determined least, in terms of states.

use nalgebra::{DMatrix, SymmetricEigen};
use serde::Serialize;

/// Direction of the initial error, in units of the prior.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Direction {
    /// Remaining share of its prior variance; 1 if the measurements hold no information on it.
    pub left: f64,
    /// Components and their weights, the largest weight first. The squares of all weights sum to
    /// one.
    pub parts: Vec<(usize, f64)>,
}

/// Smallest weight that is named.
const NAMED: f64 = 0.3;

/// Returns the directions in which more than a half of the prior variance remains, the largest
/// first.
///
/// `left` is the symmetric matrix `M` of [`crate::initial_error`], with eigenvalues between 0 and
/// 1; `of` selects the components that take part. (Nearly) equal eigenvalues have any basis of
/// their space as eigenvectors. Varimax (Kaiser 1958) rotates this basis so that each direction
/// consists of as few components as possible.
pub fn undetermined(n: usize, left: &[f64], of: impl Fn(usize) -> bool) -> Vec<Direction> {
    let kept: Vec<usize> = (0..n).filter(|&i| of(i)).collect();
    if kept.is_empty() {
        return Vec::new();
    }
    let m = DMatrix::from_fn(kept.len(), kept.len(), |i, j| left[kept[i] * n + kept[j]]);
    let eigen = SymmetricEigen::new(m.clone());
    let weak: Vec<usize> = (0..kept.len()).filter(|&k| eigen.eigenvalues[k] > 0.5).collect();
    let mut basis =
        DMatrix::from_fn(kept.len(), weak.len(), |i, k| eigen.eigenvectors[(i, weak[k])]);
    varimax(&mut basis);
    let mut directions: Vec<Direction> = basis
        .column_iter()
        .map(|v| {
            let largest = v.iamax();
            let sign = v[largest].signum();
            let mut parts: Vec<(usize, f64)> =
                (0..kept.len()).map(|i| (kept[i], sign * v[i])).collect();
            parts.retain(|p| p.1.abs() >= NAMED);
            parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
            Direction { left: (v.transpose() * &m * v)[(0, 0)].clamp(0.0, 1.0), parts }
        })
        .collect();
    // a direction of many small weights has no named part
    let heaviest = |d: &Direction| d.parts.first().map(|p| p.0);
    directions.sort_by(|a, b| b.left.total_cmp(&a.left).then(heaviest(a).cmp(&heaviest(b))));
    directions
}

/// Rotates pairs of columns until the sum of the fourth powers of all elements is largest
/// (Kaiser 1958). For one pair, the angle `a` with `tan 4a = num / den` maximises the sum.
fn varimax(a: &mut DMatrix<f64>) {
    let (n, m) = a.shape();
    for _ in 0..100 {
        let mut turned = 0.0_f64;
        for (p, q) in (0..m).flat_map(|p| (p + 1..m).map(move |q| (p, q))) {
            let (mut num, mut den) = (0.0, 0.0);
            for i in 0..n {
                let (x, y) = (a[(i, p)], a[(i, q)]);
                let (u, v) = (x * x - y * y, 2.0 * x * y);
                num += 2.0 * u * v;
                den += u * u - v * v;
            }
            let angle = 0.25 * num.atan2(den);
            if angle.abs() < 1e-9 {
                continue;
            }
            turned = turned.max(angle.abs());
            let (sin, cos) = angle.sin_cos();
            for i in 0..n {
                let (x, y) = (a[(i, p)], a[(i, q)]);
                a[(i, p)] = cos * x + sin * y;
                a[(i, q)] = cos * y - sin * x;
            }
        }
        if turned < 1e-9 {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_eigenvalues_give_directions_of_single_components() {
        // 3 of 5 are undetermined, in a space in which any rotation of the basis is an eigenbasis
        let diagonal = [1.0, 0.1, 1.0, 0.01, 1.0];
        let left: Vec<f64> =
            (0..25).map(|k| if k / 5 == k % 5 { diagonal[k / 5] } else { 0.0 }).collect();
        let found = undetermined(5, &left, |_| true);
        let named: Vec<usize> = found.iter().map(|d| d.parts[0].0).collect();
        assert_eq!(named, [0, 2, 4]);
        assert!(found.iter().all(|d| d.parts.len() == 1 && (d.left - 1.0).abs() < 1e-12));
    }

    #[test]
    fn a_direction_of_many_small_weights_names_none() {
        // what is left is the mean of 16: each weighs a quarter
        let found = undetermined(16, &[1.0 / 16.0; 256], |_| true);
        assert_eq!(found.len(), 1);
        assert!(found[0].parts.is_empty() && (found[0].left - 1.0).abs() < 1e-9, "{found:?}");
        // two of them, equally unknown, are sorted
        let left: Vec<f64> =
            (0..1024).map(|k| if k / 32 / 16 == k % 32 / 16 { 1.0 / 16.0 } else { 0.0 }).collect();
        assert_eq!(undetermined(32, &left, |_| true).len(), 2);
    }

    #[test]
    fn a_measured_sum_leaves_the_difference_undetermined() {
        // z = x + y with a sigma of a tenth of theirs: P = I - H'H/(2.01)
        let by = 1.0 / 2.01;
        let found = undetermined(2, &[1.0 - by, -by, -by, 1.0 - by], |_| true);
        assert_eq!(found.len(), 1);
        assert!((found[0].parts[0].1 * found[0].parts[1].1 + 0.5).abs() < 1e-9, "{found:?}");
        assert!((found[0].left - 1.0).abs() < 1e-9);
    }

    #[test]
    fn rotated_bases_become_sparse() {
        let c = 0.6_f64;
        let s = 0.8;
        // columns are e0 and e2, turned in their plane
        let mut a = DMatrix::from_row_slice(3, 2, &[c, -s, 0.0, 0.0, s, c]);
        varimax(&mut a);
        assert!(a.iter().all(|x| x.abs() < 1e-6 || (x.abs() - 1.0).abs() < 1e-6), "{a}");
    }
}
