//! Transition of one step: a sparse pattern, found once, and its products.

use super::carried::Carried;
use super::inputs::Inputs;
use super::kernel::Kernel;
use super::{Covariance, Reach};
use crate::checkpoint::saved;
use crate::state::{Layout, vectorised};
use std::ops::Range;

/// Place of an `R` x `C` block of the transition matrix; a block of a fixed state has no place.
#[derive(Clone, Copy, Debug)]
pub struct PhiSlot<const R: usize, const C: usize>(Option<usize>);

/// Place of the diagonal of a block of the transition matrix.
#[derive(Clone, Copy, Debug)]
pub struct PhiDiagonal<const N: usize>(Option<usize>);

/// Place of an `N` x `N` block on the diagonal of the process noise covariance.
#[derive(Clone, Copy, Debug)]
pub struct NoiseSlot<const N: usize>(Option<usize>);

/// Transition matrix `Phi` and process noise `Q` of one step, which the process models fill in
/// their declared places.
#[derive(Clone, Debug, Default)]
pub struct Transition {
    /// The values of all declared elements of `Phi`, those of a block column by column.
    pub(super) phi: Vec<f64>,
    /// `(row, column)` of each element.
    pub(super) places: Vec<(usize, usize)>,
    /// The values of all declared blocks of `Q`.
    pub(super) q: Vec<f64>,
    /// `(offset in q, first row, dimension)` of each block of `Q`.
    pub(super) noise: Vec<(usize, usize, usize)>,
    /// Offsets of those that make a state uncertain which itself does not move.
    pub(super) doubts: Vec<usize>,
    /// Additional process noise as a share of the models' `q`.
    pub(super) excess: f64,
    /// Blocks with dynamics of their own, one entry per axis.
    pub(super) own: Vec<Own>,
    /// How the steps of a pool carry the noise.
    pub(super) carried: Carried,
    /// Effect of the driving samples.
    pub(super) inputs: Inputs,
    pub(super) kernel: Kernel,
}

saved!(Transition { excess, inputs } each { phi, q, own } except {
    places, noise, doubts, carried, kernel,
});

/// One axis of a block with dynamics of its own.
#[derive(Clone, Debug)]
pub(super) struct Own {
    pub(super) row: usize,
    /// Index of its decay in `Transition::phi`.
    phi: Option<usize>,
    pub(super) q: f64,
}

saved!(Own { q } except { row, phi });

impl Own {
    /// The axis with its noise alone.
    pub(super) fn without_decay(&self) -> Self {
        Self { row: self.row, phi: None, q: 0.0 }
    }
}

impl Transition {
    /// Declares a block of `Phi` with rows of `row` and columns of `column` (first tangent index,
    /// `None` when fixed).
    pub fn phi<const R: usize, const C: usize>(
        &mut self,
        row: Option<usize>,
        column: Option<usize>,
    ) -> PhiSlot<R, C> {
        PhiSlot(row.zip(column).map(|(r, c)| self.phi_block(r..r + R, c..c + C)))
    }

    /// Declares a block of `Phi` of any size, column by column; returns the place of its first
    /// element.
    pub(crate) fn phi_block(&mut self, rows: Range<usize>, columns: Range<usize>) -> usize {
        let at = self.phi.len();
        self.places.extend(columns.flat_map(|c| rows.clone().map(move |r| (r, c))));
        self.phi.resize(self.places.len(), 0.0);
        at
    }

    /// Declares the diagonal of a block of `Phi`.
    pub fn phi_diagonal<const N: usize>(
        &mut self,
        row: Option<usize>,
        column: Option<usize>,
    ) -> PhiDiagonal<N> {
        PhiDiagonal(row.zip(column).map(|(r, c)| {
            let at = self.phi.len();
            self.places.extend((0..N).map(|k| (r + k, c + k)));
            self.phi.resize(at + N, 0.0);
            at
        }))
    }

    /// Declares a block on the diagonal of `Q`.
    pub fn noise<const N: usize>(&mut self, row: Option<usize>) -> NoiseSlot<N> {
        NoiseSlot(row.map(|r| self.noise_block(r, N)))
    }

    /// As [`Self::noise`], for the uncertainty of states that do not move themselves.
    pub(crate) fn doubt<const N: usize>(&mut self, row: usize) -> NoiseSlot<N> {
        let at = self.noise_block(row, N);
        self.doubts.push(at);
        NoiseSlot(Some(at))
    }

