//! The kernel of the propagation: products of the sparse rows of `Phi` with rows of the covariance.
//!
//! The loops are written once and compiled twice: for any processor of the target, and for one with
//! AVX2. The program chooses when it starts. Both versions add and multiply in the same order and
//! never fuse the two, so that their results agree to the bit.

use super::Covariance;
use crate::units::sample::MAX_CHANNELS;
use pulp::{Arch, Simd, WithSimd};
use std::sync::Arc;

/// The pattern of `Phi` in the kernel's order, and its work space.
#[derive(Clone, Debug, Default)]
pub(super) struct Kernel {
    /// Rows of `Phi` that differ from the identity, ascending. All copies share them.
    rows: Arc<[usize]>,
    /// Consecutive rows of these.
    runs: Vec<Run>,
    /// Rows of the identity.
    identity: Vec<usize>,
    /// Number of changed rows, rounded up to a multiple of four.
    width: usize,
    /// Declared elements of the changed rows, row by row.
    declared: Terms,
    /// Those of them that are not zero in this step.
    terms: Terms,
    /// Which values of `Phi` these are: true for a value that is not zero.
    nonzero: Vec<bool>,
    x: Vec<f64>,
    xt: Vec<f64>,
    y: Vec<f64>,
    pub(super) carried: Vec<f64>,
    pub(super) processor: Arch,
}

/// Consecutive changed rows.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// The first of the rows.
    row: usize,
    /// Its index among the changed rows.
    at: usize,
    length: usize,
}

/// Elements of the changed rows of `Phi`, row by row.
#[derive(Clone, Debug, Default)]
struct Terms {
    /// End of each row's elements.
    ends: Vec<usize>,
    /// Column of each element, and the index of its value.
    elements: Vec<(usize, usize)>,
}

/// A propagation on the instructions that the processor has.
struct Propagation<'a> {
    kernel: &'a mut Kernel,
    phi: &'a [f64],
    covariance: &'a mut Covariance,
}

impl WithSimd for Propagation<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.kernel.product_with(self.phi, self.covariance);
    }
}

/// A product with the rows of a matrix on the instructions that the processor has.
struct Carry<'a> {
    kernel: &'a Kernel,
    phi: &'a [f64],
    g: &'a [f64],
    stride: usize,
    out: &'a mut [f64],
}

impl WithSimd for Carry<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.kernel.terms.product(self.phi, self.g, self.stride, self.out, false);
    }
}

impl Kernel {
    /// Orders the `(row, column)` of each element of `Phi` for an error state of dimension `n`.
    pub(super) fn new(n: usize, places: &[(usize, usize)]) -> Self {
        let mut rows: Vec<usize> = places.iter().map(|p| p.0).collect();
        rows.sort_unstable();
        rows.dedup();
        let mut declared = Terms::default();
        let mut runs: Vec<Run> = Vec::new();
        for (at, &row) in rows.iter().enumerate() {
            let mut elements: Vec<(usize, usize)> = (places.iter().enumerate())
                .filter(|(_, p)| p.0 == row)
                .map(|(value, p)| (p.1, value))
                .collect();
            elements.sort_unstable();
            declared.elements.extend(elements);
            declared.ends.push(declared.elements.len());
            match runs.last_mut() {
                Some(run) if run.row + run.length == row => run.length += 1,
                _ => runs.push(Run { row, at, length: 1 }),
            }
        }
        let (stride, width) = (n.max(1).next_multiple_of(4), rows.len().max(1).next_multiple_of(4));
        Self {
            identity: (0..n).filter(|row| rows.binary_search(row).is_err()).collect(),
            width,
            terms: Terms {
                ends: Vec::with_capacity(declared.ends.len()),
                elements: Vec::with_capacity(declared.elements.len()),
            },
            nonzero: Vec::with_capacity(places.len()),
            x: vec![0.0; width * stride],
            xt: vec![0.0; stride * width],
            y: vec![0.0; rows.len() * width],
            carried: Vec::with_capacity(rows.len() * MAX_CHANNELS.next_multiple_of(4)),
            processor: Arch::new(),
            rows: rows.into(),
            runs,
            declared,
        }
    }

    /// Rows of `Phi` that differ from the identity, ascending.
    pub(super) fn rows(&self) -> &Arc<[usize]> {
        &self.rows
    }

    /// Approximate size, bytes.
    pub(super) fn size(&self) -> usize {
        (self.x.len() + self.xt.len() + self.y.len()) * size_of::<f64>()
            + self.declared.elements.len() * 2 * size_of::<(usize, usize)>()
    }

    /// `P = Phi P Phi'`, without allocation.
    pub(super) fn propagate(&mut self, phi: &[f64], covariance: &mut Covariance) {
        self.processor.dispatch(Propagation { kernel: self, phi, covariance });
    }

