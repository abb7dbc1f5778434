//! Transition of one step: a sparse pattern, found once, and its products.

use super::{Covariance, Reach};
use crate::state::Layout;
use crate::units::sample::MAX_CHANNELS;

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
    /// The values of all declared elements of `Phi`.
    phi: Vec<f64>,
    /// `(row, column)` of each element.
    places: Vec<(usize, usize)>,
    /// The values of all declared blocks of `Q`.
    q: Vec<f64>,
    /// `(offset in q, first row, dimension)` of each block of `Q`.
    noise: Vec<(usize, usize, usize)>,
    /// Additional process noise as a share of the models' `q`.
    excess: f64,
    /// Blocks with dynamics of their own, one entry per axis.
    own: Vec<Own>,
    compiled: Compiled,
}

/// One axis of a block with dynamics of its own.
#[derive(Clone, Debug)]
struct Own {
    row: usize,
    /// Index of its decay in `Transition::phi`.
    phi: Option<usize>,
    q: f64,
}

/// The pattern in the kernel's order, and its work space.
#[derive(Clone, Debug, Default)]
struct Compiled {
    /// Rows of `Phi` that differ from the identity, ascending.
    rows: Vec<usize>,
    /// Number of these rows, rounded up to a multiple of four.
    width: usize,
    /// End of each row's entries.
    ends: Vec<usize>,
    /// Column of each entry, and the index of its value in `Transition::phi`.
    entries: Vec<(usize, usize)>,
    /// Index in `rows` of each element of the error state; `None` if its row is not there.
    position: Vec<Option<usize>>,
    terms: Terms,
    x: Vec<f64>,
    xt: Vec<f64>,
    y: Vec<f64>,
    carried: Vec<f64>,
}

/// Nonzero elements of the changed rows of `Phi` in this step, row by row.
#[derive(Clone, Debug, Default)]
struct Terms {
    ends: Vec<usize>,
    columns: Vec<(usize, f64)>,
}

impl Transition {
    /// Declares a block of `Phi` with rows of `row` and columns of `column` (first tangent index,
    /// `None` when fixed).
    pub fn phi<const R: usize, const C: usize>(
        &mut self,
        row: Option<usize>,
        column: Option<usize>,
    ) -> PhiSlot<R, C> {
        PhiSlot(row.zip(column).map(|(r, c)| {
            let at = self.phi.len();
            self.places.extend((0..R * C).map(|k| (r + k / C, c + k % C)));
            self.phi.resize(at + R * C, 0.0);
            at
        }))
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
        NoiseSlot(row.map(|r| {
            let at = self.q.len();
            self.noise.push((at, r, N));
            self.q.resize(at + N * N, 0.0);
            at
        }))
    }

