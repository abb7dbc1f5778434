//! Arithmetic of hypotheses side by side, which fills vector registers. No operation is fused, so that the
//! results are the same on each processor.

use super::effect::{OFFSETS, WIDE, Whitened};
use super::score::Score;
use crate::checkpoint::saved;
use crate::state::covariance::Update;
use crate::units::sample::MAX_CHANNELS;
use pulp::{Simd, WithSimd};

/// Sensitivity `g` of the channels of a sample.
pub(super) type Seen<const W: usize> = [[f32; W]; MAX_CHANNELS];

/// Workspace of a sample and of a step.
#[derive(Clone)]
pub(super) struct Work<const W: usize> {
    moved: Vec<[f32; W]>,
    white: [Seen<W>; 2],
}

impl<const W: usize> Work<W> {
    pub(super) fn new(n: usize) -> Self {
        Self { moved: vec![[0.0; W]; n], white: [[[0.0; W]; MAX_CHANNELS]; 2] }
    }

    /// `L^-1 f` and `L^-1 g` of the last sample.
    pub(super) fn white(&self) -> &[Seen<W>; 2] {
        &self.white
    }

    /// Makes room for that many states: an effect that comes from a checkpoint has none.
    pub(super) fn fit(&mut self, n: usize) {
        if self.moved.len() < n {
            self.moved.resize(n, [0.0; W]);
        }
    }
}

/// Sums `b`, `i` and `c` of the hypotheses.
#[derive(Clone)]
pub(super) struct Sums<const W: usize> {
    sums: [[f64; W]; 3],
}

saved!(Sums<1> { sums });
saved!(Sums<OFFSETS> { sums });
saved!(Sums<WIDE> { sums });

impl<const W: usize> Default for Sums<W> {
    fn default() -> Self {
        Self { sums: [[0.0; W]; 3] }
    }
}

impl<const W: usize> Sums<W> {
    pub(super) fn clear(&mut self, sum: usize) {
        self.sums.iter_mut().for_each(|sums| sums[sum] = 0.0);
    }

    /// A score with the sums of its hypothesis.
    pub(super) fn added(&self, sum: usize, mut score: Score) -> Score {
        let [b, i, c] = &self.sums;
        score.add(b[sum], i[sum], c[sum]);
        score
    }

    /// A score with the sums of its hypothesis, less others.
    pub(super) fn less(&self, others: &Self, sum: usize, mut score: Score) -> Score {
        let ([b, i, c], [ob, oi, oc]) = (&self.sums, &others.sums);
        score.add(b[sum] - ob[sum], i[sum] - oi[sum], c[sum] - oc[sum]);
        score
    }

    /// Adds `w b`, `w i` and `w c`, four at once.
    #[inline(always)]
    fn add(&mut self, weight: f32, products: &[[f32; W]; 3]) {
        let weighted = |product: f32| f64::from(weight * product);
        for (sums, products) in self.sums.iter_mut().zip(products) {
            let (sums, last) = sums.as_chunks_mut::<4>();
            let (products, rest) = products.as_chunks::<4>();
            for (sums, products) in sums.iter_mut().zip(products) {
                let products = products.map(weighted);
                sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
            }
            last.iter_mut().zip(rest).for_each(|(sum, product)| *sum += weighted(*product));
        }
    }
}

/// Elements of `H` that are not zero, in the form that all hypotheses share: the number of each row, and the
/// elements, column and value.
#[derive(Clone, Debug, Default)]
pub(super) struct Jacobian {
    counts: Vec<usize>,
    elements: Vec<(usize, f32)>,
}

impl Jacobian {
    /// Takes the `H` of an update.
    pub(super) fn take(&mut self, update: &Update) {
        let Self { counts, elements } = self;
        counts.clear();
        elements.clear();
        // an element that is zero at first needs no memory later
        elements.reserve(update.h.len());
        for row in update.h.chunks_exact(update.columns.len().max(1)).take(update.m) {
            let before = elements.len();
            let row = update.columns.iter().zip(row).filter(|(_, h)| **h != 0.0);
            elements.extend(row.map(|(&column, h)| (column, *h as f32)));
            counts.push(elements.len() - before);
        }
    }
}

/// Elements of `Phi - I` that are not zero, in the form that all hypotheses share.
#[derive(Clone, Default)]
pub(super) struct Changes {
    /// Rows of states that decay by themselves, with their only element.
    decays: Vec<(usize, f32)>,
    /// The other rows with the number of their elements, and the elements: column and value.
    rows: Vec<(usize, usize)>,
    elements: Vec<(usize, f32)>,
}

