//! The backward recursion of Bryson and Frazier.
//!
//! `e` is the error `truth [-] estimate` that the covariance `P` describes. Every step of the
//! filter is a linear map of it. A transition gives `e = Phi e + w`, and a correction with the
//! innovation `y = H e + v`, any gain `K` and the reset `G` after the injection gives
//! ```text
//! e = G (e - K y) = G (I - K H) e - G K v
//! ```
//! The innovations after a time are linear in the error at this time. Their projection on it is
//! `P lambda`, with the adjoint `lambda` and its covariance `Lambda`, which begin with zero at the
//! end of the run (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, X.2):
//! ```text
//! lambda = Phi' lambda                              Lambda = Phi' Lambda Phi
//! lambda = A' lambda + H' S^-1 y                    Lambda = A' Lambda A + H' S^-1 H
//! A = G (I - K H)
//! x_s = x [+] P lambda                              P_s = P - P Lambda P
//! ```
//! Neither `Q` nor an inverse of a covariance appears, so a state that the run hardly observes does
//! no harm, and an inflation of `P` needs no record: it is process noise.
//!
//! With considered states the gain is not optimal, and the innovations are not white: `y`
//! correlates with the error after the correction by `C = G (P H' - K S)`. `lambda` stays a valid
//! estimator, but its covariance is then `Omega` instead of `Lambda`, and the estimate of a
//! considered state stays:
//! ```text
//! Omega = A' Omega A + H' S^-1 H + A' Lambda C S^-1 H + (A' Lambda C S^-1 H)'
//! P_s = P - D P Lambda P - P Lambda P D + D P Omega P D
//! ```
//! `D` is the identity without the considered states. For an optimal gain `C = 0` and
//! `Omega = Lambda`.

use super::stretch::{Products, Stretch};
use crate::state::Layout;
use crate::state::covariance::{BackwardCorrection, BackwardStep, Covariance, sandwich};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};

/// Smallest eigenvalue of a smoothed covariance relative to that of the filter; rounding makes
/// smaller ones.
const ROUNDING: f64 = 1e-15;

/// A correction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction<'a> {
    /// Number of components.
    pub(super) m: usize,
    /// Columns of `h`.
    pub(super) columns: &'a [usize],
    /// Jacobian over the columns, row-major.
    pub(super) h: &'a [f64],
    /// Innovation covariance, row-major.
    pub(super) s: &'a [f64],
    /// Gain, row-major.
    pub(super) gain: &'a [f64],
    /// `P H'` before the correction, row-major; empty where no state is considered.
    pub(super) cross: &'a [f64],
    /// Innovation.
    pub(super) innovation: &'a [f64],
    /// Injected error.
    pub(super) delta: &'a [f64],
}

/// The adjoint of the error, and the information of all later samples.
#[derive(Clone, Debug)]
pub(super) struct Adjoint {
    n: usize,
    /// Considered states; empty where there is none.
    considered: Vec<bool>,
    lambda: Vec<f64>,
    /// `Lambda`.
    information: Covariance,
    /// `Omega`; `None` where no state is considered.
    spread: Option<Covariance>,
    work: Vec<f64>,
    /// The filter's covariance, and its product `P Lambda P` or `P Omega P`.
    filtered: Covariance,
    known: Covariance,
    scales: Vec<f64>,
    /// Products of the maps up to a boundary, for a smoother with a fixed lag.
    products: Option<Products>,
}

impl Adjoint {
    /// The adjoint at the end of a run of that layout: nothing is known of later samples.
    pub(super) fn new(layout: &Layout, considered: &[bool]) -> Self {
        let n = layout.tangent;
        let any = considered.contains(&true);
        let zero = Covariance::zero(n);
        Self {
            n,
            considered: if any { considered.to_vec() } else { Vec::new() },
            lambda: vec![0.0; n],
            spread: any.then(|| zero.clone()),
            work: Vec::new(),
            filtered: zero.clone(),
            known: zero.clone(),
            scales: vec![0.0; n],
            information: zero,
            products: None,
        }
    }

    /// The adjoint at a boundary, to which it keeps the products of the maps.
    pub(super) fn at_boundary(layout: &Layout, considered: &[bool]) -> Self {
        let products = Products::identity(layout.tangent, considered.contains(&true));
        Self { products: Some(products), ..Self::new(layout, considered) }
    }

