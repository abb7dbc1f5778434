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

use super::map::{Map, add};
use super::stretch::{Products, Stretch};
use crate::state::Layout;
use crate::state::covariance::Covariance;
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
    /// `Lambda`, row-major.
    information: Vec<f64>,
    /// `Omega`; empty where no state is considered.
    spread: Vec<f64>,
    work: Vec<f64>,
    column: Vec<f64>,
    /// One row of `X K`, and the rows of `K' X`.
    seen: Vec<f64>,
    rows: Vec<f64>,
    reset: Map,
    jacobian: Vec<f64>,
    /// `Lambda (I - K H)`.
    carried: Vec<f64>,
    /// Products of the maps up to a boundary, for a smoother with a fixed lag.
    products: Option<Products>,
}

impl Adjoint {
    /// The adjoint at the end of a run of that layout: nothing is known of later samples.
    pub(super) fn new(layout: &Layout, considered: &[bool]) -> Self {
        let n = layout.tangent;
        let any = considered.contains(&true);
        Self {
            n,
            considered: if any { considered.to_vec() } else { Vec::new() },
            lambda: vec![0.0; n],
            information: vec![0.0; n * n],
            spread: if any { vec![0.0; n * n] } else { Vec::new() },
            work: vec![0.0; n * n],
            column: vec![0.0; n],
            seen: Vec::new(),
            rows: Vec::new(),
            reset: Map::identity(n),
            jacobian: vec![0.0; n * n],
            carried: vec![0.0; n * n],
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
        let Self { n, lambda, information, spread, products, .. } = self;
        out.extend_from_slice(lambda);
        for square in [information, spread].into_iter().filter(|s| !s.is_empty()) {
            out.extend(lower(*n).map(|(i, j)| square[i * n + j]));
        }
        if let Some(products) = products {
            out.extend_from_slice(&products.map);
            out.extend_from_slice(&products.mixed);
        }
    }

    /// Sets the adjoint to the numbers of [`Self::write`], and adds the samples of the stretch from
    /// the boundary on: see `stretch.rs`.
    pub(super) fn join(&mut self, numbers: &[f64], after: &Stretch) {
        let n = self.n;
        let triangle = n * (n + 1) / 2;
        let (lambda, mut rest) = numbers.split_at(n);
        self.lambda.copy_from_slice(lambda);
        for square in [&mut self.information, &mut self.spread] {
            if square.is_empty() {
                continue;
            }
            let (own, left) = rest.split_at(triangle);
            rest = left;
            for ((i, j), value) in lower(n).zip(own) {
                square[i * n + j] = *value;
                square[j * n + i] = *value;
            }
        }
        if after.empty {
            return;
        }
        let (map, mixed) = rest.split_at(n * n);
        for (value, row) in self.lambda.iter_mut().zip(map.chunks_exact(n)) {
            *value += row.iter().zip(&after.lambda).map(|(m, b)| m * b).sum::<f64>();
        }
        // M' C M, with M' in the rows of `map`
        product(map, &after.information, n, &mut self.work);
        add_transposed(&mut self.information, &self.work, map, n, false);
        if !self.spread.is_empty() {
            add_transposed(&mut self.spread, &self.work, mixed, n, true);
            product(map, &after.spread, n, &mut self.work);
            add_transposed(&mut self.spread, &self.work, map, n, false);
        }
    }

    /// Passes over a linear map of the error: `lambda = M' lambda`, `Lambda = M' Lambda M`.
    pub(super) fn pass(&mut self, map: &mut Map) {
        map.carry(&mut self.lambda, 1);
        map.congruence(&mut self.information, &mut self.work);
        if !self.spread.is_empty() {
            map.congruence(&mut self.spread, &mut self.work);
        }
        if let Some(products) = &mut self.products {
            products.pass(map);
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
        // G, with the reset of the joint covariance on the identity
        self.jacobian.fill(0.0);
        (0..n).for_each(|i| self.jacobian[i * n + i] = 1.0);
        layout.reset_rows(delta, &mut self.jacobian, n);
        let mut reset = std::mem::take(&mut self.reset);
        let differs = |i: usize, row: &[f64]| {
            row.iter().enumerate().any(|(j, v)| *v != f64::from(u8::from(i == j)))
        };
        let rows = self.jacobian.chunks_exact(n).enumerate().filter(|(i, row)| differs(*i, row));
        reset.set(rows.flat_map(|(i, row)| row.iter().enumerate().map(move |(j, v)| (i, j, *v))));
        self.pass(&mut reset);
        self.reset = reset;

        // lambda = (I - K H)' lambda + H' S^-1 y
        let mut seen = s.solve(&DVector::from_column_slice(innovation));
        for (i, gain) in gain.chunks_exact(m).enumerate() {
            gain.iter().enumerate().for_each(|(a, k)| seen[a] -= k * self.lambda[i]);
        }
        let judged = self.spread.is_empty() && self.products.is_none();
        let square = judged.then(|| self.square(&s, gain, &seen)).flatten();
        for (k, &c) in columns.iter().enumerate() {
            self.lambda[c] += (0..m).map(|a| h[a * w + k] * seen[a]).sum::<f64>();
        }
        // H' S^-1 H over the columns
        let h = DMatrix::from_row_slice(m, w, h);
        let solved = s.solve(&h);
        let gained = h.tr_mul(&solved);
        let gain = DMatrix::from_row_slice(n, m, gain);
        self.congruence(&h, &gain, columns, false);
        // C = P H' - K S, which is not zero in the rows of the considered states, whose gain is
        // zero
        let remaining = (!self.spread.is_empty()).then(|| {
            let cross = DMatrix::from_row_slice(n, m, cross);
            DMatrix::from_fn(n, m, |i, a| if self.considered[i] { cross[(i, a)] } else { 0.0 })
        });
        if let Some(remaining) = &remaining {
            // A' Lambda C S^-1 H
            let carried = DMatrix::from_row_slice(n, n, &self.carried);
            let coupled = carried.tr_mul(&(remaining * &solved));
            self.congruence(&h, &gain, columns, true);
            for i in 0..n {
                for (k, &c) in columns.iter().enumerate() {
                    self.spread[i * n + c] += coupled[(i, k)];
                    self.spread[c * n + i] += coupled[(i, k)];
                }
            }
        }
        if let Some(products) = &mut self.products {
            products.correct(correction, &solved, remaining.as_ref());
        }
        let Self { information, spread, .. } = self;
        for sums in [information, spread].into_iter().filter(|s| !s.is_empty()) {
            for (j, &d) in columns.iter().enumerate() {
                for (k, &c) in columns.iter().enumerate() {
                    sums[d * n + c] += gained[(j, k)];
                }
            }
            symmetrise(sums, n);
        }
        square
    }

    /// `u' M^-1 u` of the smoothed innovation `u`, with `Lambda` after the reset.
    fn square(&mut self, s: &Cholesky<f64, Dyn>, gain: &[f64], seen: &DVector<f64>) -> Option<f64> {
        let (n, m) = (self.n, seen.len());
        let mut covariance = s.inverse();
        for a in 0..m {
            self.column.fill(0.0);
            for (row, gain) in self.information.chunks_exact(n).zip(gain.chunks_exact(m)) {
                add(&mut self.column, gain[a], row);
            }
            for b in 0..m {
                let rows = self.column.iter().zip(gain.chunks_exact(m));
                covariance[(a, b)] += rows.map(|(x, gain)| x * gain[b]).sum::<f64>();
            }
        }
        Some(seen.dot(&Cholesky::new(covariance)?.solve(seen)))
    }

    /// Returns the square of the residual of a sample that the filter did not use, `u' M^-1 u` with
    /// `u = y - H P lambda` and `M = S - H P Lambda P H' = R + H P_s H'`. `numbers` has `S`, `y`
    /// and `P H'`. `None` where states are considered.
    pub(super) fn reconsider(&self, m: usize, numbers: &[f64]) -> Option<f64> {
        if !self.spread.is_empty() || self.products.is_some() {
            return None;
        }
        let (s, rest) = numbers.split_at(m * m);
        let (y, cross) = rest.split_at(m);
        let cross = DMatrix::from_row_slice(self.n, m, cross);
        let information = DMatrix::from_row_slice(self.n, self.n, &self.information);
        let lambda = DVector::from_column_slice(&self.lambda);
        let u = DVector::from_column_slice(y) - cross.tr_mul(&lambda);
        let covariance = DMatrix::from_row_slice(m, m, s) - cross.tr_mul(&(information * &cross));
        Some(u.dot(&Cholesky::new(covariance)?.solve(&u)))
    }

    /// `X = (I - K H)' X (I - K H)` for `Lambda`, of which it keeps `Lambda (I - K H)`, or `Omega`.
    fn congruence(&mut self, h: &DMatrix<f64>, gain: &DMatrix<f64>, columns: &[usize], of: bool) {
        let (n, m) = (self.n, h.nrows());
        self.seen.resize(m, 0.0);
        self.rows.resize(m * n, 0.0);
        let square = if of { &mut self.spread } else { &mut self.information };
        // X - (X K) H
        for i in 0..n {
            let row = &mut square[i * n..][..n];
            for (a, seen) in self.seen.iter_mut().enumerate() {
                *seen = row.iter().zip(gain.column(a)).map(|(x, k)| x * k).sum();
            }
            for (k, &c) in columns.iter().enumerate() {
                row[c] -= (0..m).map(|a| self.seen[a] * h[(a, k)]).sum::<f64>();
            }
        }
        if !of {
            self.carried.copy_from_slice(square);
        }
        // less H' K' times it
        for (a, out) in self.rows.chunks_exact_mut(n).enumerate() {
            out.fill(0.0);
            for (row, k) in square.chunks_exact(n).zip(gain.column(a)) {
                add(out, *k, row);
            }
        }
        for (k, &c) in columns.iter().enumerate() {
            for a in 0..m {
                add(&mut square[c * n..][..n], -h[(a, k)], &self.rows[a * n..][..n]);
            }
        }
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

    /// Computes the correction `delta` of an estimate by all later samples, and the covariance of
    /// the error that is left. `smoothed` has the covariance of the filter first.
    pub(super) fn smooth(&mut self, smoothed: &mut Covariance, delta: &mut [f64]) {
        let n = self.n;
        let p: Vec<f64> = (0..n * n).map(|k| smoothed.get(k / n, k % n)).collect();
        let kept = |i: usize| self.considered.get(i).is_some_and(|c| *c);
        for (i, (delta, row)) in delta.iter_mut().zip(p.chunks_exact(n)).enumerate() {
            let moved = row.iter().zip(&self.lambda).map(|(p, l)| p * l).sum::<f64>();
            *delta = if kept(i) { 0.0 } else { moved };
        }
        let known = sandwich(&p, &self.information, n, &mut self.work);
        if self.spread.is_empty() {
            // P_s = P - P Lambda P
            for (i, j) in lower(n) {
                smoothed.set(i, j, p[i * n + j] - known[i * n + j]);
            }
        } else {
            let spread = sandwich(&p, &self.spread, n, &mut self.work);
            let d = |i: usize| f64::from(u8::from(!kept(i)));
            for (i, j) in lower(n) {
                let at = i * n + j;
                let value = p[at] - (d(i) + d(j)) * known[at] + d(i) * d(j) * spread[at];
                smoothed.set(i, j, value);
            }
        }
        keep_positive(smoothed, &p);
    }
}

/// Rows and columns of the lower triangle.
fn lower(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)))
}