    /// Declares a square block of any size on the diagonal of `Q`; returns the place of its first
    /// element.
    pub(crate) fn noise_block(&mut self, row: usize, size: usize) -> usize {
        let at = self.q.len();
        self.noise.push((at, row, size));
        self.q.resize(at + size * size, 0.0);
        at
    }

    /// The elements of `Phi` from a place on.
    pub(crate) fn phi_from(&mut self, at: usize) -> &mut [f64] {
        &mut self.phi[at..]
    }

    /// The elements of `Q` from a place on.
    pub(crate) fn noise_from(&mut self, at: usize) -> &mut [f64] {
        &mut self.q[at..]
    }

    /// Transition that gives the error states of `rows` the errors `phi` of `columns` (row-major)
    /// and the noise `q`, and keeps all others.
    pub(crate) fn replacing(
        layout: &Layout,
        rows: Range<usize>,
        columns: &[usize],
        phi: &[f64],
        q: &nalgebra::DMatrix<f64>,
    ) -> Self {
        let mut transition = Self::default();
        for (row, phi) in rows.clone().zip(phi.chunks_exact(columns.len().max(1))) {
            transition.places.extend(columns.iter().map(|column| (row, *column)));
            transition.phi.extend_from_slice(phi);
        }
        if columns.is_empty() {
            // an element of zero makes the row differ from the identity
            transition.places.extend(rows.clone().map(|row| (row, row)));
            transition.phi.resize(rows.len(), 0.0);
        }
        transition.noise.push((0, rows.start, rows.len()));
        transition.q.extend_from_slice(q.as_slice());
        transition.compile(layout);
        transition
    }

    /// Writes a block of `Phi`.
    #[inline]
    pub fn set<const R: usize, const C: usize>(
        &mut self,
        slot: PhiSlot<R, C>,
        block: &nalgebra::SMatrix<f64, R, C>,
    ) {
        if let Some(at) = slot.0 {
            self.phi[at..at + R * C].copy_from_slice(block.as_slice());
        }
    }

    /// Writes the diagonal of a block of `Phi`.
    #[inline]
    pub fn set_diagonal<const N: usize>(&mut self, slot: PhiDiagonal<N>, diagonal: &[f64; N]) {
        if let Some(at) = slot.0 {
            self.phi[at..at + N].copy_from_slice(diagonal);
        }
    }

    /// Writes a block of `Q`, symmetric.
    #[inline]
    pub fn set_noise<const N: usize>(
        &mut self,
        slot: NoiseSlot<N>,
        q: &nalgebra::SMatrix<f64, N, N>,
    ) {
        if let Some(at) = slot.0 {
            self.q[at..at + N * N].copy_from_slice(q.as_slice());
        }
    }

    /// Declares the axes of a block with dynamics of its own, with or without a decay; returns the
    /// index of the first.
    pub(crate) fn own_block(&mut self, row: usize, axes: usize, decays: bool) -> usize {
        let first = self.own.len();
        for k in row..row + axes {
            let phi = decays.then(|| {
                self.places.push((k, k));
                self.phi.push(1.0);
                self.phi.len() - 1
            });
            self.own.push(Own { row: k, phi, q: 0.0 });
        }
        first
    }

    /// Sets the decay and the process noise variance of axis `k` of the block that begins at
    /// `first`.
    pub(crate) fn set_own(&mut self, first: usize, k: usize, decay: Option<f64>, q: f64) {
        let own = &mut self.own[first + k];
        own.q = q;
        if let Some((at, decay)) = own.phi.zip(decay) {
            self.phi[at] = decay;
        }
    }

    /// Orders the pattern for the kernel. Call once, after every place is declared.
    pub fn compile(&mut self, layout: &Layout) {
        self.kernel = Kernel::new(layout.tangent, &self.places);
    }

    /// `P = Phi P Phi' + Q`, without allocation.
    pub fn propagate(&mut self, covariance: &mut Covariance) {
        self.add_early_noise(covariance);
        self.kernel.propagate(&self.phi, covariance);
        self.add_noise(covariance);
    }

    /// `G = Phi G` with the `Phi` of the last [`Self::propagate`]. `G` is row-major with rows of
    /// `stride`, a multiple of four; `work` is its work space, which grows once.
    pub fn carry(&self, g: &mut [f64], stride: usize, work: &mut Vec<f64>) {
        self.kernel.carry(&self.phi, g, stride, work);
    }

