//! The symmetric covariance of the error state.

use super::aligned::Aligned;
use super::lanes::{put, tile, turned};
use crate::checkpoint::{Io, Saved};
use crate::state::manifold::MAX_TANGENT;
use nalgebra::{DMatrix, DVector};
use pulp::Simd;
use std::ops::Range;

/// A symmetric covariance, row-major, with rows and columns padded by zeros to a multiple of four
/// so that the kernel runs on whole vectors and tiles.
#[derive(Debug, PartialEq)]
pub struct Covariance {
    pub(super) n: usize,
    pub(super) stride: usize,
    pub(super) p: Aligned,
}

impl Saved for Covariance {
    fn saved(&mut self, io: &mut Io<'_>) {
        io.each(self.p.iter_mut());
    }
}

impl Clone for Covariance {
    fn clone(&self) -> Self {
        Self { n: self.n, stride: self.stride, p: self.p.clone() }
    }

    fn clone_from(&mut self, from: &Self) {
        let Self { n, stride, p } = from;
        (self.n, self.stride) = (*n, *stride);
        self.p.clone_from(p);
    }
}

impl Covariance {
    /// The zero covariance of dimension `n`.
    pub fn zero(n: usize) -> Self {
        let stride = n.max(1).next_multiple_of(4);
        Self { n, stride, p: Aligned::zeros(stride * stride) }
    }

    /// The dimension.
    pub fn dimension(&self) -> usize {
        self.n
    }

    /// Size of the elements, bytes.
    pub(crate) fn size(&self) -> usize {
        self.p.len() * size_of::<f64>()
    }

    /// The element at row `i`, column `j`.
    pub fn get(&self, i: usize, j: usize) -> f64 {
        self.p[i * self.stride + j]
    }

