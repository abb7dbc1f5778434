//! The backward recursion of Bryson and Frazier.
//!
//! `e` is the error `truth [-] estimate` that the covariance `P` describes. Every step of the filter
//! is a linear map of it. A transition gives `e = Phi e + w`, and a correction with the innovation
//! `y = H e + v`, any gain `K` and the reset `G` after the injection gives
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
//! With considered states the gain is not optimal, and the innovations are not white: `y` correlates
//! with the error after the correction by `C = G (P H' - K S)`. `lambda` stays a valid estimator, but
//! its covariance is then `Omega` instead of `Lambda`, and the estimate of a considered state stays:
//! ```text
//! Omega = A' Omega A + H' S^-1 H + A' Lambda C S^-1 H + (A' Lambda C S^-1 H)'
//! P_s = P - D P Lambda P - P Lambda P D + D P Omega P D
//! ```
//! `D` is the identity without the considered states. For an optimal gain `C = 0` and
//! `Omega = Lambda`.

use crate::state::Layout;
use crate::state::covariance::Covariance;
use nalgebra::{Cholesky, DMatrix, Dyn, SymmetricEigen};

/// Smallest eigenvalue of a smoothed covariance relative to that of the filter; rounding makes
/// smaller ones.
const ROUNDING: f64 = 1e-15;

/// A linear map of the error, `M = 1 + E`, by the rows in which `E` is not zero.
#[derive(Clone, Debug, Default)]
pub(super) struct Map {
    /// Rows that differ from the identity, and the place of each row of the matrix among them.
    rows: Vec<usize>,
    places: Vec<usize>,
    /// Elements of `E` beside the diagonal, and the diagonal of these rows: place of the row,
    /// column, value.
    elements: Vec<(usize, usize, f64)>,
    diagonal: Vec<f64>,
    /// `V`, one row for each changed row.
    work: Vec<f64>,
    sums: Vec<f64>,
}

/// No row of the matrix differs from the identity there.
const UNCHANGED: usize = usize::MAX;

impl Map {
    /// Identity of dimension `n`.
    pub(super) fn identity(n: usize) -> Self {
        Self { places: vec![UNCHANGED; n], ..Self::default() }
    }

    /// Sets the map to the elements of the rows that differ from the identity.
    pub(super) fn set(&mut self, elements: impl Iterator<Item = (usize, usize, f64)>) {
        self.rows.iter().for_each(|row| self.places[*row] = UNCHANGED);
        self.rows.clear();
        self.elements.clear();
        self.diagonal.clear();
        for (i, j, value) in elements {
            if self.places[i] == UNCHANGED {
                self.places[i] = self.rows.len();
                self.rows.push(i);
                self.diagonal.push(-1.0);
            }
            if i == j {
                self.diagonal[self.places[i]] += value;
            } else if value != 0.0 {
                self.elements.push((self.places[i], j, value));
            }
        }
        let diagonal = self.rows.iter().zip(&self.diagonal).enumerate();
        let diagonal = diagonal.map(|(place, (row, value))| (place, *row, *value));
        self.elements.extend(diagonal.filter(|(_, _, value)| *value != 0.0));
    }

    /// `x = M' x`.
    fn carry(&mut self, x: &mut [f64]) {
        self.sums.clear();
        self.sums.extend(self.rows.iter().map(|row| x[*row]));
        self.elements.iter().for_each(|&(place, j, value)| x[j] += value * self.sums[place]);
    }

    /// `X = M' X M` of a symmetric matrix.
    ///
    /// With the rows `W = X[R, :]` that meet `E`, `X + E' W + W' E + E' X E` is `X + Z + Z'` with
    /// `Z = E' V` and `V = W + X[R, R] E / 2`: the products touch only the elements of `E`, and the
    /// result is symmetric to the bit.
    fn congruence(&mut self, x: &mut [f64], z: &mut [f64]) {
        let n = self.places.len();
        self.work.clear();
        for row in &self.rows {
            self.work.extend_from_slice(&x[row * n..][..n]);
        }
        for (row, v) in self.rows.iter().zip(self.work.chunks_exact_mut(n)) {
            let x = &x[row * n..][..n];
            for &(place, j, value) in &self.elements {
                v[j] += 0.5 * x[self.rows[place]] * value;
            }
        }
        z.fill(0.0);
        for &(place, j, value) in &self.elements {
            add(&mut z[j * n..][..n], value, &self.work[place * n..][..n]);
        }
        for i in 0..n {
            for j in 0..i {
                let sum = x[i * n + j] + (z[i * n + j] + z[j * n + i]);
                x[i * n + j] = sum;
                x[j * n + i] = sum;
            }
            x[i * n + i] += 2.0 * z[i * n + i];
        }
    }
}

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

/// `a += f b`.
#[inline]
fn add(a: &mut [f64], f: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += f * b;
    }
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
        }
    }

    /// Passes over a linear map of the error: `lambda = M' lambda`, `Lambda = M' Lambda M`.
    pub(super) fn pass(&mut self, map: &mut Map) {
        map.carry(&mut self.lambda);
        map.congruence(&mut self.information, &mut self.work);
        if !self.spread.is_empty() {
            map.congruence(&mut self.spread, &mut self.work);
        }
    }

    /// Passes over a correction and the reset after it. Returns the square of the smoothed
    /// innovation, `u' M^-1 u` with `u = S^-1 y - K' lambda` and `M = S^-1 + K' Lambda K`; `None`
    /// where states are considered, whose innovations are not white.
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
        let mut seen = s.solve(&nalgebra::DVector::from_column_slice(innovation));
        for (i, gain) in gain.chunks_exact(m).enumerate() {
            gain.iter().enumerate().for_each(|(a, k)| seen[a] -= k * self.lambda[i]);
        }
        let square = self.spread.is_empty().then(|| self.square(&s, gain, &seen)).flatten();
        for (k, &c) in columns.iter().enumerate() {
            self.lambda[c] += (0..m).map(|a| h[a * w + k] * seen[a]).sum::<f64>();
        }
        // H' S^-1 H over the columns
        let h = DMatrix::from_row_slice(m, w, h);
        let solved = s.solve(&h);
        let gained = h.tr_mul(&solved);
        let gain = DMatrix::from_row_slice(n, m, gain);
        self.congruence(&h, &gain, columns, false);
        if !self.spread.is_empty() {
            // A' Lambda C S^-1 H, with C = P H' - K S in the rows of the considered states, whose
            // gain is zero
            let cross = DMatrix::from_row_slice(n, m, cross);
            let considered =
                DMatrix::from_fn(n, m, |i, a| if self.considered[i] { cross[(i, a)] } else { 0.0 });
            let carried = DMatrix::from_row_slice(n, n, &self.carried);
            let coupled = carried.tr_mul(&(considered * &solved));
            self.congruence(&h, &gain, columns, true);
            for i in 0..n {
                for (k, &c) in columns.iter().enumerate() {
                    self.spread[i * n + c] += coupled[(i, k)];
                    self.spread[c * n + i] += coupled[(i, k)];
                }
            }
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
    fn square(
        &mut self,
        s: &Cholesky<f64, Dyn>,
        gain: &[f64],
        seen: &nalgebra::DVector<f64>,
    ) -> Option<f64> {
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

/// Lower triangle of `P X P`.
fn sandwich(p: &[f64], x: &[f64], n: usize, work: &mut [f64]) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for (row, out) in x.chunks_exact(n).zip(work.chunks_exact_mut(n)) {
        out.fill(0.0);
        row.iter().zip(p.chunks_exact(n)).for_each(|(f, p)| add(out, *f, p));
    }
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
