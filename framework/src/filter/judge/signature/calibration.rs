//! Estimate of a fixed block beside the filter, and the correction of one that was found to be wrong.
//!
//! A filter of the state and one of a constant error work in two stages (Friedland 1969). The innovations are `y = g
//! a + white`, where `g = d + H s` contains what the error `a` has moved the state by. So `b = sum f' S^-1 y` is a
//! measurement of it: `b = C a + noise`, with `C = sum f' S^-1 g` and the covariance `I = sum f' S^-1 f`, where `f` is
//! `g` as far as it is known before the sample. Without an error it is noise, and twice the log-likelihood ratio is
//! `b' I^-1 b`.
//!
//! The components of a block are estimated together: one that is wrong was not measured, and then neither were
//! the others. From a finding on, each span of ten seconds corrects the block by what is new in `a`, and the state by
//! `s` times that. The covariance contains `s M s'`, with the covariance `M` of the estimate.

use super::effect::{WIDE, Whitened};
use super::lanes::Seen;
use super::score::PARAMETER;
use crate::checkpoint::saved;
use crate::state::covariance::{backward, cholesky, forward};
use crate::units::time::Time;
use std::ops::Range;

/// Sigma of a component of which nothing is known, in its unit.
const UNKNOWN: f64 = 100.0;
/// Sigma of the components of a block that is wrong, in units of the largest error that the samples show.
const USUAL: f64 = 2.0;

/// Estimate of the components of a block.
#[derive(Clone, Default)]
pub(super) struct Calibration {
    /// Index of the first component among those that are tested, and their number.
    first: usize,
    n: usize,
    /// Set from the finding on, and its time.
    pub(super) corrects: bool,
    pub(super) since: Time,
    /// Sigma of the components before any sample.
    prior: f64,
    /// Sums `b`, `C` and `I`, matrices row-major, and those of the span.
    sums: Sums,
    span: Sums,
    /// Sum of the normalised squares of the spans, and of their dimensions.
    squares: [f64; 2],
    /// Estimate, the Cholesky factor of the inverse of its covariance, and its score at the end of the last span, and
    /// what of it is corrected.
    a: Vec<f64>,
    lower: Vec<f64>,
    score: f64,
    corrected: Vec<f64>,
    work: Work,
}

saved!(Calibration {
    first, n, corrects, since, prior, sums, span, squares, a, lower, score, corrected,
} except { work });

/// Workspace of a span: a matrix, its Cholesky factor, and vectors.
#[derive(Clone, Default)]
struct Work {
    matrix: Vec<f64>,
    noise: Vec<f64>,
    b: Vec<f64>,
    columns: Vec<f64>,
}

/// Sums of the samples.
#[derive(Clone, Default)]
struct Sums {
    b: Vec<f64>,
    c: Vec<f64>,
    i: Vec<f64>,
}

saved!(Sums { b, c, i });

impl Sums {
    fn zero(n: usize) -> Self {
        Self { b: vec![0.0; n], c: vec![0.0; n * n], i: vec![0.0; n * n] }
    }

    /// `I`. A component that no sample has shown is measured with any noise, to no effect.
    fn noise(&self, noise: &mut Vec<f64>) {
        let n = self.b.len();
        noise.clone_from(&self.i);
        let most = noise.iter().step_by(n + 1).copied().fold(0.0, f64::max);
        let floor = if most > 0.0 { 1e-9 * most } else { 1.0 };
        noise.iter_mut().step_by(n + 1).for_each(|noise| *noise += floor);
    }

    fn clear(&mut self) {
        for values in [&mut self.b, &mut self.c, &mut self.i] {
            values.fill(0.0);
        }
    }

