//! The remaining part of the initial error: a fixed-point smoother of the whole state.
//!
//! Let `x_0` be the initial error with covariance `P_0 = L L'`. With the filter's own `Phi`, `H`,
//! `S` and `K`, the smoother propagates (Simon, *Optimal State Estimation*, 2006, section 9.2)
//! ```text
//! G = cov(x_t, x_0) L'^-1:   G- = Phi G,   G+ = (I - K H) G-,               G = L at the start
//! M = L^-1 cov(x_0 | z) L'^-1:             M+ = M - (H G-)' S^-1 (H G-),    M = I at the start
//! ```
//! `M` is the remaining covariance of `x_0` in units of the prior. Its eigenvalues are between 0
//! and 1; an eigenvector with eigenvalue 1 is a direction on which the measurements hold no
//! information. Without process noise, `M^-1 - I` is the local observability Gramian `sum Phi' H'
//! R^-1 H Phi` in these units; process noise reduces it. Neither matrix is ever inverted, so
//! unobservable directions cause no numerical trouble. `G = (I - K H) Phi ... L` maps the initial
//! error to the present error.
//!
//! `F = Phi ... L` is the same map without measurements. The diagonal of the Gramian of `F` is the
//! information that the measurements would hold on each component if all others were known.

use navfuse_core::state::Layout;
use navfuse_core::state::covariance::{Transition, Update};
use pulp::{Arch, Simd, WithSimd};

/// Fixed-point smoother of the initial error. Rows are indices of the error state, columns are
/// components of the initial error in units of their prior.
#[derive(Clone, Debug)]
pub struct InitialError {
    n: usize,
    /// Length of a padded row of `G`, and of `F`.
    stride: usize,
    /// `G` and `F` beside each other, row-major: both take the same transitions.
    maps: Vec<f64>,
    /// `M`, row-major.
    left: Vec<f64>,
    /// Diagonal of the Gramian of `F`.
    alone: Vec<f64>,
    /// Work space.
    carried: Vec<f64>,
    rows: Vec<f64>,
    lower: Lower,
    processor: Arch,
}

impl InitialError {
    /// Creates the smoother from `L`, row-major `n` x `n`; column `i` is the error of one prior
    /// sigma in the component `i`.
    pub fn new(n: usize, l: &[f64]) -> Self {
        let stride = n.next_multiple_of(4);
        let mut maps = vec![0.0; n * 2 * stride];
        let mut left = vec![0.0; n * n];
        for i in 0..n {
            for map in maps[2 * i * stride..][..2 * stride].chunks_exact_mut(stride) {
                map[..n].copy_from_slice(&l[i * n..][..n]);
            }
            // a component with zero prior variance has no error that could remain
            left[i * n + i] = f64::from(u8::from((0..n).any(|k| l[k * n + i] != 0.0)));
        }
        Self {
            n,
            stride,
            maps,
            left,
            alone: vec![0.0; n],
            carried: Vec::new(),
            rows: Vec::new(),
            lower: Lower::default(),
            processor: Arch::new(),
        }
    }

    /// Propagates `G` and `F`.
    pub fn transition(&mut self, transition: &Transition) {
        transition.carry(&mut self.maps, 2 * self.stride, &mut self.carried);
    }

    /// Applies an update. `reduction` receives the factor by which the update reduced the remaining
    /// variance of each component.
    pub fn correction(&mut self, layout: &Layout, update: &Update, reduction: &mut [f64]) {
        let processor = self.processor;
        processor.dispatch(Correction { error: self, update, reduction });
        self.reset(layout, &update.delta);
    }

    #[inline(always)]
    fn correct<S: Simd>(&mut self, simd: S, update: &Update, reduction: &mut [f64]) {
        let Self { n, stride, maps, left, alone, rows, lower, .. } = self;
        let (m, stride) = (update.m, *stride);
        // H G in the first half of each row, H F in the second
        read(simd, update, maps, 2 * stride, rows);
        if lower.factorise(&update.r, m) {
            lower.solve(simd, rows, 2 * stride, stride);
            // diagonal of F' H' R^-1 H F
            for row in rows.chunks_exact(2 * stride) {
                alone.iter_mut().zip(&row[stride..]).for_each(|(sum, y)| *sum += y * y);
            }
        }
        // G+ = G- - K (H G-)
        for (g, k) in maps.chunks_exact_mut(2 * stride).zip(update.gain().chunks_exact(m)) {
            for (k, row) in k.iter().zip(rows.chunks_exact(2 * stride)).filter(|(k, _)| **k != 0.0)
            {
                add(simd, &mut g[..stride], -k, &row[..stride]);
            }
        }
        if lower.factorise(&update.s, m) {
            lower.solve(simd, rows, 2 * stride, 0);
            for (i, reduction) in reduction.iter_mut().enumerate() {
                *reduction = left[i * *n + i];
            }
            // M+ = M - Y' Y with Y = L_S^-1 H G- and S = L_S L_S'
            for y in rows.chunks_exact(2 * stride) {
                for (left, by) in left.chunks_exact_mut(*n).zip(y).filter(|(_, by)| **by != 0.0) {
                    add(simd, left, -by, &y[..*n]);
                }
            }
            for (i, reduction) in reduction.iter_mut().enumerate() {
                let left = &mut left[i * *n + i];
                *left = left.max(SMALLEST);
                *reduction = (*reduction / *left).max(1.0);
            }
        }
    }

