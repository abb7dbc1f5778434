//! The products of an update: rows of the covariance with the few rows of `H` and of the gain.
//!
//! A state that is not correlated with the innovation keeps its row and column. Where the
//! covariance is sparse, as that of a map before it is explored, the products therefore pass over
//! the *reach* of the innovation alone: the groups of columns in which `H P` is not zero.
//!
//! As in [`super::kernel`], the loops are written once and compiled twice, with the same bits.

use super::{Covariance, Update};
use pulp::bytemuck::cast_slice;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Columns that one instruction takes at most: the rows of all matrices are padded to it.
pub(super) const LANES: usize = 4;

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
    fn with_simd<S: Simd>(self, simd: S) {
        self.update.project(simd, self.covariance);
    }
}

impl WithSimd for Joseph<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.update.find_gain(simd, self.covariance, self.considered);
        self.update.join(simd, self.covariance);
    }
}

impl Update {
    #[inline(always)]
    fn project<S: Simd>(&mut self, simd: S, covariance: &Covariance) {
        let (m, w, stride) = (self.m, self.columns.len(), covariance.stride);
        self.hp.resize(m * stride, 0.0);
        let (rows, lanes) = (S::as_simd_f64s(&covariance.p).0, stride / S::F64_LANES);
        let hp = S::as_mut_simd_f64s(&mut self.hp).0;
        for (a, hp) in hp.chunks_exact_mut(lanes).enumerate() {
            // row and column of P are the same
            let terms = self.h[a * w..][..w].iter();
            let terms = terms.zip(self.columns.iter().map(|column| &rows[column * lanes..]));
            sums(simd, hp, terms, |_, sum| sum);
        }
        self.find_reached();
        self.turn();
        self.s.clear();
        self.s.extend_from_slice(&self.r);
        self.work.resize(m.next_multiple_of(LANES), 0.0);
        for (b, hp) in self.hp.chunks_exact(stride).enumerate() {
            dots(simd, &self.ht, &self.columns, hp, &mut self.work);
            for (a, dot) in self.work[..m].iter().enumerate() {
                self.s[a * m + b] += dot;
            }
        }
    }