    /// Length of the numbers of [`Self::write`].
    pub(super) fn width(n: usize, considers: bool) -> usize {
        let triangle = n * (n + 1) / 2;
        n + triangle + n * n + if considers { triangle + n * n } else { 0 }
    }

    /// Adds the adjoint and its products to a row of numbers.
    pub(super) fn write(&self, out: &mut Vec<f64>) {
        out.extend_from_slice(&self.lambda);
        out.extend(self.information.lower());
        out.extend(self.spread.iter().flat_map(Covariance::lower));
        if let Some(products) = &self.products {
            out.extend_from_slice(&products.map);
            out.extend_from_slice(&products.mixed);
        }
    }

    /// Sets the adjoint to the numbers of [`Self::write`], and adds the samples of the stretch from
    /// the boundary on: see `stretch.rs`.
    pub(super) fn join(&mut self, numbers: &[f64], after: &Stretch) {
        let n = self.n;
        let triangle = n * (n + 1) / 2;
        let (lambda, rest) = numbers.split_at(n);
        self.lambda.copy_from_slice(lambda);
        let (own, mut rest) = rest.split_at(triangle);
        self.information.set_lower(own);
        if let Some(spread) = &mut self.spread {
            let (own, left) = rest.split_at(triangle);
            spread.set_lower(own);
            rest = left;
        }
        if after.empty {
            return;
        }
        let (map, mixed) = rest.split_at(n * n);
        for (value, row) in self.lambda.iter_mut().zip(map.chunks_exact(n)) {
            *value += row.iter().zip(&after.lambda).map(|(m, b)| m * b).sum::<f64>();
        }
        // M' C M, with M' in the rows of `map`
        self.work.resize(n * n, 0.0);
        product(map, &after.information, n, &mut self.work);
        add_transposed(&mut self.information, &self.work, map, n, false);
        if let Some(spread) = &mut self.spread {
            add_transposed(spread, &self.work, mixed, n, true);
            product(map, &after.spread, n, &mut self.work);
            add_transposed(spread, &self.work, map, n, false);
        }
    }

    /// Passes over a transition: `lambda = Phi' lambda`, `Lambda = Phi' Lambda Phi`.
    pub(super) fn pass(&mut self, step: &mut BackwardStep, phi: &[f64]) {
        step.carry(phi, &mut self.lambda, 1);
        step.pass(phi, &mut self.information);
        if let Some(spread) = &mut self.spread {
            step.pass(phi, spread);
        }
        if let Some(products) = &mut self.products {
            products.pass(step, phi);
        }
    }

