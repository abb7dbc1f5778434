//! The kernel of the propagation: products of the sparse rows of `Phi` with rows of the covariance.
//!
//! The covariance is passed over in *lanes* of four columns and tiles of four by four. The rows of
//! `Phi` that differ from the identity are taken in bands of three, since most blocks of an error
//! state have three axes, and a group of four rows with a changed one counts as changed.
//!
//! The loops are written once and compiled twice: for any processor of the target, and for one with
//! AVX2. The program chooses when it starts. Both versions add and multiply in the same order and
//! never fuse the two, so that their results agree to the bit.

use super::Covariance;
use super::aligned::Aligned;
use super::bands::{Bands, Product};
use super::decay::{Decay, Decays};
use super::lanes::{Lane, Lanes, mirrored, put, tile, turned, with_lanes};
use crate::units::sample::MAX_CHANNELS;
use pulp::{Arch, Simd, WithSimd};
use std::sync::Arc;

/// The pattern of `Phi` in the kernel's order, and its work space.
#[derive(Clone, Debug, Default)]
pub(super) struct Kernel {
    /// Rows of `Phi` that differ from the identity, ascending. All copies share them.
    rows: Arc<[usize]>,
    /// Groups of four rows of which one differs from the identity, but for its decay, and all
    /// others.
    groups: Vec<usize>,
    kept: Vec<usize>,
    bands: Bands,
    decays: Decays,
    x: Aligned,
    xt: Aligned,
    y: Aligned,
    pub(super) carried: Vec<f64>,
    pub(super) processor: Arch,
}

/// A propagation on the instructions that the processor has.
struct Propagation<'a, const L: usize, const ANY: bool> {
    kernel: &'a mut Kernel,
    lanes: Lanes<L, ANY>,
    phi: &'a [f64],
    p: &'a mut [Lane],
}

impl<const L: usize, const ANY: bool> WithSimd for Propagation<'_, L, ANY> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { kernel, lanes, phi, p } = self;
        let Kernel { groups, kept, bands, x, xt, y, .. } = kernel;
        let (x, xt, y) = (x.as_chunks_mut().0, xt.as_chunks_mut().0, y.as_chunks_mut().0);
        // X = A P, with A the changed rows of Phi
        simd.vectorize(Product { bands, phi, x: p, lanes, out: x, lower: false });
        let n = lanes.count();
        for &group in &*groups {
            for &column in &*groups {
                put(xt, n, column, group, turned(simd, tile(x, n, group, column)));
            }
            for &column in &*kept {
                let tile = tile(x, n, group, column);
                put(p, n, group, column, tile);
                let tile = turned(simd, tile);
                put(xt, n, column, group, tile);
                put(p, n, column, group, tile);
            }
        }
        // Y = A X', the elements of P where changed rows and columns meet: it is symmetric but for
        // rounding, and the elements left of the diagonal count
        simd.vectorize(Product { bands, phi, x: xt, lanes, out: y, lower: true });
        for (at, &row) in groups.iter().enumerate() {
            for &column in &groups[..=at] {
                let tile = tile(y, n, row, column);
                if row == column {
                    put(p, n, row, row, mirrored(simd, tile));
                } else {
                    put(p, n, row, column, tile);
                    put(p, n, column, row, turned(simd, tile));
                }
            }
        }
    }
}

impl Kernel {
    /// Orders the `(row, column)` of each element of `Phi` for an error state of dimension `n`.
    pub(super) fn new(n: usize, places: &[(usize, usize)]) -> Self {
        let mut rows: Vec<usize> = places.iter().map(|p| p.0).collect();
        rows.sort_unstable();
        rows.dedup();
        let lanes = n.max(1).div_ceil(4);
        let decays = Decays::new(lanes, places);
        let product = rows.iter().filter(|row| !decays.contains(**row));
        let mut groups: Vec<usize> = product.map(|row| row / 4).collect();
        groups.dedup();
        let square = || Aligned::zeros(16 * lanes * lanes);
        Self {
            kept: (0..lanes).filter(|group| groups.binary_search(group).is_err()).collect(),
            x: square(),
            xt: square(),
            y: square(),
            carried: Vec::with_capacity(4 * lanes * MAX_CHANNELS.next_multiple_of(4)),
            processor: Arch::new(),
            bands: Bands::new(&groups, places, |row| decays.contains(row)),
            decays,
            groups,
            rows: rows.into(),
        }
    }

