//! The transition of one step: a sparse pattern, found once, and the product that it makes.

use super::Covariance;
use crate::state::Layout;

/// Where a process model writes an `R` x `C` block of the transition matrix; a block of a fixed state has no place.
#[derive(Clone, Copy, Debug)]
pub struct PhiSlot<const R: usize, const C: usize>(Option<usize>);

/// Where a process model writes the diagonal of a block of the transition matrix.
#[derive(Clone, Copy, Debug)]
pub struct PhiDiagonal<const N: usize>(Option<usize>);

/// Where a process model writes an `N` x `N` block on the diagonal of the process noise covariance.
#[derive(Clone, Copy, Debug)]
pub struct NoiseSlot<const N: usize>(Option<usize>);

/// The transition `Phi` and process noise `Q` of one step, filled by the process models in the places they declared.
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
    /// Blocks that move by themselves, one entry an axis.
    own: Vec<Own>,
    compiled: Compiled,
}

/// One axis of a block that moves by itself.
#[derive(Clone, Debug)]
struct Own {
    row: usize,
    /// Where its decay stands in `Transition::phi`.
    phi: Option<usize>,
    q: f64,
}

/// The pattern in the kernel's order, and its work space.
#[derive(Clone, Debug, Default)]
struct Compiled {
    /// The rows of `Phi` that are not those of the identity, ascending.
    rows: Vec<usize>,
    /// End of each row's entries.
    ends: Vec<usize>,
    /// The column of each entry, and where its value stands in `Transition::phi`.
    entries: Vec<(u32, u32)>,
    /// Values gathered into the kernel's order.
    values: Vec<f64>,
    /// Whether a column of the error state is an active row, and which.
    position: Vec<Option<usize>>,
    x: Vec<f64>,
    xt: Vec<f64>,
    y: Vec<f64>,
}

impl Transition {
    /// Declares a block of `Phi` with rows of `row` and columns of `column` (first tangent index, `None` when fixed).
    pub fn phi<const R: usize, const C: usize>(&mut self, row: Option<usize>, column: Option<usize>) -> PhiSlot<R, C> {
        PhiSlot(row.zip(column).map(|(r, c)| {
            let at = self.phi.len();
            self.places.extend((0..R * C).map(|k| (r + k / C, c + k % C)));
            self.phi.resize(at + R * C, 0.0);
            at
        }))
    }