    /// Writes a block of `Phi`.
    #[inline]
    pub fn set<const R: usize, const C: usize>(
        &mut self,
        slot: PhiSlot<R, C>,
        block: &nalgebra::SMatrix<f64, R, C>,
    ) {
        if let Some(at) = slot.0 {
            let out = &mut self.phi[at..at + R * C];
            for i in 0..R {
                for j in 0..C {
                    out[i * C + j] = block[(i, j)];
                }
            }
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
        let n = layout.tangent;
        let mut rows: Vec<usize> = self.places.iter().map(|p| p.0).collect();
        rows.sort_unstable();
        rows.dedup();
        let mut c = Compiled { position: vec![None; n], ..Compiled::default() };
        for (k, &row) in rows.iter().enumerate() {
            c.position[row] = Some(k);
            let mut entries: Vec<(usize, usize)> = (self.places.iter().enumerate())
                .filter(|(_, p)| p.0 == row)
                .map(|(at, p)| (p.1, at))
                .collect();
            entries.sort_unstable();
            c.entries.extend(entries);
            c.ends.push(c.entries.len());
        }
        let (stride, width) = (n.next_multiple_of(4), rows.len().max(1).next_multiple_of(4));
        c.width = width;
        c.terms.ends.reserve_exact(rows.len());
        c.terms.columns.reserve_exact(c.entries.len());
        c.x = vec![0.0; rows.len() * stride];
        c.xt = vec![0.0; n * width];
        c.y = vec![0.0; rows.len() * width];
        c.carried = Vec::with_capacity(rows.len() * MAX_CHANNELS.next_multiple_of(4));
        c.rows = rows;
        self.compiled = c;
    }

    /// `P = Phi P Phi' + Q`, without allocation.
    pub fn propagate(&mut self, covariance: &mut Covariance) {
        let (n, stride) = (covariance.n, covariance.stride);
        let p = &mut covariance.p;
        let Compiled { rows, width, ends, entries, position, terms, x, xt, y, .. } =
            &mut self.compiled;
        let width = *width;
        terms.gather(ends, entries, &self.phi);
        // X = A P, with A the changed rows of Phi
        terms.product(p, stride, x, false);
        for (k, row) in x.chunks_exact(stride).enumerate() {
            for (v, column) in row.iter().zip(xt.chunks_exact_mut(width)) {
                column[k] = *v;
            }
        }
        // Y = A X', the elements of P where changed rows and columns meet; Y is symmetric, so its
        // upper half is enough
        terms.product(xt, width, y, true);
        for (row, x) in rows.iter().zip(x.chunks_exact(stride)) {
            p[row * stride..][..n].copy_from_slice(&x[..n]);
        }
        for (j, new) in xt.chunks_exact(width).enumerate() {
            match position[j] {
                None => {
                    let p = &mut p[j * stride..][..n];
                    rows.iter().zip(new).for_each(|(&row, v)| p[row] = *v);
                }
                Some(k) => {
                    for (&row, v) in rows[k..].iter().zip(&y[k * width + k..]) {
                        p[j * stride + row] = *v;
                        p[row * stride + j] = *v;
                    }
                }
            }
        }
        let share = 1.0 + self.excess;
        for &(at, row, size) in &self.noise {
            for i in 0..size {
                for j in 0..size {
                    p[(row + i) * stride + row + j] += share * self.q[at + i * size + j];
                }
            }
        }
        for own in &self.own {
            p[own.row * stride + own.row] += own.q;
        }
    }

    /// `G = Phi G` with the `Phi` of the last [`Self::propagate`]. `G` is row-major with rows of
    /// `stride`, a multiple of four; `work` is its work space, which grows once.
    pub fn carry(&self, g: &mut [f64], stride: usize, work: &mut Vec<f64>) {
        let Compiled { rows, terms, .. } = &self.compiled;
        work.resize(rows.len() * stride, 0.0);
        terms.product(g, stride, work, false);
        for (row, new) in rows.iter().zip(work.chunks_exact(stride)) {
            g[row * stride..][..stride].copy_from_slice(new);
        }
    }

    /// Carries a sensor's reach over the last step, as [`Self::carry`] does.
    pub(crate) fn carry_reach(&mut self, reach: &mut Reach) {
        let mut work = std::mem::take(&mut self.compiled.carried);
        self.carry(&mut reach.g, reach.stride, &mut work);
        self.compiled.carried = work;
    }

    /// `(row, column)` of each element of `Phi`, in the order of [`Self::add_to`].
    pub(crate) fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    /// Returns `true` if a process fills a row in this range.
    pub fn moves(&self, rows: &std::ops::Range<usize>) -> bool {
        self.places.iter().any(|p| rows.contains(&p.0))
            || self.noise.iter().any(|n| rows.contains(&n.1))
    }

    /// Adds the elements of the last step's `Phi` to `sum`, as far as `sum` goes.
    pub(crate) fn add_to(&self, sum: &mut [f64]) {
        sum.iter_mut().zip(&self.phi).for_each(|(sum, phi)| *sum += phi);
    }

    /// Computes the density of the models' process noise in a step of `dt` seconds: for each error
    /// state, the variance divided by `dt`.
    pub(crate) fn noise_density(&self, dt: f64, density: &mut [f64]) {
        for &(at, row, size) in &self.noise {
            for i in 0..size {
                density[row + i] = (1.0 + self.excess) * self.q[at + i * size + i] / dt;
            }
        }
    }

    /// Approximate size, bytes.
    pub(crate) fn size(&self) -> usize {
        let c = &self.compiled;
        let numbers = self.phi.len() + self.q.len() + c.x.len() + c.xt.len() + c.y.len();
        numbers * size_of::<f64>() + (self.places.len() + c.entries.len()) * size_of::<[usize; 4]>()
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

    /// The declared elements of `Q`, as row, column and value.
    pub fn noise_elements(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let share = 1.0 + self.excess;
        let blocks = self.noise.iter().flat_map(move |&(at, row, size)| {
            (0..size * size).map(move |k| (row + k / size, row + k % size, share * self.q[at + k]))
        });
        blocks.chain(self.own.iter().map(|own| (own.row, own.row, own.q)))
    }

    /// `Phi` as a dense matrix: the identity, except in the rows with declared elements.
    pub fn phi_dense(&self, n: usize) -> nalgebra::DMatrix<f64> {
        let mut phi = nalgebra::DMatrix::identity(n, n);
        for &row in &self.compiled.rows {
            phi[(row, row)] = 0.0;
        }
        self.elements().for_each(|(i, j, value)| phi[(i, j)] += value);
        phi
    }

    /// `Q` as a dense matrix.
    pub fn noise_dense(&self, n: usize) -> nalgebra::DMatrix<f64> {
        let mut q = nalgebra::DMatrix::zeros(n, n);
        self.noise_elements().for_each(|(i, j, value)| q[(i, j)] += value);
        q
    }
}

impl Terms {
    fn gather(&mut self, ends: &[usize], entries: &[(usize, usize)], phi: &[f64]) {
        self.ends.clear();
        self.columns.clear();
        let mut start = 0;
        for &end in ends {
            let values = entries[start..end].iter().map(|&(column, at)| (column, phi[at]));
            self.columns.extend(values.filter(|(_, v)| *v != 0.0));
            self.ends.push(self.columns.len());
            start = end;
        }
    }

    /// `out = A x`, with `x` and `out` row-major and rows of `stride`, a multiple of four. For a
    /// symmetric result (`half`) only the part right of the diagonal is computed, in groups of
    /// four.
    #[inline]
    fn product(&self, x: &[f64], stride: usize, out: &mut [f64], half: bool) {
        let mut start = 0;
        for (k, (&end, row)) in self.ends.iter().zip(out.chunks_exact_mut(stride)).enumerate() {
            let terms = &self.columns[start..end];
            let mut at = if half { k / 4 * 4 } else { 0 };
            // as many columns at once as fit into the registers
            while at < stride {
                at += match stride - at {
                    4 => accumulate::<4>(terms, x, stride, at, row),
                    8 => accumulate::<8>(terms, x, stride, at, row),
                    12 => accumulate::<12>(terms, x, stride, at, row),
                    16 => accumulate::<16>(terms, x, stride, at, row),
                    _ => accumulate::<20>(terms, x, stride, at, row),
                };
            }
            start = end;
        }
    }
}

/// `W` columns of one row of the product, kept in registers.
#[inline(always)]
fn accumulate<const W: usize>(
    terms: &[(usize, f64)],
    x: &[f64],
    stride: usize,
    at: usize,
    row: &mut [f64],
) -> usize {
    let mut sum = [0.0; W];
    for &(column, a) in terms {
        if let Some(x) = x[column * stride + at..].first_chunk::<W>() {
            for (s, x) in sum.iter_mut().zip(x) {
                *s += a * x;
            }
        }
    }
    row[at..at + W].copy_from_slice(&sum);
    W
}