    fn add(&mut self, other: &Self) {
        let all = [(&mut self.b, &other.b), (&mut self.c, &other.c), (&mut self.i, &other.i)];
        for (sums, others) in all {
            sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += other);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Calibration {
    pub(super) fn new(components: Range<usize>) -> Self {
        let n = components.len();
        let mut new = Self {
            first: components.start,
            n,
            sums: Sums::zero(n),
            span: Sums::zero(n),
            a: vec![0.0; n],
            lower: vec![0.0; n * n],
            corrected: vec![0.0; n],
            ..Self::default()
        };
        new.forget();
        new
    }

    /// Begins again, with no knowledge.
    pub(super) fn forget(&mut self) {
        self.sums.clear();
        self.span.clear();
        (self.prior, self.squares) = (UNKNOWN, [0.0; 2]);
        self.fit();
    }

    pub(super) fn components(&self) -> Range<usize> {
        self.first..self.first + self.n
    }

    /// Takes a sample with the sensitivities `f` in the columns from that one on, and with `L^-1 f` and `L^-1 g`.
    #[inline]
    pub(super) fn take(
        &mut self,
        column: usize,
        f: &Seen<WIDE>,
        [white, now]: [&Seen<WIDE>; 2],
        sample: &Whitened<'_>,
    ) {
        let (m, Sums { b, c, i }) = (sample.update.m, &mut self.span);
        for (row, b) in b.iter_mut().enumerate() {
            let products = f[..m].iter().zip(&sample.y);
            let sum: f64 = products.map(|(f, y)| f64::from(f[column + row]) * y).sum();
            *b += sample.weight * sum;
        }
        let rows = c.chunks_exact_mut(self.n).zip(i.chunks_exact_mut(self.n));
        for (row, (c, i)) in rows.enumerate() {
            for (other, (c, i)) in c.iter_mut().zip(i).enumerate() {
                let of = |g: &Seen<WIDE>| -> f32 {
                    let rows = white[..m].iter().zip(g);
                    rows.map(|(f, g)| f[column + row] * g[column + other]).sum()
                };
                *c += sample.weight * f64::from(of(now));
                *i += sample.weight * f64::from(of(white));
            }
        }
    }

    /// Ends a span.
    pub(super) fn measure(&mut self) {
        let Self { n, span, sums, squares, a, lower, corrected, work, .. } = self;
        if span.i.iter().all(|i| *i == 0.0) {
            return;
        }
        // the samples of a block that is corrected have only the rest of its error
        for (b, c) in span.b.iter_mut().zip(span.c.chunks_exact(*n)) {
            *b += dot(c, corrected);
        }
        let Work { matrix, noise, b, columns } = work;
        span.noise(noise);
        columns.clone_from(&span.c);
        let rows = columns.chunks_exact_mut(*n);
        rows.for_each(|row| forward(lower, *n, row));
        for (noise, row) in noise.chunks_exact_mut(*n).zip(columns.chunks_exact(*n)) {
            let others = columns.chunks_exact(*n);
            noise.iter_mut().zip(others).for_each(|(noise, other)| *noise += dot(row, other));
        }
        b.clear();
        b.extend(span.b.iter().zip(span.c.chunks_exact(*n)).map(|(b, c)| b - dot(c, a)));
        if cholesky(noise, *n, matrix) {
            forward(matrix, *n, b);
            squares[0] += dot(b, b);
            squares[1] += *n as f64;
        }
        sums.add(span);
        span.clear();
        self.fit();
    }

    /// Computes the estimate and its score, for which each further component costs what a parameter does: with `N` = `I`,
    /// `(C' N^-1 C + 1 / prior^2) a = C' N^-1 b`.
    fn fit(&mut self) {
        let scatter = self.scatter();
        let Self { n, sums, prior, a, lower, work, .. } = self;
        let (n, Work { matrix, noise, b, columns }) = (*n, work);
        sums.noise(noise);
        if !cholesky(noise, n, matrix) {
            return;
        }
        b.clone_from(&sums.b);
        forward(matrix, n, b);
        let penalty = PARAMETER * (n as f64 - 1.0);
        self.score = (dot(b, b) / scatter - penalty).max(0.0).sqrt();
        columns.clear();
        columns.extend((0..n * n).map(|k| sums.c[k % n * n + k / n]));
        columns.chunks_exact_mut(n).for_each(|column| forward(matrix, n, column));
        for (row, information) in noise.chunks_exact_mut(n).enumerate() {
            let own = &columns[row * n..][..n];
            a[row] = dot(own, b);
            let others = columns.chunks_exact(n);
            information.iter_mut().zip(others).for_each(|(i, other)| *i = dot(own, other));
            information[row] += (*prior * *prior).recip();
        }
        if cholesky(noise, n, lower) {
            forward(lower, n, a);
            backward(lower, n, a);
        }
    }

    /// Ratio of the squares of the spans to their variance, where these scatter more than they should.
    fn scatter(&self) -> f64 {
        let [squares, count] = self.squares;
        if count > 0.0 { (squares / count).max(1.0) } else { 1.0 }
    }

    /// Score in sigma of an error of the block at the end of the last span.
    pub(super) fn score(&self) -> f64 {
        self.score
    }

    /// Estimate of the components, and their sigmas.
    pub(super) fn estimate(&self) -> impl Iterator<Item = (f64, f64)> {
        let scatter = self.scatter();
        self.a.iter().enumerate().map(move |(k, a)| {
            let mut unit = vec![0.0; self.n];
            unit[k] = 1.0;
            forward(&self.lower, self.n, &mut unit);
            (*a, (scatter * dot(&unit, &unit)).sqrt())
        })
    }

    /// The estimate where the components are wrong by about as much as the one that the samples show best, or by
    /// a size.
    pub(super) fn usual(&self, size: f64) -> Self {
        let weight = |(a, sigma): (f64, f64)| (a / sigma).abs();
        let best = self.estimate().max_by(|a, b| weight(*a).total_cmp(&weight(*b)));
        let shown = best.map_or(0.0, |(a, _)| a.abs());
        let mut own = Self { prior: USUAL * shown.max(size.abs()).min(UNKNOWN), ..self.clone() };
        own.fit();
        own
    }

    /// Returns what is new in the estimate, by component, and whether that is more than is not known of it.
    pub(super) fn correct(&mut self) -> (Vec<f64>, bool) {
        let new = |((a, sigma), before): ((f64, f64), &f64)| (a - before, sigma);
        let new: Vec<(f64, f64)> = self.estimate().zip(&self.corrected).map(new).collect();
        self.corrected.copy_from_slice(&self.a);
        let moves = new.iter().any(|(change, sigma)| change.abs() > *sigma);
        (new.into_iter().map(|(change, _)| change).collect(), moves)
    }

    /// Vectors whose products with themselves sum up to the covariance of the components: `a a' + ...`. Where the
    /// innovations scatter more than they should, so does the estimate.
    pub(super) fn spread(&self) -> impl Iterator<Item = Vec<f64>> {
        let wider = self.scatter().sqrt();
        (0..self.n).map(move |k| {
            let mut column = vec![0.0; self.n];
            column[k] = wider;
            backward(&self.lower, self.n, &mut column);
            column
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Jacobian;
    use super::*;
    use crate::state::covariance::Update;
    use crate::units::sample::MAX_CHANNELS;
    use nalgebra::{DMatrix, DVector};

    /// Numbers without order between -1 and 1, of which there are several sequences.
    fn noise(k: u32, sequence: u32) -> f64 {
        // the finaliser of SplitMix64 (Steele et al. 2014)
        let mut x = (u64::from(sequence) << 32 | u64::from(k)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x ^ x >> 31) as f64 / u64::MAX as f64 * 2.0 - 1.0
    }

    /// A calibration of two components that has taken samples of one channel with the variance one in spans of 50:
    /// of each the innovation, and `f` and `g` of both components.
    fn taken(samples: u32, of: impl Fn(u32) -> (f64, [[f64; 2]; 2])) -> Calibration {
        let mut update = Update::with_capacity(1, 1);
        update.m = 1;
        let mut calibration = Calibration::new(3..5);
        for k in 0..samples {
            let (innovation, seen) = of(k);
            let mut y = [0.0; MAX_CHANNELS];
            y[0] = innovation;
            let [f, g] = seen.map(|seen| {
                let mut rows = [[0.0; WIDE]; MAX_CHANNELS];
                rows[0][3..5].copy_from_slice(&seen.map(|seen| seen as f32));
                rows
            });
            let sample = Whitened {
                update: &update,
                lower: &[1.0],
                gain: &[],
                jacobian: &Jacobian::default(),
                y,
                weight: 1.0,
                used: true,
            };
            calibration.take(3, &f, [&f, &g], &sample);
            if k % 50 == 49 {
                calibration.measure();
            }
        }
        calibration
    }

    /// The normal equations of all samples at once, with the prior of 100.
    #[test]
    fn the_estimate_is_that_of_least_squares_and_so_is_its_covariance() {
        let of = |k: u32| {
            let g = [noise(k, 1), 1.0 + noise(k, 2)];
            (0.5 * g[0] - 2.0 * g[1] + noise(k, 3), [g, g])
        };
        let calibration = taken(500, of);
        let (mut normal, mut right) = (DMatrix::zeros(2, 2), DVector::zeros(2));
        for k in 0..500 {
            let (y, [g, _]) = of(k);
            let g = DVector::from_row_slice(&g.map(|g| f64::from(g as f32)));
            right += &g * y;
            normal += &g * g.transpose();
        }
        let inverse = normal.try_inverse().unwrap_or_default();
        let expected = &inverse * right;
        for (k, (a, sigma)) in calibration.estimate().enumerate() {
            assert!((a - expected[k]).abs() < 1e-5, "{a} {expected}");
            assert!((sigma / inverse[(k, k)].sqrt() - 1.0).abs() < 1e-5, "{sigma} {inverse}");
        }
        assert!(calibration.score() > 10.0);
    }

    /// The noise `n` of a gyro is in the derivative of the velocity by the lever arm `l`, and `-n l` in the
    /// innovation. Least squares finds `-l` in it: that there is no lever arm.
    #[test]
    fn noise_that_derivative_and_innovation_share_is_no_error() {
        let n = |k| noise(k, 1);
        let innovation = |k| -3.0 * n(k) + noise(k, 2);
        let shared = taken(2000, |k| (innovation(k), [[n(k), 0.0], [n(k), 0.0]]));
        assert!(shared.estimate().next().is_some_and(|(a, _)| (a + 3.0).abs() < 0.2));
        assert!(shared.score() > 10.0);
        let apart = taken(2000, |k| (innovation(k), [[noise(k, 3), 0.0], [n(k), 0.0]]));
        assert!(apart.score() < 3.0, "{}", apart.score());
    }

    /// The samples show the first component with a sigma of `1 / sqrt(100)`; the second may be wrong by twice as much.
    #[test]
    fn a_component_that_no_sample_shows_is_wrong_by_as_much_as_the_others() {
        let calibration = taken(100, |_| (4.0, [[1.0, 0.0], [1.0, 0.0]])).usual(0.0);
        let estimate: Vec<(f64, f64)> = calibration.estimate().collect();
        assert!((estimate[0].0 - 4.0).abs() < 1e-2 && estimate[0].1 < 0.11, "{estimate:?}");
        assert!(estimate[1].0 == 0.0 && (estimate[1].1 - 8.0).abs() < 1e-2, "{estimate:?}");
    }

    /// An error of 0.4 with the sigma 0.1: 16 in twice the log-likelihood ratio, of which a second parameter costs 6.
    #[test]
    fn each_further_component_costs_what_a_parameter_does() {
        let calibration = taken(100, |_| (0.4, [[1.0, 0.0], [1.0, 0.0]]));
        assert!((calibration.score() - 10_f64.sqrt()).abs() < 1e-3, "{}", calibration.score());
    }
}
