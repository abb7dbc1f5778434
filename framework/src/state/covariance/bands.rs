//! Rows of `Phi` in bands, and their product with the rows of a matrix.
//!
//! Most blocks of an error state have three axes, so three rows are taken at once: each lane of the
//! matrix is loaded once for three sums, which stay in registers.

use pulp::Simd;

/// The changed groups of rows of `Phi`, as bands.
#[derive(Clone, Debug, Default)]
pub(super) struct Bands {
    bands: Vec<Band>,
    /// Elements of all bands, each by ascending column.
    terms: Vec<Term>,
}

/// Three rows, or a single one. A row without terms is that of the identity.
#[derive(Clone, Copy, Debug)]
struct Band {
    row: usize,
    height: usize,
    /// End of its terms.
    end: usize,
    /// Number of groups up to that of its last row.
    groups: usize,
}

/// Elements of a band: its first column, and the index of its first value.
#[derive(Clone, Copy, Debug)]
struct Term {
    shape: Shape,
    column: usize,
    value: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// Three by three elements, row by row.
    Block,
    /// Three by three elements, column by column.
    Turned,
    /// Three elements on a diagonal.
    Diagonal,
    /// Three elements in one column.
    Column,
    /// One element, in this row of the band.
    One(usize),
}

impl Bands {
    /// Approximate size, bytes.
    pub(super) fn size(&self) -> usize {
        self.terms.len() * size_of::<Term>() + self.bands.len() * size_of::<Band>()
    }

    /// Orders the `(row, column)` of each element by bands, for the groups of four rows that have
    /// any.
    pub(super) fn new(groups: &[usize], places: &[(usize, usize)]) -> Self {
        let (mut declared, mut value) = (Vec::new(), 0);
        while let Some(rest) = places.get(value..).filter(|rest| !rest.is_empty()) {
            let shape = Shape::of(rest);
            declared.push((rest[0].0, Term { shape, column: rest[0].1, value }));
            value += shape.elements();
        }
        // a band begins with the first row of a block, unless it overlaps the band before
        let is_block = |term: &Term| !matches!(term.shape, Shape::One(_));
        let mut starts: Vec<usize> =
            declared.iter().filter(|(_, term)| is_block(term)).map(|(row, _)| *row).collect();
        starts.sort_unstable();
        starts.dedup_by(|row, before| *row < *before + 3);
        let begins = |row: usize| starts.binary_search(&row).is_ok();
        let singles = |&(row, term): &(usize, Term)| {
            let whole = !is_block(&term) || begins(row);
            let count = if whole { 1 } else { term.shape.elements() };
            (0..count).map(move |k| match (whole, places[term.value + k]) {
                (true, _) => (row, term),
                (false, (row, column)) => {
                    (row, Term { shape: Shape::One(0), column, value: term.value + k })
                }
            })
        };
        let all: Vec<(usize, Term)> = declared.iter().flat_map(singles).collect();
        let (mut bands, mut row) = (Self::default(), 0);
        for (before, &group) in groups.iter().enumerate() {
            row = row.max(4 * group);
            while row < 4 * group + 4 {
                let height = if begins(row) { 3 } else { 1 };
                let own = all.iter().filter(|(r, _)| (row..row + height).contains(r));
                let mut own: Vec<Term> = own
                    .map(|&(r, term)| match term.shape {
                        Shape::One(_) => Term { shape: Shape::One(r - row), ..term },
                        _ => term,
                    })
                    .collect();
                own.sort_by_key(|term| (term.column, term.value));
                bands.terms.extend(own);
                let beyond = usize::from(row + height > 4 * group + 4);
                let groups = before + 1 + beyond;
                bands.bands.push(Band { row, height, end: bands.terms.len(), groups });
                row += height;
            }
        }
        bands
    }

    /// `out = A x` for the bands `A`, with rows of `stride`, a multiple of four, in `x` and `out`.
    /// Rows that `x` does not have count as zero.
    #[inline(always)]
    pub(super) fn product<S: Simd>(
        &self,
        simd: S,
        phi: &[f64],
        x: &[f64],
        stride: usize,
        out: &mut [f64],
    ) {
        self.partial(simd, phi, (x, stride), out, |_| stride);
    }