    /// Sets the elements at `(i, j)` and `(j, i)`.
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        self.p[i * self.stride + j] = value;
        self.p[j * self.stride + i] = value;
    }

    /// Copies the block of these states, which are all states of this one, from the covariance of all.
    pub(crate) fn copy_block(&mut self, all: &Self, states: Range<usize>) {
        let from = all.p[states.start * all.stride..].chunks(all.stride);
        for (to, from) in self.p.chunks_exact_mut(self.stride).zip(from).take(states.len()) {
            to[..states.len()].copy_from_slice(&from[states.clone()]);
        }
    }

    /// The 1-sigma of the error state `i`.
    pub fn sigma(&self, i: usize) -> f64 {
        standard_deviation(self.get(i, i))
    }

    /// The first index whose variance is not a positive finite number.
    pub fn first_invalid(&self) -> Option<usize> {
        (0..self.n).find(|&i| !(self.get(i, i) > 0.0 && self.get(i, i).is_finite()))
    }

    /// A dense copy.
    pub fn to_dense(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.n, self.n, |i, j| self.get(i, j))
    }

    /// Normalised estimation error squared, `e' P^-1 e`, of the error states `rows`; `None` if their
    /// covariance is not positive definite.
    ///
    /// ```
    /// # use navfuse_core::state::covariance::Covariance;
    /// let mut p = Covariance::zero(3);
    /// (0..3).for_each(|i| p.set(i, i, 4.0));
    /// assert_eq!(p.nees(&[2.0, 9.0, 4.0], &[0, 2]), Some(5.0));
    /// ```
    pub fn nees(&self, errors: &[f64], rows: &[usize]) -> Option<f64> {
        let n = rows.len();
        let p = DMatrix::from_fn(n, n, |i, j| self.get(rows[i], rows[j]));
        let e = DVector::from_fn(n, |i, _| errors[rows[i]]);
        Some(e.dot(&p.cholesky()?.solve(&e)))
    }

    /// `P = G P G'` with `G` the identity but for the block `g` (row-major) on the range.
    pub fn transform(&mut self, range: Range<usize>, g: &[f64]) {
        // compiled for three axes and for any number
        match range.len() {
            3 => self.transform_rows(range.start, 3, g),
            w => self.transform_rows(range.start, w, g),
        }
    }

    #[inline(always)]
    fn transform_rows(&mut self, first: usize, w: usize, g: &[f64]) {
        const LANES: usize = 4;
        let stride = self.stride;
        let rows = &mut self.p[first * stride..][..w * stride];
        for at in (0..stride).step_by(LANES) {
            let mut old = [[0.0; LANES]; MAX_TANGENT];
            for (old, row) in old[..w].iter_mut().zip(rows.chunks_exact(stride)) {
                old.copy_from_slice(&row[at..at + LANES]);
            }
            for (row, g) in rows.chunks_exact_mut(stride).zip(g.chunks_exact(w)) {
                let mut sum = [-0.0; LANES];
                for (g, old) in g.iter().zip(&old[..w]) {
                    (0..LANES).for_each(|i| sum[i] += g * old[i]);
                }
                row[at..at + LANES].copy_from_slice(&sum);
            }
        }
        for row in rows.chunks_exact_mut(stride) {
            let row = &mut row[first..first + w];
            let mut column = [0.0; MAX_TANGENT];
            for (c, g) in column[..w].iter_mut().zip(g.chunks_exact(w)) {
                *c = g.iter().zip(&*row).map(|(g, p)| g * p).sum();
            }
            row.copy_from_slice(&column[..w]);
        }
        self.mirror_rows(first, w);
    }

    /// Copies rows to their columns, and makes the block on the diagonal symmetric.
    #[inline(always)]
    fn mirror_rows(&mut self, first: usize, w: usize) {
        (first..first + w).for_each(|i| self.symmetrise_row(i, first..i));
        let stride = self.stride;
        let (before, rest) = self.p.split_at_mut(first * stride);
        let (own, after) = rest.split_at_mut(w * stride);
        let others = before.chunks_exact_mut(stride).enumerate();
        for (j, row) in others.chain((first + w..).zip(after.chunks_exact_mut(stride))) {
            for (p, own) in row[first..first + w].iter_mut().zip(own.chunks_exact(stride)) {
                *p = own[j];
            }
        }
    }

    /// `P = G P G'`, where `G` is the identity except for `g` in three rows of column `k`, which is
    /// none of them.
    pub(crate) fn shear(&mut self, rows: Range<usize>, k: usize, g: &nalgebra::Vector3<f64>) {
        let (stride, first) = (self.stride, rows.start);
        for (row, g) in rows.clone().zip(g) {
            let Ok([to, by]) = self
                .p
                .get_disjoint_mut([row * stride..(row + 1) * stride, k * stride..(k + 1) * stride])
            else {
                continue;
            };
            to.iter_mut().zip(by).for_each(|(to, by)| *to += g * *by);
        }
        for row in self.p[first * stride..][..3 * stride].chunks_exact_mut(stride) {
            let by = row[k];
            row[first..first + 3].iter_mut().zip(g).for_each(|(p, g)| *p += g * by);
        }
        self.mirror_rows(first, 3);
    }

    /// `X = G' X G` with the `G` of [`Self::shear`].
    pub(crate) fn shear_back(&mut self, rows: Range<usize>, k: usize, g: &nalgebra::Vector3<f64>) {
        let stride = self.stride;
        for (row, g) in rows.clone().zip(g) {
            for j in 0..self.n {
                self.p[k * stride + j] += g * self.p[row * stride + j];
            }
        }
        for row in self.p.chunks_exact_mut(stride) {
            row[k] += row[rows.clone()].iter().zip(g).map(|(x, g)| g * x).sum::<f64>();
        }
        self.symmetrise_rows(k..k + 1);
    }

    /// Rows of the matrix.
    pub(crate) fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.p.chunks_exact(self.stride).take(self.n).map(|row| &row[..self.n])
    }

    /// Elements of the lower triangle, row by row.
    pub(crate) fn lower(&self) -> impl Iterator<Item = f64> + '_ {
        self.rows().enumerate().flat_map(|(i, row)| row[..=i].iter().copied())
    }

    /// Sets the elements from those of the lower triangle, row by row.
    pub(crate) fn set_lower(&mut self, mut triangle: &[f64]) {
        for i in 0..self.n {
            let Some((row, rest)) = triangle.split_at_checked(i + 1) else { return };
            self.p[i * self.stride..][..=i].copy_from_slice(row);
            triangle = rest;
        }
        self.mirror();
    }

    /// `X = X - Y`, of one dimension.
    pub(crate) fn subtract(&mut self, other: &Self) {
        self.p.iter_mut().zip(other.p.iter()).for_each(|(x, y)| *x -= y);
    }

    /// Adds a column to column `c`, and to row `c`.
    pub(crate) fn add_both(&mut self, c: usize, column: &[f64]) {
        for (i, v) in column.iter().enumerate() {
            self.p[i * self.stride + c] += v;
            self.p[c * self.stride + i] += v;
        }
    }

    /// `P = P + a s s'`: the error grows by a random multiple of `s`, of the variance `a`.
    pub(crate) fn widen(&mut self, a: f64, s: impl Fn(usize) -> f64) {
        for i in 0..self.n {
            for j in 0..self.n {
                self.p[i * self.stride + j] += a * s(i) * s(j);
            }
        }
        self.symmetrise();
    }

    /// `P = c P`.
    pub(crate) fn scale(&mut self, c: f64) {
        self.p.iter_mut().for_each(|p| *p *= c);
    }

    /// Copies the lower triangle to the upper one.
    pub(super) fn mirror(&mut self) {
        for i in 0..self.n {
            for j in 0..i {
                self.p[j * self.stride + i] = self.p[i * self.stride + j];
            }
        }
    }

    /// Replaces the matrix by the mean of it and its transpose.
    pub(super) fn symmetrise(&mut self) {
        (0..self.n).for_each(|i| self.symmetrise_row(i, 0..i));
    }

    /// [`Self::symmetrise`] where rows and columns of these ranges meet, multiples of four.
    #[inline(always)]
    pub(super) fn symmetrise_reached<S: Simd>(&mut self, simd: S, reached: &[Range<usize>]) {
        let lanes = self.stride / 4;
        let p = self.p.as_chunks_mut::<4>().0;
        let groups = reached.iter().flat_map(|run| run.start / 4..run.end / 4);
        for g in groups.clone() {
            for h in groups.clone().take_while(|h| *h <= g) {
                let below = tile(p, lanes, g, h);
                let above = if g == h { below } else { tile(p, lanes, h, g) };
                let (mut mean, other) = (below, turned(simd, above));
                let other = S::as_simd_f64s(other.as_flattened()).0;
                let half = simd.splat_f64s(0.5);
                for (mean, other) in
                    S::as_mut_simd_f64s(mean.as_flattened_mut()).0.iter_mut().zip(other)
                {
                    *mean = simd.mul_f64s(half, simd.add_f64s(*mean, *other));
                }
                put(p, lanes, g, h, mean);
                put(p, lanes, h, g, turned(simd, mean));
            }
        }
    }

    /// [`Self::symmetrise`] where these rows and their columns alone have changed.
    fn symmetrise_rows(&mut self, rows: Range<usize>) {
        rows.for_each(|i| self.symmetrise_row(i, 0..self.n));
    }

    /// Replaces some elements of a row, and of its column, by their mean.
    #[inline]
    fn symmetrise_row(&mut self, i: usize, columns: Range<usize>) {
        for j in columns {
            let mean = 0.5 * (self.p[i * self.stride + j] + self.p[j * self.stride + i]);
            self.p[i * self.stride + j] = mean;
            self.p[j * self.stride + i] = mean;
        }
    }
}

