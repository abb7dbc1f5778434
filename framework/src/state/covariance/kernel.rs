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
use super::bands::Bands;
use crate::units::sample::MAX_CHANNELS;
use pulp::bytemuck::cast;
use pulp::{Arch, Simd, WithSimd};
use std::sync::Arc;

/// Four columns of a row.
pub(super) type Lane = [f64; 4];

/// The pattern of `Phi` in the kernel's order, and its work space.
#[derive(Clone, Debug, Default)]
pub(super) struct Kernel {
    /// Rows of `Phi` that differ from the identity, ascending. All copies share them.
    rows: Arc<[usize]>,
    /// Groups of four rows of which one differs from the identity, and all rows of the others.
    groups: Vec<usize>,
    kept: Vec<usize>,
    bands: Bands,
    x: Vec<Lane>,
    xt: Vec<Lane>,
    y: Vec<Lane>,
    pub(super) carried: Vec<f64>,
    pub(super) processor: Arch,
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
    fn with_simd<S: Simd>(self, simd: S) {
        self.kernel.product_with(simd, self.phi, self.covariance);
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
    fn with_simd<S: Simd>(self, simd: S) {
        self.kernel.bands.product(simd, self.phi, self.g, self.stride, self.out);
    }
}

impl Kernel {
    /// Orders the `(row, column)` of each element of `Phi` for an error state of dimension `n`.
    pub(super) fn new(n: usize, places: &[(usize, usize)]) -> Self {
        let mut rows: Vec<usize> = places.iter().map(|p| p.0).collect();
        rows.sort_unstable();
        rows.dedup();
        let mut groups: Vec<usize> = rows.iter().map(|row| row / 4).collect();
        groups.dedup();
        let (lanes, width) = (n.max(1).div_ceil(4), groups.len().max(1));
        Self {
            kept: (0..n).filter(|row| groups.binary_search(&(row / 4)).is_err()).collect(),
            x: vec![[0.0; 4]; 4 * width * lanes],
            xt: vec![[0.0; 4]; 4 * lanes * width],
            y: vec![[0.0; 4]; 4 * width * width],
            carried: Vec::with_capacity(4 * width * MAX_CHANNELS.next_multiple_of(4)),
            processor: Arch::new(),
            bands: Bands::new(&groups, places),
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
        (self.x.len() + self.xt.len() + self.y.len()) * size_of::<Lane>() + self.bands.size()
    }

    /// `P = Phi P Phi'`, without allocation.
    pub(super) fn propagate(&mut self, phi: &[f64], covariance: &mut Covariance) {
        self.processor.dispatch(Propagation { kernel: self, phi, covariance });
    }

    #[inline(always)]
    fn product_with<S: Simd>(&mut self, simd: S, phi: &[f64], covariance: &mut Covariance) {
        let Self { groups, kept, bands, x, xt, y, .. } = self;
        let (width, lanes) = (groups.len().max(1), covariance.stride / 4);
        // X = A P, with A the changed rows of Phi
        bands.product(simd, phi, &covariance.p, 4 * lanes, x.as_flattened_mut());
        transpose(simd, x, lanes, xt, width);
        // Y = A X', the elements of P where changed rows and columns meet: it is symmetric but for
        // rounding, and the elements left of the diagonal count
        bands.lower_product(simd, phi, xt.as_flattened(), 4 * width, y.as_flattened_mut());
        let p = covariance.p.as_chunks_mut::<4>().0;
        for (&group, x) in groups.iter().zip(x.chunks_exact(4 * lanes)) {
            for (to, from) in p[4 * group * lanes..].iter_mut().zip(x) {
                *to = *from;
            }
        }
        for &row in &*kept {
            let (to, from) = (&mut p[row * lanes..][..lanes], &xt[row * width..][..width]);
            for (&group, from) in groups.iter().zip(from) {
                to[group] = *from;
            }
        }
        for (g, (&row, rows)) in groups.iter().zip(y.chunks_exact(4 * width)).enumerate() {
            for (h, &column) in groups.iter().enumerate().take(g + 1) {
                let tile = [rows[h], rows[width + h], rows[2 * width + h], rows[3 * width + h]];
                if h == g {
                    put(p, lanes, (row, row), mirrored(simd, tile));
                } else {
                    put(p, lanes, (row, column), tile);
                    put(p, lanes, (column, row), turned(simd, tile));
                }
            }
        }
    }

    /// `G = Phi G`: see [`super::Transition::carry`].
    pub(super) fn carry(&self, phi: &[f64], g: &mut [f64], stride: usize, work: &mut Vec<f64>) {
        work.resize(4 * self.groups.len() * stride, 0.0);
        let carry = Carry { kernel: self, phi, g, stride, out: &mut work[..] };
        self.processor.dispatch(carry);
        // the product keeps the rows of a group that are those of the identity
        for (&group, new) in self.groups.iter().zip(work.chunks_exact(4 * stride)) {
            let rows = &mut g[4 * group * stride..];
            let length = rows.len().min(new.len());
            rows[..length].copy_from_slice(&new[..length]);
        }
    }
}

/// A tile transposed.
#[inline(always)]
pub(super) fn turned<S: Simd>(simd: S, tile: [Lane; 4]) -> [Lane; 4] {
    if S::F64_LANES == 4 {
        return cast(simd.deinterleave_shfl_f64s(cast::<_, [S::f64s; 4]>(tile)));
    }
    let [a, b, c, d] = tile;
    let column = |i: usize| [a[i], b[i], c[i], d[i]];
    [column(0), column(1), column(2), column(3)]
}

/// A tile with the elements left of the diagonal on both sides of it.
#[inline(always)]
fn mirrored<S: Simd>(simd: S, tile: [Lane; 4]) -> [Lane; 4] {
    if S::F64_LANES == 4 {
        let mut rows: [S::f64s; 4] = cast(tile);
        let columns = simd.deinterleave_shfl_f64s(rows);
        for (i, (row, column)) in (0..).zip(rows.iter_mut().zip(columns)) {
            *row = simd.select_f64s(simd.mask_between_m64s(0, i).mask(), *row, column);
        }
        return cast(rows);
    }
    let [a, b, c, d] = tile;
    [[a[0], b[0], c[0], d[0]], [b[0], b[1], c[1], d[1]], [c[0], c[1], c[2], d[2]], d]
}

/// Reads the tile of a group of rows and columns, with zeros in rows that the matrix lacks.
#[inline(always)]
pub(super) fn tile(p: &[Lane], lanes: usize, (row, column): (usize, usize)) -> [Lane; 4] {
    let lane = |i: usize| p.get((4 * row + i) * lanes + column).copied().unwrap_or_default();
    [lane(0), lane(1), lane(2), lane(3)]
}

/// Writes the tile of a group of rows and columns, as far as the matrix has its rows.
#[inline(always)]
pub(super) fn put(p: &mut [Lane], lanes: usize, (row, column): (usize, usize), tile: [Lane; 4]) {
    for (i, lane) in tile.into_iter().enumerate() {
        if let Some(to) = p.get_mut((4 * row + i) * lanes + column) {
            *to = lane;
        }
    }
}

/// `xt = x'` in tiles, for rows of `lanes` and `width`.
#[inline(always)]
fn transpose<S: Simd>(simd: S, x: &[Lane], lanes: usize, xt: &mut [Lane], width: usize) {
    for (k, rows) in x.chunks_exact(4 * lanes).enumerate() {
        let (a, rest) = rows.split_at(lanes);
        let (b, rest) = rest.split_at(lanes);
        let (c, d) = rest.split_at(lanes);
        let tiles = a.iter().zip(b).zip(c).zip(d);
        for ((((a, b), c), d), to) in tiles.zip(xt.chunks_exact_mut(4 * width)) {
            [to[k], to[width + k], to[2 * width + k], to[3 * width + k]] =
                turned(simd, [*a, *b, *c, *d]);
        }
    }
}
