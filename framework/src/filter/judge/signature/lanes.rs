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

/// Largest number of registers that a row fills: one for each number on a processor without vectors.
const REGISTERS: usize = WIDE;

/// `out := out + sum a x`.
#[inline(always)]
fn add<'a, S: Simd, const W: usize>(
    simd: S,
    out: &mut [f32; W],
    terms: impl Iterator<Item = (f32, &'a [f32; W])>,
) {
    let (wide, rest) = S::as_mut_simd_f32s(out);
    let mut sums = [simd.splat_f32s(0.0); REGISTERS];
    sums.iter_mut().zip(&*wide).for_each(|(sum, out)| *sum = *out);
    for (a, x) in terms {
        let ((x, last), all) = (S::as_simd_f32s(x), simd.splat_f32s(a));
        for (sum, x) in sums.iter_mut().zip(x) {
            *sum = simd.add_f32s(*sum, simd.mul_f32s(all, *x));
        }
        rest.iter_mut().zip(last).for_each(|(sum, x)| *sum += a * x);
    }
    wide.iter_mut().zip(sums).for_each(|(out, sum)| *out = sum);
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
    let mut sums = [simd.splat_f32s(0.0); REGISTERS];
    for (f, g) in f.iter().zip(g).take(m) {
        let ((f, f_last), (g, g_last)) = (S::as_simd_f32s(f), S::as_simd_f32s(g));
        for (sum, (f, g)) in sums.iter_mut().zip(f.iter().zip(g)) {
            *sum = simd.add_f32s(*sum, simd.mul_f32s(*f, *g));
        }
        let last = f_last.iter().zip(g_last);
        rest.iter_mut().zip(last).for_each(|(sum, (f, g))| *sum += f * g);
    }
    wide.iter_mut().zip(sums).for_each(|(all, sum)| *all = sum);
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
    pub(super) update: &'a Update,
    pub(super) g: &'a mut Seen<W>,
}

impl<const W: usize> WithSimd for See<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { s, update, g } = self;
        let w = update.columns.len();
        for (g, h) in g.iter_mut().zip(update.h.chunks_exact(w.max(1))).take(update.m) {
            *g = [0.0; W];
            add(simd, g, update.columns.iter().zip(h).map(|(&column, h)| (*h as f32, &s[column])));
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
