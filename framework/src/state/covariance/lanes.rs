//! Matrices in *lanes* of four columns and tiles of four by four.

use crate::state::select;
use pulp::Simd;
use pulp::bytemuck::cast;

/// Four columns of a row.
pub(super) type Lane = [f64; 4];

/// Number of lanes of a row: `L`, known when the loops are compiled, or `ANY` number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes<const L: usize, const ANY: bool>(pub(super) usize);

impl<const L: usize, const ANY: bool> Lanes<L, ANY> {
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        if ANY { self.0 } else { L }
    }

    /// A row of a matrix.
    #[inline(always)]
    pub(super) fn row(self, x: &[Lane], row: usize) -> &[Lane] {
        if ANY { &x[row * self.0..][..self.0] } else { &x.as_chunks::<L>().0[row] }
    }
}

/// Calls a method with the number of lanes, compiled for rows of up to 36 states and for any.
macro_rules! with_lanes {
    ($lanes:expr, $kernel:ident.$method:ident($($argument:expr),*)) => {
        match $lanes {
            1 => $kernel.$method(Lanes::<1, false>(1), $($argument),*),
            2 => $kernel.$method(Lanes::<2, false>(2), $($argument),*),
            3 => $kernel.$method(Lanes::<3, false>(3), $($argument),*),
            4 => $kernel.$method(Lanes::<4, false>(4), $($argument),*),
            5 => $kernel.$method(Lanes::<5, false>(5), $($argument),*),
            6 => $kernel.$method(Lanes::<6, false>(6), $($argument),*),
            7 => $kernel.$method(Lanes::<7, false>(7), $($argument),*),
            8 => $kernel.$method(Lanes::<8, false>(8), $($argument),*),
            9 => $kernel.$method(Lanes::<9, false>(9), $($argument),*),
            lanes => $kernel.$method(Lanes::<1, true>(lanes), $($argument),*),
        }
    };
}
pub(super) use with_lanes;

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
pub(super) fn mirrored<S: Simd>(simd: S, tile: [Lane; 4]) -> [Lane; 4] {
    if S::F64_LANES == 4 {
        let mut rows: [S::f64s; 4] = cast(tile);
        let columns = simd.deinterleave_shfl_f64s(rows);
        for (i, (row, column)) in (0..).zip(rows.iter_mut().zip(columns)) {
            *row = select(simd, simd.mask_between_m64s(0, i).mask(), *row, column);
        }
        return cast(rows);
    }
    let [a, b, c, d] = tile;
    [[a[0], b[0], c[0], d[0]], [b[0], b[1], c[1], d[1]], [c[0], c[1], c[2], d[2]], d]
}

/// Reads the tile of a group of rows and columns.
#[inline(always)]
pub(super) fn tile(p: &[Lane], lanes: usize, row: usize, column: usize) -> [Lane; 4] {
    let p = &p[4 * row * lanes + column..][..3 * lanes + 1];
    [p[0], p[lanes], p[2 * lanes], p[3 * lanes]]
}

/// Writes the tile of a group of rows and columns.
#[inline(always)]
pub(super) fn put(p: &mut [Lane], lanes: usize, row: usize, column: usize, tile: [Lane; 4]) {
    let p = &mut p[4 * row * lanes + column..][..3 * lanes + 1];
    [p[0], p[lanes], p[2 * lanes], p[3 * lanes]] = tile;
}