fn symmetrise(square: &mut [f64], n: usize) {
    for (i, j) in lower(n) {
        let mean = 0.5 * (square[i * n + j] + square[j * n + i]);
        square[i * n + j] = mean;
        square[j * n + i] = mean;
    }
}

/// `out = A B`, row-major and square.
fn product(a: &[f64], b: &[f64], n: usize, out: &mut [f64]) {
    for (row, out) in a.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
        out.fill(0.0);
        row.iter().zip(b.chunks_exact(n)).for_each(|(f, b)| add(out, *f, b));
    }
}

/// `X = X + A B'` for a symmetric product, or `X = X + A B' + B A'` with `both`.
fn add_transposed(x: &mut [f64], a: &[f64], b: &[f64], n: usize, both: bool) {
    let dot = |i: usize, j: usize| {
        a[i * n..][..n].iter().zip(&b[j * n..][..n]).map(|(a, b)| a * b).sum::<f64>()
    };
    for (i, j) in lower(n) {
        let sum = if both { dot(i, j) + dot(j, i) } else { dot(i, j) };
        x[i * n + j] += sum;
        if i != j {
            x[j * n + i] += sum;
        }
    }
}

/// Lower triangle of `P X P`.
fn sandwich(p: &[f64], x: &[f64], n: usize, work: &mut [f64]) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    product(x, p, n, work);
    for (i, (row, out)) in p.chunks_exact(n).zip(out.chunks_exact_mut(n)).enumerate() {
        row.iter().zip(work.chunks_exact(n)).for_each(|(f, w)| add(&mut out[..=i], *f, &w[..=i]));
    }
    out
}

/// Removes the negative eigenvalues that rounding leaves where the later samples determine a
/// direction by orders of magnitude better than the filter did. The scale is that of the filter's
/// covariance `p`.
fn keep_positive(smoothed: &mut Covariance, p: &[f64]) {
    let n = smoothed.dimension();
    let scale = |i: usize| p[i * n + i].sqrt();
    let scaled = DMatrix::from_fn(n, n, |i, j| smoothed.get(i, j) / (scale(i) * scale(j)));
    if Cholesky::<f64, Dyn>::new(scaled.clone()).is_some() || scaled.iter().any(|v| v.is_nan()) {
        return;
    }
    let SymmetricEigen { eigenvectors, eigenvalues } = scaled.symmetric_eigen();
    let kept = DMatrix::from_diagonal(&eigenvalues.map(|value| value.max(ROUNDING)));
    let positive = &eigenvectors * kept * eigenvectors.transpose();
    for (i, j) in lower(n) {
        smoothed.set(i, j, positive[(i, j)] * scale(i) * scale(j));
    }
}