    /// [`Self::product`] where the columns of `x` are the groups of rows: each row of `out` up to
    /// its own group, which contains the lower triangle. The rest of `out` stays.
    #[inline(always)]
    pub(super) fn lower_product<S: Simd>(
        &self,
        simd: S,
        phi: &[f64],
        x: &[f64],
        stride: usize,
        out: &mut [f64],
    ) {
        self.partial(simd, phi, (x, stride), out, |band| 4 * band.groups);
    }

    /// The first columns of a product, as many as each band needs.
    #[inline(always)]
    fn partial<S: Simd>(
        &self,
        simd: S,
        phi: &[f64],
        (x, stride): (&[f64], usize),
        out: &mut [f64],
        columns: impl Fn(&Band) -> usize,
    ) {
        let (x, out) = (S::as_simd_f64s(x).0, S::as_mut_simd_f64s(out).0);
        let lanes = stride / S::F64_LANES;
        let (mut start, mut rest) = (0, out);
        for band in &self.bands {
            let terms = &self.terms[start..band.end];
            start = band.end;
            let (out, after) = rest.split_at_mut(band.height * lanes);
            rest = after;
            if terms.is_empty() {
                keep(simd, x, band.row * lanes, out);
                continue;
            }
            let (mut at, end) = (0, columns(band).min(stride) / S::F64_LANES);
            while at < end {
                let strip = Strip { simd, terms, phi, x, lanes, at };
                // as much at once as fits into the registers, without a single lane at the end
                at += match (band.height, end - at) {
                    (3, 1) => strip.sum::<3, 1>(out),
                    (3, 2) => strip.sum::<3, 2>(out),
                    (3, 4) => strip.sum::<3, 4>(out),
                    (3, _) => strip.sum::<3, 3>(out),
                    (_, 1) => strip.sum::<1, 1>(out),
                    (_, 2) => strip.sum::<1, 2>(out),
                    (_, 3 | 5) => strip.sum::<1, 3>(out),
                    _ => strip.sum::<1, 4>(out),
                };
            }
        }
    }
}

impl Shape {
    /// The largest shape with which a list of places begins.
    fn of(places: &[(usize, usize)]) -> Self {
        let (row, column) = places[0];
        let begins = |n: usize, place: fn(usize) -> (usize, usize)| {
            let of = |k: usize| (row + place(k).0, column + place(k).1);
            places.len() >= n && (0..n).all(|k| places[k] == of(k))
        };
        if begins(9, |k| (k / 3, k % 3)) {
            Self::Block
        } else if begins(9, |k| (k % 3, k / 3)) {
            Self::Turned
        } else if begins(3, |k| (k, k)) {
            Self::Diagonal
        } else if begins(3, |k| (k, 0)) {
            Self::Column
        } else {
            Self::One(0)
        }
    }

    fn elements(self) -> usize {
        match self {
            Self::Block | Self::Turned => 9,
            Self::Diagonal | Self::Column => 3,
            Self::One(_) => 1,
        }
    }
}

/// Some lanes of a band.
struct Strip<'a, S: Simd> {
    simd: S,
    terms: &'a [Term],
    phi: &'a [f64],
    x: &'a [S::f64s],
    /// Number of lanes of a row, and the first of this strip.
    lanes: usize,
    at: usize,
}

