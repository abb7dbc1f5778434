//! Measurement update of the covariance.

use super::Covariance;
use super::rank::{Joseph, Projection};
use crate::state::block_set::BlockSet;
use crate::units::sample::{MAX_CHANNELS, channels};
use pulp::Arch;
use std::ops::Range;

/// Work space of an update: innovation, Jacobian and gain, allocated once.
#[derive(Debug, Default)]
pub struct Update {
    /// Number of measured components.
    pub m: usize,
    /// Columns of the error state that the Jacobian touches.
    pub columns: Vec<usize>,
    /// Blocks of these columns.
    pub read: BlockSet,
    /// The Jacobian over `columns`, row-major `m` x `columns.len()`.
    pub h: Vec<f64>,
    /// Innovation `z [-] h(x)`.
    pub innovation: Vec<f64>,
    /// Measurement noise covariance, row-major `m` x `m`.
    pub r: Vec<f64>,
    /// Innovation covariance `H P H' + R`, row-major `m` x `m`.
    pub s: Vec<f64>,
    /// The correction of the error state.
    pub delta: Vec<f64>,
    pub(super) lower: Vec<f64>,
    /// `H` by columns, each padded to a multiple of four.
    pub(super) ht: Vec<f64>,
    /// `H P`: one row for each component, padded as those of the covariance.
    pub(super) hp: Vec<f64>,
    /// The gain transposed, likewise.
    pub(super) kt: Vec<f64>,
    pub(super) gain: Vec<f64>,
    /// Rows of `G` of [`Self::direction`].
    pub(super) l: Vec<f64>,
    /// Groups of columns in which `H P` is not zero.
    pub(super) reached: Vec<Range<usize>>,
    pub(super) work: Vec<f64>,
    pub(super) processor: Arch,
}

impl Clone for Update {
    fn clone(&self) -> Self {
        let mut update = Self::default();
        update.clone_from(self);
        update
    }

    fn clone_from(&mut self, from: &Self) {
        self.m = from.m;
        self.columns.clone_from(&from.columns);
        self.read.clone_from(&from.read);
        self.h.clone_from(&from.h);
        self.innovation.clone_from(&from.innovation);
        self.r.clone_from(&from.r);
        self.s.clone_from(&from.s);
        self.delta.clone_from(&from.delta);
        self.lower.clone_from(&from.lower);
        self.ht.clone_from(&from.ht);
        self.hp.clone_from(&from.hp);
        self.kt.clone_from(&from.kt);
        self.gain.clone_from(&from.gain);
        self.l.clone_from(&from.l);
        self.reached.clone_from(&from.reached);
        self.work.clone_from(&from.work);
        self.processor = from.processor;
    }
}

impl Update {
    /// Work space for an error state of dimension `n` and up to `m` components.
    pub fn with_capacity(n: usize, m: usize) -> Self {
        Self {
            m: 0,
            columns: Vec::with_capacity(n),
            read: BlockSet::default(),
            h: Vec::with_capacity(m * n),
            innovation: Vec::with_capacity(m),
            r: Vec::with_capacity(m * m),
            s: Vec::with_capacity(m * m),
            delta: vec![0.0; n],
            lower: Vec::with_capacity(m * m),
            ht: Vec::with_capacity(n * m.next_multiple_of(4)),
            hp: Vec::with_capacity(m * n.next_multiple_of(4)),
            kt: Vec::with_capacity(m * n.next_multiple_of(4)),
            gain: Vec::with_capacity(n * m),
            l: Vec::with_capacity(n * m),
            processor: Arch::new(),
            reached: Vec::with_capacity(n.div_ceil(8)),
            work: Vec::with_capacity((m + 2 * n) * m.next_multiple_of(4)),
        }
    }

    /// Keeps the rows of some of the channels that are present.
    pub(crate) fn restrict(&mut self, present: u16, keep: u16) {
        let (m, w) = (self.m, self.columns.len());
        let kept = || {
            let rows = channels(present).enumerate().take(m);
            rows.filter(move |(_, channel)| keep >> channel & 1 == 1).map(|(row, _)| row)
        };
        let k = kept().count();
        for (to, from) in kept().enumerate() {
            self.h.copy_within(from * w..(from + 1) * w, to * w);
            self.innovation[to] = self.innovation[from];
            for (j, column) in kept().enumerate() {
                self.r[to * k + j] = self.r[from * m + column];
            }
        }
        self.innovation.truncate(k);
        self.r.truncate(k * k);
        self.m = k;
    }