    /// Passes over a correction and the reset after it. Returns the square of the smoothed
    /// innovation, `u' M^-1 u` with `u = S^-1 y - K' lambda` and `M = S^-1 + K' Lambda K`; `None`
    /// where states are considered, whose innovations are not white, and up to a boundary.
    pub(super) fn correct(&mut self, layout: &Layout, correction: &Correction<'_>) -> Option<f64> {
        let n = self.n;
        let &Correction { m, columns, h, s, gain, cross, innovation, delta } = correction;
        let w = columns.len();
        // the filter has used this S, so it is positive definite
        let s = Cholesky::new(DMatrix::from_row_slice(m, m, s))?;
        layout.reset_back(delta, &mut self.lambda, 1);
        layout.reset_information(delta, &mut self.information);
        if let Some(spread) = &mut self.spread {
            layout.reset_information(delta, spread);
        }
        if let Some(products) = &mut self.products {
            products.reset(layout, delta);
        }

        // lambda = (I - K H)' lambda + H' S^-1 y
        let mut seen = s.solve(&DVector::from_column_slice(innovation));
        for (lambda, gain) in self.lambda.iter().zip(gain.chunks_exact(m)) {
            seen.iter_mut().zip(gain).for_each(|(seen, k)| *seen -= k * lambda);
        }
        for (k, &c) in columns.iter().enumerate() {
            self.lambda[c] += (0..m).map(|a| h[a * w + k] * seen[a]).sum::<f64>();
        }
        // Lambda = (I - K H)' Lambda (I - K H) + H' S^-1 H
        let inverse = s.inverse();
        let back = BackwardCorrection { columns, h, gain };
        if self.spread.is_some() || self.products.is_some() {
            let solved = s.solve(&DMatrix::from_row_slice(m, w, h));
            // C = P H' - K S, which is not zero in the rows of the considered states, whose gain
            // is zero
            let remaining = self.spread.is_some().then(|| {
                let cross = DMatrix::from_row_slice(n, m, cross);
                DMatrix::from_fn(n, m, |i, a| if self.considered[i] { cross[(i, a)] } else { 0.0 })
            });
            if let Some((spread, remaining)) = self.spread.as_mut().zip(remaining.as_ref()) {
                // A' Lambda C S^-1 H
                let mut coupled = self.information.to_dense() * remaining;
                let gain = DMatrix::from_row_slice(n, m, gain);
                let seen = gain.tr_mul(&coupled);
                for (k, &c) in columns.iter().enumerate() {
                    for b in 0..m {
                        coupled[(c, b)] -= (0..m).map(|a| h[a * w + k] * seen[(a, b)]).sum::<f64>();
                    }
                }
                let coupled = coupled * &solved;
                back.pass(spread, inverse.clone().as_mut_slice(), &mut self.work);
                for (k, &c) in columns.iter().enumerate() {
                    spread.add_both(c, coupled.column(k).as_slice());
                }
            }
            if let Some(products) = &mut self.products {
                products.correct(correction, &solved, remaining.as_ref());
            }
        }
        let mut weight = inverse;
        back.pass(&mut self.information, weight.as_mut_slice(), &mut self.work);
        if self.spread.is_some() || self.products.is_some() {
            return None;
        }
        Some(seen.dot(&Cholesky::new(weight)?.solve(&seen)))
    }

    /// Returns the square of the residual of a sample that the filter did not use, `u' M^-1 u` with
    /// `u = y - H P lambda` and `M = S - H P Lambda P H' = R + H P_s H'`. `numbers` has `S`, `y`
    /// and `P H'`. `None` where states are considered.
    pub(super) fn reconsider(&self, m: usize, numbers: &[f64]) -> Option<f64> {
        if self.spread.is_some() || self.products.is_some() {
            return None;
        }
        let (s, rest) = numbers.split_at(m * m);
        let (y, cross) = rest.split_at(m);
        let cross = DMatrix::from_row_slice(self.n, m, cross);
        let lambda = DVector::from_column_slice(&self.lambda);
        let u = DVector::from_column_slice(y) - cross.tr_mul(&lambda);
        let known = cross.tr_mul(&(self.information.to_dense() * &cross));
        let covariance = DMatrix::from_row_slice(m, m, s) - known;
        Some(u.dot(&Cholesky::new(covariance)?.solve(&u)))
    }

    /// Computes the correction `delta = P lambda` of an estimate from the lower triangle of its
    /// covariance.
    pub(super) fn project(&self, triangle: &[f64], delta: &mut [f64]) {
        delta.fill(0.0);
        for ((i, j), p) in lower(self.n).zip(triangle) {
            delta[i] += p * self.lambda[j];
            if i != j {
                delta[j] += p * self.lambda[i];
            }
        }
        let kept = delta.iter_mut().zip(&self.considered).filter(|(_, kept)| **kept);
        kept.for_each(|(delta, _)| *delta = 0.0);
    }

    /// Covariance of the filter at the last estimate that [`Self::smooth`] has met.
    pub(super) fn filtered(&self) -> &Covariance {
        &self.filtered
    }

    /// Computes the correction `delta` of an estimate by all later samples, and the covariance of
    /// the error that is left. `smoothed` has the covariance of the filter first.
    pub(super) fn smooth(&mut self, smoothed: &mut Covariance, delta: &mut [f64]) {
        let Self { filtered, known, work, considered, .. } = self;
        filtered.clone_from(smoothed);
        let kept = |i: usize| considered.get(i).is_some_and(|c| *c);
        for (i, (delta, row)) in delta.iter_mut().zip(filtered.rows()).enumerate() {
            let moved = row.iter().zip(&self.lambda).map(|(p, l)| p * l).sum::<f64>();
            *delta = if kept(i) { 0.0 } else { moved };
        }
        sandwich(filtered, &self.information, work, known);
        match &self.spread {
            // P_s = P - P Lambda P
            None => smoothed.subtract(known),
            Some(spread) => {
                let d = |i: usize| f64::from(u8::from(!kept(i)));
                let mut product = Covariance::zero(self.n);
                sandwich(filtered, spread, work, &mut product);
                for (i, j) in lower(self.n) {
                    let (known, spread) = (known.get(i, j), product.get(i, j));
                    let value = filtered.get(i, j) - (d(i) + d(j)) * known + d(i) * d(j) * spread;
                    smoothed.set(i, j, value);
                }
            }
        }
        keep_positive(smoothed, &self.filtered, &mut self.scales);
    }
}

