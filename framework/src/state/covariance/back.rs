//! Products of the backward recursion of a smoother, with the symmetric matrix `X` of the
//! information that later samples give.
//!
//! As in [`super::kernel`], the loops are written once and compiled twice, with the same bits.

use super::Covariance;
use super::kernel::Kernel;
use pulp::{Arch, Simd, WithSimd};

/// Transitions of one pattern, passed backward: `X = Phi' X Phi`.
#[derive(Clone, Debug)]
pub(crate) struct BackwardStep {
    /// `(row, column)` of each declared element of `Phi`.
    places: Vec<(usize, usize)>,
    /// Changed rows of `Phi`, and the place of each element's row among them.
    rows: Vec<usize>,
    place: Vec<usize>,
    /// Kernel of `Phi'`. Its last value is the one on the diagonal of the rows that `Phi` keeps.
    kernel: Kernel,
    phi: Vec<f64>,
    work: Vec<f64>,
}

impl BackwardStep {
    /// Prepares for transitions with these elements of an error state of dimension `n`.
    pub(crate) fn new(n: usize, places: &[(usize, usize)]) -> Self {
        let mut rows: Vec<usize> = places.iter().map(|p| p.0).collect();
        rows.sort_unstable();
        rows.dedup();
        let place = places.iter().filter_map(|p| rows.binary_search(&p.0).ok()).collect();
        // elements of Phi': those of Phi with row and column exchanged
        let mut declared: Vec<_> = places.iter().map(|&(i, j)| (j, i)).collect();
        let mut kept: Vec<usize> = places.iter().map(|p| p.1).collect();
        kept.sort_unstable();
        kept.dedup();
        kept.retain(|column| rows.binary_search(column).is_err());
        // rows that Phi keeps have no declared element
        declared.extend(kept.iter().map(|&k| (k, k)));
        // a changed row whose column no element reads becomes zero
        let zeros: Vec<usize> =
            rows.iter().copied().filter(|row| !declared.iter().any(|p| p.0 == *row)).collect();
        declared.extend(zeros.iter().map(|&k| (k, k)));
        let mut phi = vec![0.0; declared.len()];
        phi[places.len()..places.len() + kept.len()].fill(1.0);
        Self {
            kernel: Kernel::new(n, &declared),
            places: places.to_vec(),
            rows,
            place,
            phi,
            work: Vec::new(),
        }
    }

    /// `(row, column)` of each declared element of `Phi`.
    pub(crate) fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    /// `X = Phi' X Phi`.
    pub(crate) fn pass(&mut self, phi: &[f64], x: &mut Covariance) {
        self.phi[..phi.len()].copy_from_slice(phi);
        self.kernel.propagate(&self.phi, x);
    }

    /// `A = Phi' A`, with rows of `width`.
    pub(crate) fn carry(&mut self, phi: &[f64], a: &mut [f64], width: usize) {
        self.work.clear();
        for row in &self.rows {
            let row = &mut a[row * width..][..width];
            self.work.extend_from_slice(row);
            row.fill(0.0);
        }
        if width == 1 {
            for ((value, &(_, column)), place) in phi.iter().zip(&self.places).zip(&self.place) {
                a[column] += value * self.work[*place];
            }
            return;
        }
        for ((value, &(_, column)), place) in phi.iter().zip(&self.places).zip(&self.place) {
            add(&mut a[column * width..][..width], *value, &self.work[place * width..][..width]);
        }
    }
}

/// A correction, passed backward: `X = (I - K H)' X (I - K H) + H' V H`.
///
/// With `L = X K` and `W = V + K' L` this is `X - U H - H' U'` with `U = L - H' W / 2`, so that only
/// the rows and columns of the measured states change, and the result is symmetric to the bit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BackwardCorrection<'a> {
    pub(crate) columns: &'a [usize],
    /// Jacobian over the columns, row-major.
    pub(crate) h: &'a [f64],
    /// Gain, row-major.
    pub(crate) gain: &'a [f64],
}