/// Square root of a variance. Rounding may leave a variance below zero, whose root is zero; NaN stays
/// NaN, so that no unknown sigma is shown as a perfect one.
pub fn standard_deviation(variance: f64) -> f64 {
    if variance < 0.0 { 0.0 } else { variance.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A definite matrix without order: `A A' + I`.
    fn definite(n: usize) -> DMatrix<f64> {
        let next = |i: usize, j: usize| ((i * 7919 + j * 104_729) % 1009) as f64 / 1009.0 - 0.5;
        let a = DMatrix::from_fn(n, n, next);
        &a * a.transpose() + DMatrix::identity(n, n)
    }

    fn covariance(dense: &DMatrix<f64>) -> Covariance {
        let mut p = Covariance::zero(dense.nrows());
        (0..p.n).for_each(|i| (0..=i).for_each(|j| p.set(i, j, dense[(i, j)])));
        p
    }

    /// Blocks of one to four states at the begin, in the middle and at the end, with padding and without.
    #[test]
    fn a_transform_is_that_of_dense_matrices_and_leaves_a_symmetric_one() {
        for (n, range) in [(9, 3..6), (9, 6..9), (8, 0..3), (12, 5..6), (13, 9..13), (5, 1..3)] {
            let (p, w) = (definite(n), range.len());
            let g: Vec<f64> = (0..w * w).map(|k| ((k * 37 + 5) % 11) as f64 / 11.0 - 0.4).collect();
            let mut whole = DMatrix::identity(n, n);
            let block = DMatrix::from_row_slice(w, w, &g);
            whole.view_mut((range.start, range.start), (w, w)).copy_from(&block);
            let mut found = covariance(&p);
            found.transform(range.clone(), &g);
            let dense = found.to_dense();
            assert_eq!(dense, dense.transpose(), "{n} {range:?}");
            // sums of up to 16 products of numbers of up to 10
            assert!((dense - &whole * &p * whole.transpose()).amax() < 1e-13, "{n} {range:?}");
        }
    }

    #[test]
    fn a_block_is_copied_from_the_covariance_of_all() {
        let all = covariance(&definite(9));
        let mut own = Covariance::zero(3);
        own.copy_block(&all, 6..9);
        assert_eq!(own.to_dense(), all.to_dense().view((6, 6), (3, 3)));
        Covariance::zero(0).copy_block(&all, 0..0);
    }
}