    #[inline(always)]
    fn product_with(&mut self, phi: &[f64], covariance: &mut Covariance) {
        self.skip_zeros(phi);
        let Self { rows, runs, identity, terms, x, xt, y, .. } = self;
        let (width, stride, p) = (self.width, covariance.stride, &mut covariance.p);
        // X = A P, with A the changed rows of Phi
        terms.product(phi, p, stride, x, false);
        transpose(x, stride, xt, width);
        // Y = A X', the elements of P where changed rows and columns meet; Y is symmetric, so its
        // upper half is enough
        terms.product(phi, xt, width, y, true);
        for &Run { row, at, length } in &*runs {
            p[row * stride..][..length * stride]
                .copy_from_slice(&x[at * stride..][..length * stride]);
        }
        for &row in &*identity {
            let (to, from) = (&mut p[row * stride..][..stride], &xt[row * width..][..width]);
            for &Run { row, at, length } in &*runs {
                copy(&mut to[row..row + length], &from[at..at + length]);
            }
        }
        for (k, (&row, y)) in rows.iter().zip(y.chunks_exact(width)).enumerate() {
            for (&column, v) in rows.iter().zip(y).skip(k) {
                p[row * stride + column] = *v;
                p[column * stride + row] = *v;
            }
        }
    }

    /// Finds the elements of `Phi` that are not zero, unless they are those of the step before.
    #[inline(always)]
    fn skip_zeros(&mut self, phi: &[f64]) {
        let mut same = self.nonzero.len() == phi.len();
        for (value, nonzero) in phi.iter().zip(&self.nonzero) {
            same &= (*value != 0.0) == *nonzero;
        }
        if !same {
            self.find_nonzero(phi);
        }
    }

    #[cold]
    fn find_nonzero(&mut self, phi: &[f64]) {
        self.nonzero.clear();
        self.nonzero.extend(phi.iter().map(|value| *value != 0.0));
        self.terms.ends.clear();
        self.terms.elements.clear();
        let mut start = 0;
        for &end in &self.declared.ends {
            let row = self.declared.elements[start..end].iter();
            self.terms.elements.extend(row.filter(|(_, value)| self.nonzero[*value]).copied());
            self.terms.ends.push(self.terms.elements.len());
            start = end;
        }
    }

    /// `G = Phi G` with the `Phi` of the last [`Self::propagate`]: see
    /// [`super::Transition::carry`].
    pub(super) fn carry(&self, phi: &[f64], g: &mut [f64], stride: usize, work: &mut Vec<f64>) {
        work.resize(self.rows.len() * stride, 0.0);
        let carry = Carry { kernel: self, phi, g, stride, out: &mut work[..] };
        self.processor.dispatch(carry);
        for (row, new) in self.rows.iter().zip(work.chunks_exact(stride)) {
            g[row * stride..][..stride].copy_from_slice(new);
        }
    }
}

impl Terms {
    /// `out = A x`, with `x` and `out` row-major and rows of `stride`, a multiple of four. For a
    /// symmetric result (`half`) only the part right of the diagonal is computed, in groups of
    /// four.
    #[inline(always)]
    fn product(&self, phi: &[f64], x: &[f64], stride: usize, out: &mut [f64], half: bool) {
        let mut start = 0;
        for (k, (&end, row)) in self.ends.iter().zip(out.chunks_exact_mut(stride)).enumerate() {
            let terms = &self.elements[start..end];
            let mut at = if half { k / 4 * 4 } else { 0 };
            // as many columns at once as fit into the registers
            while at < stride {
                at += match stride - at {
                    4 => accumulate::<4>(terms, phi, x, stride, at, row),
                    8 => accumulate::<8>(terms, phi, x, stride, at, row),
                    12 => accumulate::<12>(terms, phi, x, stride, at, row),
                    16 => accumulate::<16>(terms, phi, x, stride, at, row),
                    _ => accumulate::<20>(terms, phi, x, stride, at, row),
                };
            }
            start = end;
        }
    }
}

/// `W` columns of one row of the product, kept in registers.
#[inline(always)]
fn accumulate<const W: usize>(
    terms: &[(usize, usize)],
    phi: &[f64],
    x: &[f64],
    stride: usize,
    at: usize,
    row: &mut [f64],
) -> usize {
    let mut sum = [0.0; W];
    for &(column, value) in terms {
        if let Some(x) = x[column * stride + at..].first_chunk::<W>() {
            let a = phi[value];
            for (s, x) in sum.iter_mut().zip(x) {
                *s += a * x;
            }
        }
    }
    row[at..at + W].copy_from_slice(&sum);
    W
}

/// `xt = x'` in tiles of four by four, for rows of `stride` and `width`, multiples of four.
#[inline(always)]
fn transpose(x: &[f64], stride: usize, xt: &mut [f64], width: usize) {
    let tiles = stride / 4;
    for (k, rows) in x.chunks_exact(4 * stride).enumerate() {
        let (rows, _) = rows.as_chunks::<4>();
        for j in 0..tiles {
            let [a, b, c, d] = [rows[j], rows[tiles + j], rows[2 * tiles + j], rows[3 * tiles + j]];
            for i in 0..4 {
                let to = &mut xt[(4 * j + i) * width + 4 * k..][..4];
                to.copy_from_slice(&[a[i], b[i], c[i], d[i]]);
            }
        }
    }
}

/// Copies few elements without a call.
#[inline(always)]
fn copy(to: &mut [f64], from: &[f64]) {
    let (to, last_to) = to.as_chunks_mut::<4>();
    let (from, last_from) = from.as_chunks::<4>();
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
    for (to, from) in last_to.iter_mut().zip(last_from) {
        *to = *from;
    }
}