impl<S: Simd> Strip<'_, S> {
    /// `W` lanes of the `H` rows of the band, kept in registers; returns `W`.
    #[inline(always)]
    fn sum<const H: usize, const W: usize>(&self, out: &mut [S::f64s]) -> usize {
        let mut sum = [[self.simd.splat_f64s(0.0); W]; H];
        for &Term { shape, column, value } in self.terms {
            let Some(x) = self.x.get(column * self.lanes + self.at..) else { continue };
            match shape {
                Shape::One(row) => {
                    let parts = x.first_chunk::<W>().zip(self.phi.get(value));
                    let Some((x, a)) = parts else { continue };
                    for (i, sum) in sum.iter_mut().enumerate() {
                        if i == row {
                            self.add(sum, *a, x);
                        }
                    }
                }
                Shape::Diagonal => {
                    let parts = self.three(x).zip(first::<3>(self.phi, value));
                    let Some((x, a)) = parts else { continue };
                    for (i, sum) in sum.iter_mut().enumerate() {
                        self.add(sum, a[i], x[i]);
                    }
                }
                Shape::Column => {
                    let parts = x.first_chunk::<W>().zip(first::<3>(self.phi, value));
                    let Some((x, a)) = parts else { continue };
                    self.column(&mut sum, *a, x);
                }
                Shape::Block => {
                    let parts = self.three(x).zip(first::<9>(self.phi, value));
                    let Some((x, a)) = parts else { continue };
                    self.column(&mut sum, [a[0], a[3], a[6]], x[0]);
                    self.column(&mut sum, [a[1], a[4], a[7]], x[1]);
                    self.column(&mut sum, [a[2], a[5], a[8]], x[2]);
                }
                Shape::Turned => {
                    let parts = self.three(x).zip(first::<9>(self.phi, value));
                    let Some((x, a)) = parts else { continue };
                    self.column(&mut sum, [a[0], a[1], a[2]], x[0]);
                    self.column(&mut sum, [a[3], a[4], a[5]], x[1]);
                    self.column(&mut sum, [a[6], a[7], a[8]], x[2]);
                }
            }
        }
        for (sum, out) in sum.iter().zip(out.chunks_exact_mut(self.lanes)) {
            out[self.at..][..W].copy_from_slice(sum);
        }
        W
    }

    /// Adds the share of one row of `x` to all sums.
    #[inline(always)]
    fn column<const H: usize, const W: usize>(
        &self,
        sum: &mut [[S::f64s; W]; H],
        a: [f64; 3],
        x: &[S::f64s; W],
    ) {
        for (sum, a) in sum.iter_mut().zip(a) {
            self.add(sum, a, x);
        }
    }

    /// `sum = sum + a x`, never fused.
    #[inline(always)]
    fn add<const W: usize>(&self, sum: &mut [S::f64s; W], a: f64, x: &[S::f64s; W]) {
        let a = self.simd.splat_f64s(a);
        for (sum, x) in sum.iter_mut().zip(x) {
            *sum = self.simd.add_f64s(*sum, self.simd.mul_f64s(a, *x));
        }
    }

    /// The first lanes of three rows.
    #[inline(always)]
    fn three<'x, const W: usize>(&self, x: &'x [S::f64s]) -> Option<[&'x [S::f64s; W]; 3]> {
        let last = x.get(2 * self.lanes..)?.first_chunk()?;
        Some([x.first_chunk()?, x[self.lanes..].first_chunk()?, last])
    }
}

/// The first values of a shape.
#[inline(always)]
fn first<const N: usize>(phi: &[f64], value: usize) -> Option<&[f64; N]> {
    phi.get(value..)?.first_chunk()
}

/// Copies a row of the identity's product.
#[inline(always)]
fn keep<S: Simd>(simd: S, x: &[S::f64s], at: usize, out: &mut [S::f64s]) {
    let from = x.get(at..).unwrap_or_default();
    if from.is_empty() {
        out.fill(simd.splat_f64s(0.0));
    }
    for (to, from) in out.iter_mut().zip(from) {
        *to = *from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_a_turned_one_and_a_diagonal_are_found_anywhere_in_phi() {
        for (row, column) in [(0, 0), (4, 2), (3, 12)] {
            let at = |places: &[(usize, usize)]| {
                let moved: Vec<_> = places.iter().map(|&(i, j)| (row + i, column + j)).collect();
                Shape::of(&moved)
            };
            let block: Vec<(usize, usize)> =
                (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).collect();
            let turned: Vec<(usize, usize)> = block.iter().map(|&(i, j)| (j, i)).collect();
            assert_eq!(at(&block), Shape::Block);
            assert_eq!(at(&turned), Shape::Turned);
            assert_eq!(at(&[(0, 0), (1, 1), (2, 2), (0, 1)]), Shape::Diagonal);
            assert_eq!(at(&turned[..8]), Shape::Column);
            for other in [&block[..8], &turned[..2], &[(0, 0), (1, 1)], &[(0, 0), (1, 1), (2, 1)]] {
                assert_eq!(at(other), Shape::One(0));
            }
        }
    }

    #[test]
    fn the_stated_size_is_that_of_a_copy() {
        let places: Vec<(usize, usize)> = (0..12).map(|k| (k, (k * 5) % 12)).collect();
        let bands = Bands::new(&[0, 1, 2], &places);
        let copied = allocation_counter::measure(|| drop(bands.clone()));
        assert_eq!(bands.size() as u64, copied.bytes_total);
    }
}