impl BackwardCorrection<'_> {
    /// Passes over the correction. `weight` has `V`, row-major, and receives `W`; `work` grows
    /// once.
    pub(crate) fn pass(&self, x: &mut Covariance, weight: &mut [f64], work: &mut Vec<f64>) {
        Arch::new().dispatch(Correction { correction: self, x, weight, work });
    }

    #[inline(always)]
    fn pass_with(&self, x: &mut Covariance, weight: &mut [f64], work: &mut Vec<f64>) {
        let Self { columns, h, gain } = *self;
        let (n, stride, w, m) = (x.n, x.stride, columns.len(), weight.len().isqrt());
        work.clear();
        work.resize((m + 1) * stride, 0.0);
        let (row, u) = work.split_at_mut(stride);
        // L' = K' X
        for (a, u) in u.chunks_exact_mut(stride).enumerate() {
            for (x, gain) in x.p.chunks_exact(stride).zip(gain.chunks_exact(m)) {
                add(u, gain[a], x);
            }
        }
        for (weight, u) in weight.chunks_exact_mut(m).zip(u.chunks_exact(stride)) {
            for (u, gain) in u[..n].iter().zip(gain.chunks_exact(m)) {
                weight.iter_mut().zip(gain).for_each(|(weight, k)| *weight += u * k);
            }
        }
        for a in 0..m {
            for b in 0..a {
                let mean = 0.5 * (weight[a * m + b] + weight[b * m + a]);
                (weight[a * m + b], weight[b * m + a]) = (mean, mean);
            }
        }
        for (weight, u) in weight.chunks_exact(m).zip(u.chunks_exact_mut(stride)) {
            for (weight, h) in weight.iter().zip(h.chunks_exact(w)) {
                columns.iter().zip(h).for_each(|(&c, h)| u[c] -= 0.5 * weight * h);
            }
        }
        for (k, &c) in columns.iter().enumerate() {
            row.fill(0.0);
            for (a, u) in u.chunks_exact(stride).enumerate() {
                add(row, h[a * w + k], u);
            }
            add(&mut x.p[c * stride..][..stride], -1.0, row);
            for (x, v) in x.p.chunks_exact_mut(stride).zip(&*row) {
                x[c] -= v;
            }
        }
    }
}

struct Correction<'a, 'b> {
    correction: &'a BackwardCorrection<'b>,
    x: &'a mut Covariance,
    weight: &'a mut [f64],
    work: &'a mut Vec<f64>,
}

impl WithSimd for Correction<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.correction.pass_with(self.x, self.weight, self.work);
    }
}

/// Product `P X P` of symmetric matrices.
struct Sandwich<'a> {
    p: &'a Covariance,
    x: &'a Covariance,
    work: &'a mut Vec<f64>,
    out: &'a mut Covariance,
}

impl WithSimd for Sandwich<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { p, x, work, out } = self;
        let stride = p.stride;
        work.resize(p.p.len(), 0.0);
        for (x, row) in x.p.chunks_exact(stride).take(x.n).zip(work.chunks_exact_mut(stride)) {
            product(&x[..p.n], &p.p, stride, row);
        }
        for (i, p) in p.p.chunks_exact(stride).enumerate().take(p.n) {
            let half = (i + 1).next_multiple_of(4);
            product(&p[..out.n], work, stride, &mut out.p[i * stride..][..half]);
        }
        out.mirror();
    }
}

/// `P X P` of symmetric matrices of one dimension; `work` grows once.
pub(crate) fn sandwich(p: &Covariance, x: &Covariance, work: &mut Vec<f64>, out: &mut Covariance) {
    Arch::new().dispatch(Sandwich { p, x, work, out });
}

/// `out = a X` for a row `a`, with `out` as long as a multiple of four.
#[inline(always)]
fn product(a: &[f64], x: &[f64], stride: usize, out: &mut [f64]) {
    let mut at = 0;
    while at < out.len() {
        at += match out.len() - at {
            4 => accumulate::<4>(a, x, stride, at, out),
            8 => accumulate::<8>(a, x, stride, at, out),
            12 => accumulate::<12>(a, x, stride, at, out),
            16 => accumulate::<16>(a, x, stride, at, out),
            _ => accumulate::<20>(a, x, stride, at, out),
        };
    }
}

/// `W` columns of one row of the product, kept in registers.
#[inline(always)]
fn accumulate<const W: usize>(
    a: &[f64],
    x: &[f64],
    stride: usize,
    at: usize,
    out: &mut [f64],
) -> usize {
    let mut sum = [0.0; W];
    for (a, x) in a.iter().zip(x.chunks_exact(stride)) {
        if let Some(x) = x[at..].first_chunk::<W>() {
            for (s, x) in sum.iter_mut().zip(x) {
                *s += a * x;
            }
        }
    }
    out[at..at + W].copy_from_slice(&sum);
    W
}

/// `a += f b`.
#[inline(always)]
fn add(a: &mut [f64], f: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += f * b;
    }
}