    /// The gain of the last [`Self::apply`], row-major `n` x `m`.
    pub fn gain(&self) -> &[f64] {
        &self.gain
    }

    /// `P H'` of the last [`Self::innovate`], row-major `n` x `m`: the covariance of the error with
    /// the innovation.
    pub fn cross_covariance(&self) -> impl Iterator<Item = f64> + '_ {
        let stride = self.hp.len() / self.m.max(1);
        (0..self.delta.len() * self.m).map(move |k| self.hp[k % self.m * stride + k / self.m])
    }

    /// Computes `S = H P H' + R` and the normalised innovation squared, which may be infinite;
    /// `None` if `S` is not positive definite.
    pub fn innovate(&mut self, covariance: &Covariance) -> Option<f64> {
        let m = self.m;
        self.processor.dispatch(Projection { update: self, covariance });
        if !cholesky(&self.s, m, &mut self.lower) {
            return None;
        }
        self.work.clear();
        self.work.extend_from_slice(&self.innovation);
        forward(&self.lower, m, &mut self.work);
        let nis: f64 = self.work.iter().map(|y| y * y).sum();
        (!nis.is_nan()).then_some(nis)
    }

    /// Divides the noise by the weight that each channel gets for its normalised innovation, and
    /// returns `true` if any weight differs from one: `S` has then to be computed again. Call after
    /// [`Self::innovate`].
    pub(crate) fn weigh(&mut self, weight: impl Fn(f64) -> f64) -> bool {
        let m = self.m;
        let mut roots = [1.0; MAX_CHANNELS];
        for (a, root) in roots[..m].iter_mut().enumerate() {
            *root = weight(self.innovation[a] / self.s[a * m + a].sqrt()).sqrt();
        }
        if roots[..m].iter().all(|root| *root == 1.0) {
            return false;
        }
        (0..m * m).for_each(|k| self.r[k] /= roots[k / m] * roots[k % m]);
        true
    }

    /// `P = P + 100 e e'` on the diagonal, with the error `e` of some columns that explains an innovation
    /// beyond the gate `y^2 <= threshold S`, for each channel alone: an error that is independent of all
    /// others, of which an update removes 99 % at least. Call after [`Self::innovate`].
    pub(crate) fn free(&self, covariance: &mut Covariance, columns: Range<usize>, threshold: f64) {
        let rows = self.h.chunks_exact(self.columns.len().max(1)).zip(&self.innovation);
        for (i, (row, y)) in rows.enumerate().take(self.m) {
            if y * y <= threshold * self.s[i * (self.m + 1)] {
                continue;
            }
            let of = || self.columns.iter().zip(row).filter(|(column, _)| columns.contains(column));
            let square: f64 = of().map(|(_, h)| h * h).sum();
            for (&k, h) in of().filter(|(_, h)| **h != 0.0) {
                let error = y * h / square;
                covariance.set(k, k, covariance.get(k, k) + 100.0 * error * error);
            }
        }
    }

    /// `P = P + c G A G'` with `A = H P H'` and `G` as in [`Self::direction`]: the measured
    /// combination of states becomes `1 + c` times as uncertain. Returns `false` where there is no
    /// such direction. Call after [`Self::innovate`], and before another.
    pub(crate) fn inflate(
        &mut self,
        covariance: &mut Covariance,
        considered: &[bool],
        c: f64,
    ) -> bool {
        if !self.direction(covariance, considered) {
            return false;
        }
        let rows = self.columns.iter().copied().zip(self.l.chunks_exact(self.m));
        self.add(covariance, rows, c);
        true
    }

    /// `P = P + c N A N'` with `N` of [`Self::unseen`]: inflates the states that an error of the
    /// size added by [`Self::inflate`] has reached without being measured. `H N = 0`, so the sample
    /// carries no information about them.
    pub(crate) fn inflate_unseen(&self, covariance: &mut Covariance, unseen: &[f64], c: f64) {
        self.add(covariance, unseen.chunks_exact(self.m).enumerate(), c);
    }

    /// `P = P + c G A G'`, from the rows of `G` that are not zero.
    fn add<'a>(
        &self,
        covariance: &mut Covariance,
        rows: impl Iterator<Item = (usize, &'a [f64])> + Clone,
        c: f64,
    ) {
        let m = self.m;
        for (i, g) in rows.clone() {
            for (j, f) in rows.clone() {
                let sum: f64 =
                    (0..m * m).map(|k| g[k / m] * (self.s[k] - self.r[k]) * f[k % m]).sum();
                covariance.p[i * covariance.stride + j] += c * sum;
            }
        }
        covariance.symmetrise();
    }

    /// `G = D H' (H D H')^-1` with `D` the diagonal of `P`, over `columns`, into `l`: distributes a
    /// measured error among the states in proportion to their uncertainty and sensitivity.
    /// `considered` states get no share, since their variance is given. Returns `false` where there
    /// is no such direction. Call after [`Self::innovate`].
    pub(super) fn direction(&mut self, covariance: &Covariance, considered: &[bool]) -> bool {
        let (m, w) = (self.m, self.columns.len());
        let columns = &self.columns;
        let variance = |k: usize| {
            if considered[columns[k]] { 0.0 } else { covariance.get(columns[k], columns[k]) }
        };
        // H D H'; 1e-9 S keeps it invertible where a channel measures nothing uncertain
        self.work.clear();
        for a in 0..m {
            for b in 0..m {
                let (ha, hb) = (&self.h[a * w..a * w + w], &self.h[b * w..b * w + w]);
                let sum: f64 = (0..w).map(|k| ha[k] * variance(k) * hb[k]).sum();
                self.work.push(sum + 1e-9 * self.s[a * m + b]);
            }
        }
        if !cholesky(&self.work, m, &mut self.lower) {
            return false;
        }
        self.l.clear();
        for k in 0..w {
            self.l.extend((0..m).map(|a| self.h[a * w + k] * variance(k)));
        }
        for row in self.l.chunks_exact_mut(m) {
            forward(&self.lower, m, row);
            backward(&self.lower, m, row);
        }
        true
    }

    /// The gain `P H' S^-1` (zero rows for `considered` columns), the correction, and the Joseph
    /// update `P = (I - K H) P (I - K H)' + K R K'` (Groves eq. 3.58), which holds for any gain.
    /// After [`Self::innovate`].
    pub fn apply(&mut self, covariance: &mut Covariance, considered: &[bool]) {
        self.processor.dispatch(Joseph { update: self, covariance, considered });
        let m = self.m;
        self.gain.resize(covariance.n * m, 0.0);
        for (a, kt) in self.kt.chunks_exact(covariance.stride).enumerate() {
            self.gain.chunks_exact_mut(m).zip(kt).for_each(|(gain, k)| gain[a] = *k);
        }
    }
}