    /// Carries the reaches of sensors over the last step, as [`Self::carry`] does.
    pub(crate) fn carry_reaches<'a>(&mut self, reaches: impl Iterator<Item = &'a mut Reach>) {
        for reach in reaches.filter(|reach| !reach.is_empty()) {
            let mut work = std::mem::take(&mut self.kernel.carried);
            self.carry(&mut reach.g, reach.stride, &mut work);
            self.kernel.carried = work;
        }
    }

    /// Returns `true` if the transition is a copy of the other one, but for its step.
    pub fn has_places_of(&self, other: &Self) -> bool {
        std::sync::Arc::ptr_eq(self.kernel.rows(), other.kernel.rows())
    }

    /// Adds the numbers of the last step to `out`.
    pub(crate) fn write_step(&self, out: &mut Vec<f64>) {
        out.extend([self.excess, self.carried.early]);
        out.extend_from_slice(&self.phi);
        out.extend_from_slice(&self.q);
        out.extend(self.own.iter().map(|own| own.q));
        out.extend_from_slice(&self.carried.values);
    }

    /// Takes the step of a transition with the same places off the numbers.
    pub(crate) fn read_step(&mut self, numbers: &mut &[f64]) {
        let Self { excess, phi, q, own, carried: Carried { early, values, .. }, .. } = self;
        let mut read = |to: &mut [f64]| {
            let (step, rest) = numbers.split_at(to.len());
            to.copy_from_slice(step);
            *numbers = rest;
        };
        [std::slice::from_mut(excess), std::slice::from_mut(early), phi, q]
            .into_iter()
            .for_each(&mut read);
        own.iter_mut().for_each(|own| read(std::slice::from_mut(&mut own.q)));
        read(values);
    }

    /// The share of the identity in each element of `Phi`, in the order of [`Self::places`].
    pub(crate) fn identity(&self) -> Vec<f64> {
        let places = self.places.iter().enumerate();
        let first = |n: usize, place| !self.places[..n].contains(place);
        places.map(|(n, place)| f64::from(place.0 == place.1 && first(n, place))).collect()
    }

    /// `(row, column)` of each element of `Phi`, in the order of [`Self::add_to`].
    pub(crate) fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    /// Returns `true` if a value of the noise makes a state uncertain which itself does not move.
    pub(super) fn doubts(&self, value: usize) -> bool {
        let block =
            |&&(at, _, size): &&(usize, usize, usize)| (at..at + size * size).contains(&value);
        self.noise.iter().find(block).is_some_and(|(at, ..)| self.doubts.contains(at))
    }

    /// Returns `true` if a process fills a row in this range.
    pub fn moves(&self, rows: &Range<usize>) -> bool {
        self.places.iter().any(|p| rows.contains(&p.0))
            || self.noise.iter().any(|n| rows.contains(&n.1) && !self.doubts.contains(&n.0))
    }

    /// Adds the elements of the last step's `Phi` to `sum`, as far as `sum` goes.
    pub(crate) fn add_to(&self, sum: &mut [f64]) {
        vectorised(
            (sum, &self.phi),
            #[inline(always)]
            |(sum, phi): (&mut [f64], &Vec<f64>)| {
                sum.iter_mut().zip(phi).for_each(|(sum, phi)| *sum += phi);
            },
        );
    }

    /// Approximate size, bytes.
    pub(crate) fn size(&self) -> usize {
        let numbers = self.phi.len() + self.q.len();
        numbers * size_of::<f64>()
            + self.places.len() * size_of::<[usize; 4]>()
            + self.kernel.size()
    }

    /// Multiplies the standard deviation of the models' process noise by `factor`.
    pub fn scale_noise(&mut self, factor: f64) {
        self.excess = factor * factor - 1.0;
    }

    /// Declared elements of `Phi`, as row, column and value. A row without declared elements is
    /// that of the identity.
    pub fn elements(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        self.places.iter().zip(&self.phi).map(|(&(i, j), &value)| (i, j, value))
    }

    /// `Phi` as a dense matrix: the identity, except in the rows with declared elements.
    pub fn phi_dense(&self, n: usize) -> nalgebra::DMatrix<f64> {
        let mut phi = nalgebra::DMatrix::identity(n, n);
        for &row in self.kernel.rows().iter() {
            phi[(row, row)] = 0.0;
        }
        self.elements().for_each(|(i, j, value)| phi[(i, j)] += value);
        phi
    }
}