impl Changes {
    /// Takes the elements of a step, by row: row, column and value.
    pub(super) fn take(&mut self, all: &[(usize, usize, f32)]) {
        let Self { decays, rows, elements } = self;
        decays.clear();
        rows.clear();
        elements.clear();
        for row in all.chunk_by(|a, b| a.0 == b.0) {
            match row {
                [(i, j, a)] if i == j => decays.push((*i, *a)),
                _ => {
                    rows.push((row[0].0, row.len()));
                    elements.extend(row.iter().map(|&(_, j, a)| (j, a)));
                }
            }
        }
    }
}

/// Registers whose sums are made side by side, so that one is added to while the others wait.
const SIDE: usize = 4;

/// `out := out + sum a x`. The sums stay in registers: those of whole sides first.
#[inline(always)]
fn add<'a, S: Simd, const W: usize>(
    simd: S,
    out: &mut [f32; W],
    terms: impl Iterator<Item = (f32, &'a [f32; W])> + Clone,
) {
    let (wide, rest) = S::as_mut_simd_f32s(out);
    let (sides, singles) = wide.as_chunks_mut::<SIDE>();
    let first = sides.len() * SIDE;
    for (k, side) in sides.iter_mut().enumerate() {
        let mut sums = *side;
        for (a, x) in terms.clone() {
            let a = simd.splat_f32s(a);
            let x = &S::as_simd_f32s(x).0.as_chunks::<SIDE>().0[k];
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum = simd.add_f32s(*sum, simd.mul_f32s(a, *x));
            }
        }
        *side = sums;
    }
    for (k, single) in singles.iter_mut().enumerate() {
        let mut sum = *single;
        for (a, x) in terms.clone() {
            let x = S::as_simd_f32s(x).0[first + k];
            sum = simd.add_f32s(sum, simd.mul_f32s(simd.splat_f32s(a), x));
        }
        *single = sum;
    }
    if !rest.is_empty() {
        for (a, x) in terms {
            rest.iter_mut().zip(S::as_simd_f32s(x).1).for_each(|(sum, x)| *sum += a * x);
        }
    }
}

/// `L^-1 g`.
#[inline(always)]
fn whiten<S: Simd, const W: usize>(
    simd: S,
    (lower, m): (&[f64], usize),
    g: &Seen<W>,
    white: &mut Seen<W>,
) {
    for (row, l) in lower.chunks_exact(m.max(1)).enumerate().take(m.min(MAX_CHANNELS)) {
        let (done, rest) = white.split_at_mut(row);
        let (own, inverse) = (&mut rest[0], 1.0 / l[row]);
        *own = [0.0; W];
        add(simd, own, [(inverse as f32, &g[row])].into_iter());
        add(simd, own, done.iter().zip(l).map(|(done, l)| ((-inverse * l) as f32, done)));
    }
}

/// `sum f g` of each hypothesis over the rows.
#[inline(always)]
fn product<S: Simd, const W: usize>(simd: S, m: usize, f: &Seen<W>, g: &Seen<W>) -> [f32; W] {
    let mut all = [0.0; W];
    let (wide, rest) = S::as_mut_simd_f32s(&mut all);
    let rows = || f.iter().zip(g).take(m);
    for (k, sum) in wide.iter_mut().enumerate() {
        for (f, g) in rows() {
            let (f, g) = (S::as_simd_f32s(f).0[k], S::as_simd_f32s(g).0[k]);
            *sum = simd.add_f32s(*sum, simd.mul_f32s(f, g));
        }
    }
    for (f, g) in rows() {
        let last = S::as_simd_f32s(f).1.iter().zip(S::as_simd_f32s(g).1);
        rest.iter_mut().zip(last).for_each(|(sum, (f, g))| *sum += f * g);
    }
    all
}

/// `s := s + (Phi - I) s`.
pub(super) struct Carry<'a, const W: usize> {
    pub(super) s: &'a mut [[f32; W]],
    pub(super) work: &'a mut Work<W>,
    pub(super) changes: &'a Changes,
}

impl<const W: usize> WithSimd for Carry<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { s, work, changes: Changes { decays, rows, elements } } = self;
        let mut left = &elements[..];
        for (&(_, count), moved) in rows.iter().zip(&mut work.moved) {
            let (row, rest) = left.split_at(count);
            *moved = [0.0; W];
            add(simd, moved, row.iter().map(|&(j, a)| (a, &s[j])));
            left = rest;
        }
        // no row before reads a state that has moved
        for (&(i, _), moved) in rows.iter().zip(&work.moved) {
            add(simd, &mut s[i], [(1.0, moved)].into_iter());
        }
        for &(i, a) in decays {
            let before = s[i];
            add(simd, &mut s[i], [(a, &before)].into_iter());
        }
    }
}