    /// Expresses the present error relative to the state with an injected error.
    pub fn reset(&mut self, layout: &Layout, injected: &[f64]) {
        layout.reset_rows(injected, &mut self.maps, 2 * self.stride);
    }

    /// Returns `M`, row-major.
    pub fn left(&self) -> &[f64] {
        &self.left
    }

    /// Returns the information on each component if all others were known: prior over remaining
    /// variance, less one.
    pub fn alone(&self) -> &[f64] {
        &self.alone
    }

    /// Returns the element `(i, j)` of `G`: the error in the state `i`, for an initial error of one
    /// prior sigma in the component `j`.
    pub fn carried(&self, i: usize, j: usize) -> f64 {
        self.maps[2 * i * self.stride + j]
    }
}

/// A correction, compiled for any processor and for one with AVX2.
struct Correction<'a> {
    error: &'a mut InitialError,
    update: &'a Update,
    reduction: &'a mut [f64],
}

impl WithSimd for Correction<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.error.correct(simd, self.update, self.reduction);
    }
}

/// Smallest remaining share of a prior variance; below it, rounding errors dominate (20 bits).
const SMALLEST: f64 = 1e-12;

/// Adds a multiple of a row to another one of its length.
#[inline(always)]
fn add<S: Simd>(simd: S, to: &mut [f64], factor: f64, row: &[f64]) {
    let ((to, to_rest), (row, rest)) = (S::as_mut_simd_f64s(to), S::as_simd_f64s(row));
    let factors = simd.splat_f64s(factor);
    for (to, row) in to.iter_mut().zip(row) {
        *to = simd.add_f64s(*to, simd.mul_f64s(factors, *row));
    }
    to_rest.iter_mut().zip(rest).for_each(|(to, row)| *to += factor * row);
}

/// Computes `H X`, with rows of the stride.
#[inline(always)]
fn read<S: Simd>(simd: S, update: &Update, x: &[f64], stride: usize, out: &mut Vec<f64>) {
    let w = update.columns.len();
    out.clear();
    out.resize(update.m * stride, 0.0);
    for (row, h) in out.chunks_exact_mut(stride).zip(update.h.chunks_exact(w.max(1))) {
        for (&column, &h) in update.columns.iter().zip(h).filter(|(_, h)| **h != 0.0) {
            add(simd, row, h, &x[column * stride..][..stride]);
        }
    }
}

/// Cholesky factor of a small matrix.
#[derive(Clone, Debug, Default)]
struct Lower {
    m: usize,
    l: Vec<f64>,
}

impl Lower {
    /// Factorises a matrix; `false` if it is not positive definite.
    #[inline(always)]
    fn factorise(&mut self, a: &[f64], m: usize) -> bool {
        self.m = m;
        self.l.resize(m * m, 0.0);
        let l = &mut self.l[..m * m];
        for i in 0..m {
            for j in 0..=i {
                let sum: f64 = (0..j).map(|k| l[i * m + k] * l[j * m + k]).sum();
                let rest = a[i * m + j] - sum;
                l[i * m + j] = if i == j { rest.sqrt() } else { rest / l[j * m + j] };
            }
            if l[i * m + i].is_nan() || l[i * m + i] <= 0.0 {
                return false;
            }
        }
        true
    }

    /// Computes `L^-1 X` in place, in the second or the first half of rows of a length: the columns
    /// `from` on, as many as half a row has.
    #[inline(always)]
    fn solve<S: Simd>(&self, simd: S, x: &mut [f64], length: usize, from: usize) {
        let columns = from..from + length / 2;
        for (i, l) in self.l.chunks_exact(self.m).enumerate() {
            let (done, rest) = x.split_at_mut(i * length);
            let row = &mut rest[columns.clone()];
            for (l, before) in l.iter().zip(done.chunks_exact(length)) {
                add(simd, row, -l, &before[columns.clone()]);
            }
            let d = l[i];
            row.iter_mut().for_each(|y| *y /= d);
        }
    }
}