    /// Declares the diagonal of a block of `Phi`.
    pub fn phi_diagonal<const N: usize>(&mut self, row: Option<usize>, column: Option<usize>) -> PhiDiagonal<N> {
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
    pub fn set<const R: usize, const C: usize>(&mut self, slot: PhiSlot<R, C>, block: &nalgebra::SMatrix<f64, R, C>) {
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
    pub fn set_noise<const N: usize>(&mut self, slot: NoiseSlot<N>, q: &nalgebra::SMatrix<f64, N, N>) {
        if let Some(at) = slot.0 {
            self.q[at..at + N * N].copy_from_slice(q.as_slice());
        }
    }

    /// Declares the axes of a block that moves by itself, with a decay or without; gives the first one's index.
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

    /// Sets the decay and the process noise variance of the axis `k` after `first`.
    pub(crate) fn set_own(&mut self, first: usize, k: usize, decay: Option<f64>, q: f64) {
        let own = &mut self.own[first + k];
        own.q = q;
        if let Some((at, decay)) = own.phi.zip(decay) {
            self.phi[at] = decay;
        }
    }

    /// Orders the pattern for the kernel; call once, when every place is declared.
    pub fn compile(&mut self, layout: &Layout) {
        let n = layout.tangent;
        let mut rows: Vec<usize> = self.places.iter().map(|p| p.0).collect();
        rows.sort_unstable();
        rows.dedup();
        let mut c = Compiled { position: vec![None; n], ..Compiled::default() };
        for (k, &row) in rows.iter().enumerate() {
            c.position[row] = Some(k);
            let mut entries: Vec<(u32, u32)> = (self.places.iter().enumerate())
                .filter(|(_, p)| p.0 == row)
                .map(|(at, p)| (p.1 as u32, at as u32))
                .collect();
            entries.sort_unstable();
            c.entries.extend(entries);
            c.ends.push(c.entries.len());
        }
        let (stride, width) = (n.next_multiple_of(4), rows.len().next_multiple_of(4));
        c.values = vec![0.0; c.entries.len()];
        c.x = vec![0.0; rows.len() * stride];
        c.xt = vec![0.0; n * width];
        c.y = vec![0.0; rows.len() * width];
        c.rows = rows;
        self.compiled = c;
    }

    /// `P = Phi P Phi' + Q`, without allocation.
    pub fn propagate(&mut self, covariance: &mut Covariance) {
        let (n, stride) = (covariance.n, covariance.stride);
        let p = &mut covariance.p;
        let Compiled { rows, ends, entries, values, position, x, xt, y } = &mut self.compiled;
        let width = rows.len().next_multiple_of(4);
        for (v, e) in values.iter_mut().zip(entries.iter()) {
            *v = self.phi[e.1 as usize];
        }
        // X = A P, the changed rows
        product(ends, entries, values, p, stride, x);
        for (k, row) in x.chunks_exact(stride).enumerate() {
            for (j, v) in row[..n].iter().enumerate() {
                xt[j * width + k] = *v;
            }
        }
        // Y = A X', where changed rows and columns meet
        product(ends, entries, values, xt, width, y);
        for (k, &row) in rows.iter().enumerate() {
            p[row * stride..row * stride + n].copy_from_slice(&x[k * stride..k * stride + n]);
        }
        for j in 0..n {
            let new = &xt[j * width..j * width + rows.len()];
            match position[j] {
                None => rows.iter().zip(new).for_each(|(&row, v)| p[j * stride + row] = *v),
                Some(k) => {
                    for (l, &row) in rows.iter().enumerate().take(k + 1) {
                        let mean = 0.5 * (y[k * width + l] + y[l * width + k]);
                        p[j * stride + row] = mean;
                        p[row * stride + j] = mean;
                    }
                }
            }
        }
        for &(at, row, size) in &self.noise {
            for i in 0..size {
                for j in 0..size {
                    p[(row + i) * stride + row + j] += self.q[at + i * size + j];
                }
            }
        }
        for own in &self.own {
            p[own.row * stride + own.row] += own.q;
        }
    }

    /// `Phi` as a dense matrix: the identity but for the declared places.
    pub fn phi_dense(&self, n: usize) -> nalgebra::DMatrix<f64> {
        let mut phi = nalgebra::DMatrix::identity(n, n);
        for &row in &self.compiled.rows {
            phi[(row, row)] = 0.0;
        }
        for (&(i, j), v) in self.places.iter().zip(&self.phi) {
            phi[(i, j)] += v;
        }
        phi
    }

    /// `Q` as a dense matrix.
    pub fn noise_dense(&self, n: usize) -> nalgebra::DMatrix<f64> {
        let mut q = nalgebra::DMatrix::zeros(n, n);
        for &(at, row, size) in &self.noise {
            for k in 0..size * size {
                q[(row + k / size, row + k % size)] += self.q[at + k];
            }
        }
        for own in &self.own {
            q[(own.row, own.row)] += own.q;
        }
        q
    }
}

/// `out = A x` for the sparse rows `A`; `x` and `out` row-major with rows of `stride`, a multiple of four.
#[inline]
fn product(ends: &[usize], entries: &[(u32, u32)], values: &[f64], x: &[f64], stride: usize, out: &mut [f64]) {
    let mut start = 0;
    for (k, &end) in ends.iter().enumerate() {
        let (e, v) = (&entries[start..end], &values[start..end]);
        let row = &mut out[k * stride..(k + 1) * stride];
        let mut at = 0;
        while at + 12 <= stride {
            accumulate::<12>(e, v, x, stride, at, row);
            at += 12;
        }
        while at + 8 <= stride {
            accumulate::<8>(e, v, x, stride, at, row);
            at += 8;
        }
        if at < stride {
            accumulate::<4>(e, v, x, stride, at, row);
        }
        start = end;
    }
}

/// `W` columns of one row of the product, kept in registers.
#[inline(always)]
fn accumulate<const W: usize>(e: &[(u32, u32)], v: &[f64], x: &[f64], stride: usize, at: usize, row: &mut [f64]) {
    let mut sum = [0.0; W];
    for (&(column, _), &a) in e.iter().zip(v) {
        let from = column as usize * stride + at;
        if let Some(x) = x[from..].first_chunk::<W>() {
            for (s, x) in sum.iter_mut().zip(x) {
                *s += a * x;
            }
        }
    }
    row[at..at + W].copy_from_slice(&sum);
}
