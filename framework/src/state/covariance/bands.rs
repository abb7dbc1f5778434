//! Rows of `Phi` in bands, and their product with the rows of a matrix.
//!
//! Most blocks of an error state have three axes, so three rows are taken at once: each lane of the
//! matrix is loaded once for three sums, which stay in registers.

use super::lanes::{Lane, Lanes};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// The changed groups of rows of `Phi`, as bands.
#[derive(Clone, Debug, Default)]
pub(super) struct Bands {
    bands: Vec<Band>,
    /// Elements of all bands, each by ascending column.
    columns: Vec<Column>,
    singles: Vec<Single>,
}

/// Three rows, a single one, or neighbours without elements, which are rows of the identity.
#[derive(Clone, Copy, Debug)]
struct Band {
    row: usize,
    height: usize,
    /// Number of its columns, and of its single elements.
    columns: usize,
    singles: usize,
}

/// An element in each row of a band, with the index of the first one's value.
#[derive(Clone, Copy, Debug)]
struct Column {
    column: usize,
    value: usize,
}

/// An element in one row of a band.
#[derive(Clone, Copy, Debug)]
struct Single {
    row: usize,
    column: usize,
    value: usize,
}

impl Band {
    fn is_kept(&self) -> bool {
        self.columns == 0 && self.singles == 0
    }
}

impl Bands {
    /// Approximate size, bytes.
    pub(super) fn size(&self) -> usize {
        self.bands.len() * size_of::<Band>()
            + self.columns.len() * size_of::<Column>()
            + self.singles.len() * size_of::<Single>()
    }

    /// Orders the `(row, column)` of each element by bands, for the groups of four rows that have
    /// any. The elements of rows for which `keeps` holds are left out.
    pub(super) fn new(
        groups: &[usize],
        places: &[(usize, usize)],
        keeps: impl Fn(usize) -> bool,
    ) -> Self {
        let whole = Piece::all(places);
        let apart = whole.into_iter().flat_map(|piece| piece.without(places, &keeps));
        let pieces: Vec<Piece> = apart.collect();
        // a band begins with the first row of a block, unless it overlaps the band before
        let blocks = pieces.iter().filter(|piece| piece.elements == 3);
        let mut starts: Vec<usize> = blocks.map(|piece| places[piece.first].0).collect();
        starts.sort_unstable();
        starts.dedup_by(|row, before| *row < *before + 3);
        let begins = |row: usize| starts.binary_search(&row).is_ok();
        let (mut bands, mut row) = (Self::default(), 0);
        for &group in groups {
            row = row.max(4 * group);
            while row < 4 * group + 4 {
                let height = if begins(row) { 3 } else { 1 };
                bands.push(row..row + height, places, &pieces);
                row += height;
            }
        }
        bands
    }

    /// Appends a band with the elements of its rows.
    fn push(&mut self, rows: Range<usize>, places: &[(usize, usize)], pieces: &[Piece]) {
        let mut band = Band { row: rows.start, height: rows.len(), columns: 0, singles: 0 };
        for piece in pieces {
            let (first, column) = places[piece.first];
            if rows.len() == 3 && piece.column && first == rows.start {
                self.columns.push(Column { column, value: piece.first });
                band.columns += 1;
                continue;
            }
            let own = (piece.first..piece.first + piece.elements)
                .map(|value| (places[value], value))
                .filter(|((row, _), _)| rows.contains(row));
            for ((row, column), value) in own {
                if rows.len() == 1 {
                    self.columns.push(Column { column, value });
                    band.columns += 1;
                } else {
                    self.singles.push(Single { row: row - rows.start, column, value });
                    band.singles += 1;
                }
            }
        }
        let (columns, singles) =
            (self.columns.len() - band.columns, self.singles.len() - band.singles);
        self.columns[columns..].sort_by_key(|element| (element.column, element.value));
        self.singles[singles..].sort_by_key(|element| (element.column, element.value));
        match self.bands.last_mut() {
            Some(last)
                if last.is_kept() && band.is_kept() && last.row + last.height == band.row =>
            {
                last.height += band.height;
            }
            _ => self.bands.push(band),
        }
    }
}

/// `out = A x` for the bands `A`, with rows of `lanes` in `x` and `out`. Other rows of `out` stay.
///
/// It is compiled as a function of its own, which has all registers.
pub(super) struct Product<'a, const L: usize, const ANY: bool> {
    pub(super) bands: &'a Bands,
    pub(super) phi: &'a [f64],
    pub(super) x: &'a [Lane],
    pub(super) lanes: Lanes<L, ANY>,
    pub(super) out: &'a mut [Lane],
    /// Computes each row up to the group of its number, which contains the lower triangle.
    pub(super) lower: bool,
}

