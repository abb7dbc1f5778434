//! The products of an update: rows of the covariance with the few rows of `H` and of the gain.
//!
//! A state that is not correlated with the innovation keeps its row and column. Where the
//! covariance is sparse, as that of a map before it is explored, the products therefore pass over
//! the *reach* of the innovation alone: the groups of columns in which `H P` is not zero.
//!
//! As in [`super::kernel`], the loops are written once and compiled twice, with the same bits.

use super::{Covariance, Update};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Columns that one instruction takes.
const LANES: usize = 4;

/// `H P` and `S = H P H' + R`.
pub(super) struct Projection<'a> {
    pub(super) update: &'a mut Update,
    pub(super) covariance: &'a Covariance,
}

/// The gain, the correction, and the covariance after the update.
pub(super) struct Joseph<'a> {
    pub(super) update: &'a mut Update,
    pub(super) covariance: &'a mut Covariance,
    pub(super) considered: &'a [bool],
}

impl WithSimd for Projection<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.update.project(self.covariance);
    }
}

impl WithSimd for Joseph<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.update.find_gain(self.covariance, self.considered);
        self.update.join(self.covariance);
    }
}

impl Update {
    #[inline(always)]
    pub(super) fn project(&mut self, covariance: &Covariance) {
        let (m, w, stride) = (self.m, self.columns.len(), covariance.stride);
        self.hp.resize(m * stride, 0.0);
        for (a, hp) in self.hp.chunks_exact_mut(stride).enumerate() {
            hp.fill(-0.0);
            for (h, &column) in self.h[a * w..][..w].iter().zip(&self.columns) {
                // row and column of P are the same
                for (hp, p) in hp.iter_mut().zip(&covariance.p[column * stride..]) {
                    *hp += h * p;
                }
            }
        }
        self.find_reached();
        self.s.clear();
        self.s.extend_from_slice(&self.r);
        for a in 0..m {
            for (b, hp) in self.hp.chunks_exact(stride).enumerate() {
                self.s[a * m + b] += dot(&self.h[a * w..][..w], &self.columns, hp);
            }
        }
    }

    /// Finds the groups of columns in which `H P` is not zero.
    #[inline(always)]
    fn find_reached(&mut self) {
        let Self { hp, reached, m, .. } = self;
        let stride = hp.len() / (*m).max(1);
        reached.clear();
        for at in (0..stride).step_by(LANES) {
            let group = |row: &[f64]| row[at..at + LANES].iter().any(|v| *v != 0.0);
            if hp.chunks_exact(stride).any(group) {
                match reached.last_mut() {
                    Some(run) if run.end == at => run.end += LANES,
                    _ => reached.push(at..at + LANES),
                }
            }
        }
    }

    /// The gain `P H' S^-1` by two substitutions, and the correction.
    #[inline(always)]
    pub(super) fn find_gain(&mut self, covariance: &Covariance, considered: &[bool]) {
        let (n, m, stride) = (covariance.n, self.m, covariance.stride);
        let lower = &self.lower;
        self.kt.clear();
        self.kt.extend_from_slice(&self.hp);
        for i in 0..m {
            let below = (0..i).map(|k| (lower[i * m + k], k));
            substitute(&mut self.kt, stride, i, lower[i * m + i], below);
        }
        for i in (0..m).rev() {
            let above = (i + 1..m).map(|k| (lower[k * m + i], k));
            substitute(&mut self.kt, stride, i, lower[i * m + i], above);
        }
        for kt in self.kt.chunks_exact_mut(stride) {
            for (k, considered) in kt.iter_mut().zip(considered) {
                *k = if *considered { 0.0 } else { *k };
            }
        }
        self.delta[..n].fill(-0.0);
        for (kt, y) in self.kt.chunks_exact(stride).zip(&self.innovation) {
            for (delta, k) in self.delta[..n].iter_mut().zip(kt) {
                *delta += k * y;
            }
        }
    }

    /// Joseph's form, row by row: `A = P - K (H P)`, then `A - (A H' - K R) K'`.
    #[inline(always)]
    pub(super) fn join(&mut self, covariance: &mut Covariance) {
        let (n, m, w, stride) = (covariance.n, self.m, self.columns.len(), covariance.stride);
        let Self { columns, h, r, hp, kt, work, reached, .. } = self;
        work.clear();
        work.resize(2 * m + stride, 0.0);
        let (k, rest) = work.split_at_mut(m);
        let (d, sum) = rest.split_at_mut(m);
        for i in reached.iter().cloned().flatten().take_while(|i| *i < n) {
            let row = &mut covariance.p[i * stride..][..stride];
            for (k, kt) in k.iter_mut().zip(kt.chunks_exact(stride)) {
                *k = kt[i];
            }
            for run in &*reached {
                subtract(row, k, hp, sum, run.clone());
            }
            for (a, d) in d.iter_mut().enumerate() {
                let kr: f64 = k.iter().enumerate().map(|(b, k)| k * r[b * m + a]).sum();
                *d = dot(&h[a * w..][..w], columns, row) - kr;
            }
            for run in &*reached {
                subtract(row, d, kt, sum, run.clone());
            }
        }
        covariance.symmetrise_reached(reached);
    }
}

/// `h' row` over the columns.
#[inline(always)]
fn dot(h: &[f64], columns: &[usize], row: &[f64]) -> f64 {
    h.iter().zip(columns).map(|(h, &column)| h * row[column]).sum()
}

/// `row = row - k' X` in a range of columns, with the sum in `sum`.
#[inline(always)]
fn subtract(row: &mut [f64], k: &[f64], x: &[f64], sum: &mut [f64], at: Range<usize>) {
    let (stride, sum) = (row.len(), &mut sum[at.clone()]);
    sum.fill(-0.0);
    for (k, x) in k.iter().zip(x.chunks_exact(stride)) {
        for (sum, x) in sum.iter_mut().zip(&x[at.clone()]) {
            *sum += k * x;
        }
    }
    for (row, sum) in row[at].iter_mut().zip(&*sum) {
        *row -= sum;
    }
}

/// One step of a substitution: `row i = (row i - sum of factor * row k) / divisor`.
#[inline(always)]
fn substitute(
    rows: &mut [f64],
    stride: usize,
    i: usize,
    divisor: f64,
    terms: impl Iterator<Item = (f64, usize)> + Clone,
) {
    for at in (0..stride).step_by(LANES) {
        let mut sum = [-0.0; LANES];
        for (factor, k) in terms.clone() {
            if let Some(row) = rows[k * stride + at..].first_chunk::<LANES>() {
                (0..LANES).for_each(|i| sum[i] += factor * row[i]);
            }
        }
        if let Some(row) = rows[i * stride + at..].first_chunk_mut::<LANES>() {
            (0..LANES).for_each(|i| row[i] = (row[i] - sum[i]) / divisor);
        }
    }
}