/// `g = H s`.
pub(super) struct See<'a, const W: usize> {
    pub(super) s: &'a [[f32; W]],
    pub(super) jacobian: &'a Jacobian,
    pub(super) g: &'a mut Seen<W>,
}

impl<const W: usize> WithSimd for See<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { s, jacobian, g } = self;
        let mut left = &jacobian.elements[..];
        for (g, &count) in g.iter_mut().zip(&jacobian.counts) {
            let (row, rest) = left.split_at(count);
            *g = [0.0; W];
            add(simd, g, row.iter().map(|&(column, h)| (h, &s[column])));
            left = rest;
        }
    }
}

/// `s := s - K g`.
#[inline(always)]
fn correct<S: Simd, const W: usize>(
    simd: S,
    s: &mut [[f32; W]],
    (gain, m): (&[f32], usize),
    g: &Seen<W>,
) {
    for (s, gain) in s.iter_mut().zip(gain.chunks_exact(m)) {
        add(simd, s, gain.iter().zip(g).map(|(gain, g)| (-gain, g)));
    }
}

/// A sample with the sensitivity that is known before it, and that of the sample.
pub(super) struct Take<'a, const W: usize> {
    pub(super) s: &'a mut [[f32; W]],
    pub(super) work: &'a mut Work<W>,
    pub(super) sums: &'a mut Sums<W>,
    /// Sums of the samples that the gate refused, for one of them.
    pub(super) refused: Option<&'a mut Sums<W>>,
    pub(super) sample: &'a Whitened<'a>,
    pub(super) before: Option<&'a Seen<W>>,
    pub(super) g: &'a Seen<W>,
}

impl<const W: usize> WithSimd for Take<'_, W> {
    type Output = ();

    /// `b := b + w f' S^-1 y`, `i := i + w f' S^-1 f`, `c := c + w f' S^-1 g`, and `s := s - K g`.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { s, work, sums, refused, sample, before, g } = self;
        let (m, f) = (sample.update.m, before.unwrap_or(g));
        let [white, now] = &mut work.white;
        whiten(simd, (sample.lower, m), f, white);
        let i = product(simd, m, white, white);
        let c = match before {
            Some(_) => {
                whiten(simd, (sample.lower, m), g, now);
                product(simd, m, white, now)
            }
            None => i,
        };
        let mut b = [0.0; W];
        add(simd, &mut b, f.iter().zip(&sample.y).take(m).map(|(f, y)| (*y as f32, f)));
        let (weight, products) = (sample.weight as f32, [b, i, c]);
        sums.add(weight, &products);
        if let Some(refused) = refused {
            refused.add(weight, &products);
            return;
        }
        // compiled for the usual numbers of channels and for any
        match m {
            1 => correct(simd, s, (sample.gain, 1), g),
            3 => correct(simd, s, (sample.gain, 3), g),
            4 => correct(simd, s, (sample.gain, 4), g),
            m => correct(simd, s, (sample.gain, m.max(1)), g),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Arch;

    fn number(k: usize) -> f64 {
        ((k * 7919) % 1009) as f64 / 1009.0 - 0.5
    }

    /// Rows with zeros, one of them without any other element, for hypotheses that fill several registers, one,
    /// and none.
    #[test]
    fn what_a_sample_sees_is_the_product_with_all_elements() {
        fn check<const W: usize>() {
            let (n, m) = (7, 3);
            let mut update = Update::with_capacity(n, m);
            (update.m, update.columns) = (m, vec![1, 2, 4, 6]);
            update.h = (0..m * 4)
                .map(|k| if k % 3 == 0 || k / 4 == 1 { 0.0 } else { number(k) })
                .collect();
            let s: Vec<[f32; W]> =
                (0..n).map(|row| std::array::from_fn(|sum| number(row * W + sum) as f32)).collect();
            let mut jacobian = Jacobian::default();
            jacobian.take(&update);
            let mut g = [[1.0; W]; MAX_CHANNELS];
            Arch::new().dispatch(See { s: &s, jacobian: &jacobian, g: &mut g });
            for (row, g) in g[..m].iter().enumerate() {
                for (sum, g) in g.iter().enumerate() {
                    let of = update.columns.iter().zip(&update.h[row * 4..][..4]);
                    let expected: f32 = of.map(|(column, h)| *h as f32 * s[*column][sum]).sum();
                    // four products of single precision
                    assert!((g - expected).abs() < 1e-6, "{W} {row} {sum}: {g} {expected}");
                }
            }
        }
        check::<WIDE>();
        check::<OFFSETS>();
        check::<1>();
    }
}