/// Rows and columns of the lower triangle.
fn lower(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)))
}

/// `out = A B`, row-major and square.
fn product(a: &[f64], b: &[f64], n: usize, out: &mut [f64]) {
    for (row, out) in a.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
        out.fill(0.0);
        for (f, b) in row.iter().zip(b.chunks_exact(n)) {
            out.iter_mut().zip(b).for_each(|(out, b)| *out += f * b);
        }
    }
}

/// `X = X + A B'` for a symmetric product, or `X = X + A B' + B A'` with `both`.
fn add_transposed(x: &mut Covariance, a: &[f64], b: &[f64], n: usize, both: bool) {
    let dot = |i: usize, j: usize| {
        a[i * n..][..n].iter().zip(&b[j * n..][..n]).map(|(a, b)| a * b).sum::<f64>()
    };
    for (i, j) in lower(n) {
        let sum = if both { dot(i, j) + dot(j, i) } else { dot(i, j) };
        x.set(i, j, x.get(i, j) + sum);
    }
}

/// Removes the negative eigenvalues that rounding leaves where the later samples determine a
/// direction by orders of magnitude better than the filter did. The scale is that of the filter's
/// covariance `p`.
fn keep_positive(smoothed: &mut Covariance, p: &Covariance, scales: &mut [f64]) {
    let n = smoothed.dimension();
    scales.iter_mut().enumerate().for_each(|(i, scale)| *scale = p.get(i, i).sqrt().recip());
    let scaled = || DMatrix::from_fn(n, n, |i, j| smoothed.get(i, j) * scales[i] * scales[j]);
    if Cholesky::<f64, Dyn>::new(scaled()).is_some() {
        return;
    }
    let scaled = scaled();
    if scaled.iter().any(|v| v.is_nan()) {
        return;
    }
    let SymmetricEigen { eigenvectors, eigenvalues } = scaled.symmetric_eigen();
    let kept = DMatrix::from_diagonal(&eigenvalues.map(|value| value.max(ROUNDING)));
    let positive = &eigenvectors * kept * eigenvectors.transpose();
    for (i, j) in lower(n) {
        smoothed.set(i, j, positive[(i, j)] / (scales[i] * scales[j]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn covariance(lower: [f64; 3]) -> Covariance {
        let mut covariance = Covariance::zero(2);
        covariance.set_lower(&lower);
        covariance
    }

    /// The sigmas of the filter are 10 and 0.1. What rounding leaves of the sum of both is -1e-12 of
    /// its variance.
    #[test]
    fn a_variance_that_rounding_made_negative_is_one_of_rounding_and_the_others_stay() {
        let (filtered, mut scales) = (covariance([100.0, 0.0, 0.01]), [0.0; 2]);
        let correlation = -(1.0 + 1e-12);
        let mut smoothed = covariance([1e-2, 1e-4 * correlation, 1e-6]);
        let before = smoothed.clone();
        keep_positive(&mut smoothed, &filtered, &mut scales);
        let [p, q, r] = [(0, 0), (1, 0), (1, 1)].map(|(i, j)| smoothed.get(i, j));
        assert!(p * r > q * q, "{p} {q} {r}");
        let apart = |i: usize, j: usize| (smoothed.get(i, j) / before.get(i, j) - 1.0).abs();
        assert!(apart(0, 0) < 1e-11 && apart(1, 0) < 1e-11 && apart(1, 1) < 1e-11);
        let positive = smoothed.clone();
        keep_positive(&mut smoothed, &filtered, &mut scales);
        assert_eq!(smoothed, positive);
    }
}