    /// Rows of `Phi` that differ from the identity, ascending.
    pub(super) fn rows(&self) -> &Arc<[usize]> {
        &self.rows
    }

    /// Approximate size, bytes.
    pub(super) fn size(&self) -> usize {
        (self.x.len() + self.xt.len() + self.y.len()) * size_of::<f64>()
            + self.bands.size()
            + self.decays.size()
    }

    /// `P = Phi P Phi'`, without allocation.
    pub(super) fn propagate(&mut self, phi: &[f64], covariance: &mut Covariance) {
        with_lanes!(covariance.stride / 4, self.propagate_rows(phi, covariance));
    }

    fn propagate_rows<const L: usize, const ANY: bool>(
        &mut self,
        lanes: Lanes<L, ANY>,
        phi: &[f64],
        covariance: &mut Covariance,
    ) {
        let p = covariance.p.as_chunks_mut().0;
        self.processor.dispatch(Propagation { kernel: self, lanes, phi, p });
        if !self.decays.is_empty() {
            self.processor.dispatch(Decay { decays: &mut self.decays, phi, p });
        }
    }

    /// `G = Phi G`: see [`super::Transition::carry`].
    pub(super) fn carry(&self, phi: &[f64], g: &mut [f64], stride: usize, work: &mut Vec<f64>) {
        let rows = self.groups.last().map_or(0, |group| 4 * group + 4);
        work.resize(rows * stride, 0.0);
        with_lanes!(stride / 4, self.carry_rows(phi, g, work));
        // the product keeps the rows of a group that are those of the identity
        for &group in &self.groups {
            let (to, from) = (&mut g[4 * group * stride..], &work[4 * group * stride..]);
            let length = to.len().min(4 * stride);
            to[..length].copy_from_slice(&from[..length]);
        }
        self.decays.scale(phi, g, stride);
    }

    fn carry_rows<const L: usize, const ANY: bool>(
        &self,
        lanes: Lanes<L, ANY>,
        phi: &[f64],
        g: &[f64],
        work: &mut [f64],
    ) {
        let (x, out) = (g.as_chunks().0, work.as_chunks_mut().0);
        let product = Product { bands: &self.bands, phi, x, lanes, out, lower: false };
        self.processor.dispatch(product);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_is_the_same_to_the_bit_whether_its_rows_are_known_or_not() {
        for n in 1..=36 {
            let numbers = |seed: usize| {
                let next = move |k: usize| (((k + seed) * 7919) % 1009) as f64 / 1009.0 - 0.5;
                (0..).map(next)
            };
            // a block where there is room for it, and elements all over
            let block = (0..9).map(|k| (k % 3, k / 3 + 3)).filter(|place| n >= 6 || place.1 < n);
            let others = (0..2 * n).map(|k| ((k * 5) % n, (k * 3 + 1) % n));
            let places: Vec<(usize, usize)> = block.filter(|p| p.0 < n).chain(others).collect();
            let phi: Vec<f64> = numbers(0).take(places.len()).collect();
            let mut kernel = Kernel::new(n, &places);
            let mut known = Covariance::zero(n);
            for (k, value) in numbers(n).take(n * n).enumerate() {
                known.set(k / n, k % n, value);
            }
            let mut any = known.clone();
            kernel.propagate(&phi, &mut known);
            kernel.propagate_rows(Lanes::<1, true>(n.div_ceil(4)), &phi, &mut any);
            assert_eq!(known, any, "{n} states");
        }
    }
}