/// The lower Cholesky factor of `s`, row-major `m` x `m`; `false` if it is not positive definite.
pub(crate) fn cholesky(s: &[f64], m: usize, lower: &mut Vec<f64>) -> bool {
    lower.clear();
    lower.resize(m * m, 0.0);
    for i in 0..m {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| lower[i * m + k] * lower[j * m + k]).sum();
            let d = s[i * m + j] - sum;
            if i == j {
                if !(d > 0.0 && d.is_finite()) {
                    return false;
                }
                lower[i * m + i] = d.sqrt();
            } else {
                lower[i * m + j] = d / lower[j * m + j];
            }
        }
    }
    true
}

/// Solves `L y = b` in place.
pub(crate) fn forward(lower: &[f64], m: usize, b: &mut [f64]) {
    for i in 0..m {
        let sum: f64 = (0..i).map(|k| lower[i * m + k] * b[k]).sum();
        b[i] = (b[i] - sum) / lower[i * m + i];
    }
}

/// Solves `L' x = y` in place.
pub(crate) fn backward(lower: &[f64], m: usize, y: &mut [f64]) {
    for i in (0..m).rev() {
        let sum: f64 = (i + 1..m).map(|k| lower[k * m + i] * y[k]).sum();
        y[i] = (y[i] - sum) / lower[i * m + i];
    }
}

#[cfg(test)]
mod tests;