impl<const L: usize, const ANY: bool> WithSimd for Product<'_, L, ANY> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { bands, phi, x, lanes, out, lower } = self;
        let width = lanes.count();
        let (mut columns, mut singles) = (&bands.columns[..], &bands.singles[..]);
        for band in &bands.bands {
            let own = (columns.split_at(band.columns), singles.split_at(band.singles));
            (columns, singles) = (own.0.1, own.1.1);
            let out = &mut out[band.row * width..][..band.height * width];
            if band.is_kept() {
                let from = x.get(band.row * width..).unwrap_or_default();
                out.iter_mut().zip(from).for_each(|(out, x)| *out = *x);
                continue;
            }
            let elements = Elements { columns: own.0.0, singles: own.1.0, phi, x, lanes };
            let end = (band.row + band.height).div_ceil(4);
            let (mut at, end) = (0, if lower { end.min(width) } else { width });
            while at < end {
                // as much at once as fits into the registers, without a single lane at the end
                at += match (band.height, end - at) {
                    (3, 1) => elements.strip::<S, 3, 1>(simd, at, out),
                    (3, 2 | 4) => elements.strip::<S, 3, 2>(simd, at, out),
                    (3, _) => elements.strip::<S, 3, 3>(simd, at, out),
                    (_, 1) => elements.strip::<S, 1, 1>(simd, at, out),
                    (_, 2) => elements.strip::<S, 1, 2>(simd, at, out),
                    (_, 3 | 5) => elements.strip::<S, 1, 3>(simd, at, out),
                    _ => elements.strip::<S, 1, 4>(simd, at, out),
                };
            }
        }
    }
}

/// Neighbours in the list of elements: three of one column, three on a diagonal, or a single one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    first: usize,
    elements: usize,
    column: bool,
}

impl Piece {
    fn all(places: &[(usize, usize)]) -> Vec<Self> {
        let (mut pieces, mut first) = (Vec::new(), 0);
        while let Some(&[(row, column), ..]) = places.get(first..).filter(|rest| !rest.is_empty()) {
            let begins = |step: usize| {
                let three = [0, 1, 2].map(|k| (row + k, column + step * k));
                places[first..].starts_with(&three)
            };
            let elements = if begins(0) || begins(1) { 3 } else { 1 };
            pieces.push(Self { first, elements, column: begins(0) });
            first += elements;
        }
        pieces
    }

    /// The elements in rows that are not left out: all together, or each by itself.
    fn without(self, places: &[(usize, usize)], keeps: impl Fn(usize) -> bool) -> Vec<Self> {
        let all = self.first..self.first + self.elements;
        if !all.clone().any(|at| keeps(places[at].0)) {
            return vec![self];
        }
        let rest = all.filter(|at| !keeps(places[*at].0));
        rest.map(|first| Self { first, elements: 1, column: false }).collect()
    }
}

/// Elements of a band, and the rows of `lanes` that they multiply.
struct Elements<'a, const L: usize, const ANY: bool> {
    columns: &'a [Column],
    singles: &'a [Single],
    phi: &'a [f64],
    x: &'a [Lane],
    lanes: Lanes<L, ANY>,
}

impl<const L: usize, const ANY: bool> Elements<'_, L, ANY> {
    /// The `W` lanes from `at` on of the `H` rows of the band, kept in registers; returns `W`.
    #[inline(always)]
    fn strip<S: Simd, const H: usize, const W: usize>(
        &self,
        simd: S,
        at: usize,
        out: &mut [Lane],
    ) -> usize {
        let Self { columns, singles, phi, x, lanes } = *self;
        let mut sum = [[[0.0; 4]; W]; H];
        for &Column { column, value } in columns {
            let (x, a) = (&lanes.row(x, column)[at..][..W], &phi[value..][..H]);
            for (sum, a) in sum.iter_mut().zip(a) {
                add(simd, sum, *a, x);
            }
        }
        for &Single { row, column, value } in singles {
            let (x, a) = (&lanes.row(x, column)[at..][..W], phi[value]);
            for (i, sum) in sum.iter_mut().enumerate() {
                if i == row {
                    add(simd, sum, a, x);
                }
            }
        }
        for (i, sum) in sum.iter().enumerate() {
            out[i * lanes.count() + at..][..W].copy_from_slice(sum);
        }
        W
    }
}

/// `sum = sum + a x`, never fused.
#[inline(always)]
fn add<S: Simd, const W: usize>(simd: S, sum: &mut [Lane; W], a: f64, x: &[Lane]) {
    let a = simd.splat_f64s(a);
    for (sum, x) in sum.iter_mut().zip(x) {
        for (sum, x) in S::as_mut_simd_f64s(sum).0.iter_mut().zip(S::as_simd_f64s(x).0) {
            *sum = simd.add_f64s(*sum, simd.mul_f64s(a, *x));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_and_diagonals_of_a_block_are_found_anywhere_in_phi() {
        for (row, column) in [(0, 0), (4, 2), (3, 12)] {
            let at = |places: &[(usize, usize)]| -> Vec<(usize, bool)> {
                let moved: Vec<_> = places.iter().map(|&(i, j)| (row + i, column + j)).collect();
                Piece::all(&moved).iter().map(|piece| (piece.elements, piece.column)).collect()
            };
            let by_row: Vec<(usize, usize)> =
                (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).collect();
            let by_column: Vec<(usize, usize)> = by_row.iter().map(|&(i, j)| (j, i)).collect();
            assert_eq!(at(&by_column), [(3, true); 3]);
            assert_eq!(at(&by_column[..7]), [(3, true), (3, true), (1, false)]);
            assert_eq!(at(&[(0, 0), (1, 1), (2, 2), (0, 1)]), [(3, false), (1, false)]);
            assert_eq!(at(&by_row), [(1, false); 9]);
        }
    }

    #[test]
    fn the_stated_size_is_that_of_a_copy() {
        let places: Vec<(usize, usize)> = (0..12).map(|k| (k, (k * 5) % 12)).collect();
        let bands = Bands::new(&[0, 1, 2], &places, |_| false);
        let copied = allocation_counter::measure(|| drop(bands.clone()));
        assert_eq!(bands.size() as u64, copied.bytes_total);
    }
}