    /// Writes `H` by columns, each padded to whole lanes.
    #[inline(always)]
    fn turn(&mut self) {
        let (m, w) = (self.m, self.columns.len());
        let wide = m.next_multiple_of(LANES);
        self.ht.resize(w * wide, 0.0);
        for (k, column) in self.ht.chunks_exact_mut(wide.max(1)).enumerate() {
            (0..m).for_each(|a| column[a] = self.h[a * w + k]);
            column[m..].fill(0.0);
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
    fn find_gain<S: Simd>(&mut self, simd: S, covariance: &Covariance, considered: &[bool]) {
        let (n, m, lanes) = (covariance.n, self.m, covariance.stride / S::F64_LANES);
        let Self { lower, hp, kt, delta, innovation, .. } = self;
        kt.clear();
        kt.extend_from_slice(hp);
        let rows = S::as_mut_simd_f64s(kt).0;
        for i in 0..m {
            let below = (0..i).map(|k| (lower[i * m + k], k));
            substitute(simd, rows, lanes, i, lower[i * m + i], below);
        }
        for i in (0..m).rev() {
            let above = (i + 1..m).map(|k| (lower[k * m + i], k));
            substitute(simd, rows, lanes, i, lower[i * m + i], above);
        }
        for (i, _) in considered.iter().enumerate().filter(|(_, considered)| **considered) {
            kt.iter_mut().skip(i).step_by(covariance.stride).for_each(|k| *k = 0.0);
        }
        let rows = S::as_simd_f64s(kt).0;
        for (at, delta) in delta[..n].chunks_mut(S::F64_LANES).enumerate() {
            let mut sum = simd.splat_f64s(-0.0);
            for (row, y) in rows.chunks_exact(lanes).zip(&*innovation) {
                sum = simd.add_f64s(sum, simd.mul_f64s(row[at], simd.splat_f64s(*y)));
            }
            delta.iter_mut().zip(cast_slice(&[sum])).for_each(|(delta, sum)| *delta = *sum);
        }
    }

    /// Joseph's form, row by row: `A = P - K (H P)`, then `A - (A H' - K R) K'`.
    #[inline(always)]
    fn join<S: Simd>(&mut self, simd: S, covariance: &mut Covariance) {
        let (n, m, stride) = (covariance.n, self.m, covariance.stride);
        let Self { columns, ht, r, hp, kt, work, reached, .. } = self;
        let wide = m.next_multiple_of(LANES);
        work.clear();
        work.resize(m + wide, 0.0);
        let (k, d) = work.split_at_mut(m);
        for i in reached.iter().cloned().flatten().take_while(|i| *i < n) {
            let row = &mut covariance.p[i * stride..][..stride];
            for (k, kt) in k.iter_mut().zip(kt.chunks_exact(stride)) {
                *k = kt[i];
            }
            for run in &*reached {
                subtract(simd, row, k, hp, run.clone());
            }
            dots(simd, ht, columns, row, d);
            for (a, d) in d[..m].iter_mut().enumerate() {
                let kr: f64 = k.iter().enumerate().map(|(b, k)| k * r[b * m + a]).sum();
                *d -= kr;
            }
            for run in &*reached {
                subtract(simd, row, &d[..m], kt, run.clone());
            }
        }
        covariance.symmetrise_reached(simd, reached);
    }
}

/// One step of a substitution: `row i = (row i - sum of factor * row k) / divisor`.
#[inline(always)]
fn substitute<S: Simd>(
    simd: S,
    rows: &mut [S::f64s],
    lanes: usize,
    i: usize,
    divisor: f64,
    terms: impl Iterator<Item = (f64, usize)> + Clone,
) {
    let divisor = simd.splat_f64s(divisor);
    for at in 0..lanes {
        let mut sum = simd.splat_f64s(-0.0);
        for (factor, k) in terms.clone() {
            let term = simd.mul_f64s(simd.splat_f64s(factor), rows[k * lanes + at]);
            sum = simd.add_f64s(sum, term);
        }
        let left = simd.sub_f64s(rows[i * lanes + at], sum);
        rows[i * lanes + at] = simd.div_f64s(left, divisor);
    }
}

/// `h' row` over the columns for every row `h` of `H`, which `ht` holds by columns.
#[inline(always)]
fn dots<S: Simd>(simd: S, ht: &[f64], columns: &[usize], row: &[f64], out: &mut [f64]) {
    let (ht, out) = (S::as_simd_f64s(ht).0, S::as_mut_simd_f64s(out).0);
    let width = out.len();
    for (a, out) in out.iter_mut().enumerate() {
        let mut sum = simd.splat_f64s(-0.0);
        for (h, &column) in ht.chunks_exact(width).zip(columns) {
            sum = simd.add_f64s(sum, simd.mul_f64s(h[a], simd.splat_f64s(row[column])));
        }
        *out = sum;
    }
}

/// `row = row - k' X` in a range of columns.
#[inline(always)]
fn subtract<S: Simd>(simd: S, row: &mut [f64], k: &[f64], x: &[f64], at: Range<usize>) {
    let lanes = row.len() / S::F64_LANES;
    let (first, row) = (at.start / S::F64_LANES, S::as_mut_simd_f64s(&mut row[at]).0);
    let terms = k.iter().zip(S::as_simd_f64s(x).0.chunks_exact(lanes).map(|x| &x[first..]));
    sums(simd, row, terms, |row, sum| simd.sub_f64s(row, sum));
}

/// `out = put(out, sum of a x)`, some lanes at once, whose sums stay in registers.
#[inline(always)]
fn sums<'a, S: Simd>(
    simd: S,
    out: &mut [S::f64s],
    terms: impl Iterator<Item = (&'a f64, &'a [S::f64s])> + Clone,
    put: impl Fn(S::f64s, S::f64s) -> S::f64s,
) {
    let mut at = 0;
    while at < out.len() {
        at += match out.len() - at {
            1 => strip::<S, 1>(simd, out, at, terms.clone(), &put),
            2 => strip::<S, 2>(simd, out, at, terms.clone(), &put),
            3 | 6 => strip::<S, 3>(simd, out, at, terms.clone(), &put),
            4 | 7 | 8 => strip::<S, 4>(simd, out, at, terms.clone(), &put),
            _ => strip::<S, 5>(simd, out, at, terms.clone(), &put),
        };
    }
}

/// `W` lanes of [`sums`]; returns `W`.
#[inline(always)]
fn strip<'a, S: Simd, const W: usize>(
    simd: S,
    out: &mut [S::f64s],
    at: usize,
    terms: impl Iterator<Item = (&'a f64, &'a [S::f64s])>,
    put: &impl Fn(S::f64s, S::f64s) -> S::f64s,
) -> usize {
    let mut sum = [simd.splat_f64s(-0.0); W];
    for (a, x) in terms {
        let a = simd.splat_f64s(*a);
        if let Some(x) = x.get(at..).and_then(|x| x.first_chunk::<W>()) {
            for (sum, x) in sum.iter_mut().zip(x) {
                *sum = simd.add_f64s(*sum, simd.mul_f64s(a, *x));
            }
        }
    }
    for (out, sum) in out[at..].iter_mut().zip(sum) {
        *out = put(*out, sum);
    }
    W
}
