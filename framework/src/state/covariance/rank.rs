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
            sums(simd, hp, terms);
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

    /// Joseph's form: `A = P - K (H P)`, then `A - (A H' - K R) K'`.
    #[inline(always)]
    fn join<S: Simd>(&mut self, simd: S, covariance: &mut Covariance) {
        let (n, m, stride) = (covariance.n, self.m, covariance.stride);
        let Self { columns, ht, r, hp, kt, work, reached, .. } = self;
        let wide = m.next_multiple_of(LANES);
        // R, K and A H' - K R, with padded rows
        work.resize((m + 2 * n) * wide, 0.0);
        let (rt, rest) = work.split_at_mut(m * wide);
        let (k, d) = rest.split_at_mut(n * wide);
        rt.fill(0.0);
        for (to, from) in rt.chunks_exact_mut(wide.max(1)).zip(r.chunks_exact(m.max(1))) {
            to[..m].copy_from_slice(from);
        }
        for (a, kt) in kt.chunks_exact(stride).enumerate() {
            k.chunks_exact_mut(wide).zip(kt).for_each(|(k, kt)| k[a] = *kt);
        }
        subtract(simd, covariance, k, m, hp, reached);
        for i in rows(reached, n) {
            let at = i * wide..i * wide + wide;
            let (k, d) = (&k[at.clone()], &mut d[at]);
            dots(simd, ht, columns, &covariance.p[i * stride..][..stride], d);
            let (d, rt) = (S::as_mut_simd_f64s(d).0, S::as_simd_f64s(rt).0);
            for (k, rt) in k[..m].iter().zip(rt.chunks_exact(d.len().max(1))) {
                let k = simd.splat_f64s(*k);
                for (d, r) in d.iter_mut().zip(rt) {
                    *d = simd.sub_f64s(*d, simd.mul_f64s(k, *r));
                }
            }
        }
        subtract(simd, covariance, d, m, kt, reached);
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
    let (pairs, last) = columns.as_chunks::<2>();
    // two sums, so that one is added to while the other waits
    if let [out] = out {
        let (mut even, mut odd) = (simd.splat_f64s(-0.0), simd.splat_f64s(-0.0));
        let (of_pairs, of_last) = ht.as_chunks::<2>();
        for ([i, j], [of_i, of_j]) in pairs.iter().zip(of_pairs) {
            even = simd.add_f64s(even, simd.mul_f64s(*of_i, simd.splat_f64s(row[*i])));
            odd = simd.add_f64s(odd, simd.mul_f64s(*of_j, simd.splat_f64s(row[*j])));
        }
        for (column, h) in last.iter().zip(of_last) {
            even = simd.add_f64s(even, simd.mul_f64s(*h, simd.splat_f64s(row[*column])));
        }
        *out = simd.add_f64s(even, odd);
        return;
    }
    let width = out.len();
    for (a, out) in out.iter_mut().enumerate() {
        let term = |k: usize, column: usize| {
            simd.mul_f64s(ht[k * width + a], simd.splat_f64s(row[column]))
        };
        let (mut even, mut odd) = (simd.splat_f64s(-0.0), simd.splat_f64s(-0.0));
        for (k, &[i, j]) in pairs.iter().enumerate() {
            even = simd.add_f64s(even, term(2 * k, i));
            odd = simd.add_f64s(odd, term(2 * k + 1, j));
        }
        for &column in last {
            even = simd.add_f64s(even, term(columns.len() - 1, column));
        }
        *out = simd.add_f64s(even, odd);
    }
}

/// The rows of `n` in these ranges, whose end may be padding.
#[inline(always)]
fn rows(reached: &[Range<usize>], n: usize) -> impl Iterator<Item = usize> {
    reached.iter().cloned().flatten().take_while(move |i| *i < n)
}

/// `P = P - C X` where these ranges of rows and columns meet; `C` has `m` columns and padded rows.
#[inline(always)]
fn subtract<S: Simd>(
    simd: S,
    covariance: &mut Covariance,
    c: &[f64],
    m: usize,
    x: &[f64],
    reached: &[Range<usize>],
) {
    let stride = covariance.stride;
    for columns in reached {
        let x = |a: usize| S::as_simd_f64s(&x[a * stride..][columns.clone()]).0;
        for a in (0..m).step_by(LANES) {
            let (c, wide) = (&c[a..], m.next_multiple_of(LANES));
            match m - a {
                1 => less(simd, covariance, c, wide, [x(a)], reached, columns),
                2 => less(simd, covariance, c, wide, [x(a), x(a + 1)], reached, columns),
                3 => less(simd, covariance, c, wide, [a, a + 1, a + 2].map(x), reached, columns),
                _ => {
                    let x = [a, a + 1, a + 2, a + 3].map(x);
                    less(simd, covariance, c, wide, x, reached, columns);
                }
            }
        }
    }
}

/// `P = P - C X` with `M` columns of `C`, in these columns of `P`.
#[inline(always)]
fn less<S: Simd, const M: usize>(
    simd: S,
    covariance: &mut Covariance,
    c: &[f64],
    wide: usize,
    x: [&[S::f64s]; M],
    reached: &[Range<usize>],
    columns: &Range<usize>,
) {
    let (n, stride) = (covariance.n, covariance.stride);
    for run in reached {
        let all =
            covariance.p[run.start * stride..n.min(run.end) * stride].chunks_exact_mut(stride);
        // the last row of `c` may lack what is before its first column
        let factors = c[run.start * wide..].chunks(wide);
        for (row, c) in all.zip(factors) {
            let row = S::as_mut_simd_f64s(&mut row[columns.clone()]).0;
            let Some(c) = c.first_chunk::<M>() else { continue };
            let mut by = [simd.splat_f64s(0.0); M];
            by.iter_mut().zip(c).for_each(|(by, c)| *by = simd.splat_f64s(*c));
            for (at, row) in row.iter_mut().enumerate() {
                let mut sum = simd.mul_f64s(by[0], x[0][at]);
                for (by, x) in by[1..].iter().zip(&x[1..]) {
                    sum = simd.add_f64s(sum, simd.mul_f64s(*by, x[at]));
                }
                *row = simd.sub_f64s(*row, sum);
            }
        }
    }
}

/// `out = sum of a x`, some lanes at once, whose sums stay in registers.
#[inline(always)]
fn sums<'a, S: Simd>(
    simd: S,
    out: &mut [S::f64s],
    terms: impl Iterator<Item = (&'a f64, &'a [S::f64s])> + Clone,
) {
    let mut at = 0;
    while at < out.len() {
        at += match out.len() - at {
            1 => strip::<S, 1>(simd, out, at, terms.clone()),
            2 => strip::<S, 2>(simd, out, at, terms.clone()),
            3 | 6 => strip::<S, 3>(simd, out, at, terms.clone()),
            4 | 7 | 8 => strip::<S, 4>(simd, out, at, terms.clone()),
            _ => strip::<S, 5>(simd, out, at, terms.clone()),
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
    out[at..][..W].copy_from_slice(&sum);
    W
}
