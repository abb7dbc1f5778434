//! The measurement update.

use super::Covariance;

/// The work space of one update: innovation, Jacobian and gain, allocated once.
#[derive(Clone, Debug, Default)]
pub struct Update {
    /// Number of measured components.
    pub m: usize,
    /// Columns of the error state that the Jacobian touches.
    pub columns: Vec<usize>,
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
    lower: Vec<f64>,
    l: Vec<f64>,
    gain: Vec<f64>,
    work: Vec<f64>,
}

impl Update {
    /// Work space for an error state of dimension `n` and up to `m` components.
    pub fn with_capacity(n: usize, m: usize) -> Self {
        Self {
            m: 0,
            columns: Vec::with_capacity(n),
            h: Vec::with_capacity(m * n),
            innovation: Vec::with_capacity(m),
            r: Vec::with_capacity(m * m),
            s: Vec::with_capacity(m * m),
            delta: vec![0.0; n],
            lower: Vec::with_capacity(m * m),
            l: Vec::with_capacity(n * m),
            gain: Vec::with_capacity(n * m),
            work: Vec::with_capacity(n * n.max(m)),
        }
    }

    /// Computes `S = H P H' + R` and the normalised innovation squared, which may be infinite; `None` if `S` is
    /// not positive definite.
    pub fn innovate(&mut self, covariance: &Covariance) -> Option<f64> {
        let (n, m, w) = (covariance.n, self.m, self.columns.len());
        self.l.clear();
        for i in 0..n {
            let row = &covariance.p[i * covariance.stride..][..n];
            for a in 0..m {
                let h = &self.h[a * w..a * w + w];
                self.l.push(h.iter().zip(&self.columns).map(|(h, &c)| h * row[c]).sum());
            }
        }
        self.s.clear();
        self.s.extend_from_slice(&self.r);
        for a in 0..m {
            for b in 0..m {
                let h = &self.h[a * w..a * w + w];
                self.s[a * m + b] += h.iter().zip(&self.columns).map(|(h, &c)| h * self.l[c * m + b]).sum::<f64>();
            }
        }
        if !cholesky(&self.s, m, &mut self.lower) {
            return None;
        }
        self.work.clear();
        self.work.extend_from_slice(&self.innovation);
        forward(&self.lower, m, &mut self.work);
        let nis: f64 = self.work.iter().map(|y| y * y).sum();
        (!nis.is_nan()).then_some(nis)
    }

    /// `P = P + c G A G'` with `A = H P H'`, `G = D H' (H D H')^-1` and `D` the diagonal of `P`: what the sensor sees
    /// becomes `1 + c` times as uncertain, by noise on each state in proportion to how uncertain it is and how much it is
    /// seen, and on no other. `considered` states, whose variance is a statement, keep theirs. `false` if nothing can be
    /// done. After [`Self::innovate`], and before another.
    pub(crate) fn inflate(&mut self, covariance: &mut Covariance, considered: &[bool], c: f64) -> bool {
        let (m, w, stride) = (self.m, self.columns.len(), covariance.stride);
        let columns = &self.columns;
        let variance = |k: usize| if considered[columns[k]] { 0.0 } else { covariance.get(columns[k], columns[k]) };
        // H D H', which 1e-9 S keeps invertible where some channel sees nothing uncertain
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
        for (i, g) in self.l.chunks_exact(m).enumerate() {
            for (j, f) in self.l.chunks_exact(m).enumerate() {
                let sum: f64 = (0..m * m).map(|k| g[k / m] * (self.s[k] - self.r[k]) * f[k % m]).sum();
                covariance.p[columns[i] * stride + columns[j]] += c * sum;
            }
        }
        covariance.symmetrise();
        true
    }

    /// The gain `P H' S^-1` (zero rows for `considered` columns), the correction, and the Joseph update
    /// `P = (I - K H) P (I - K H)' + K R K'` (Groves eq. 3.58), which holds for any gain. After [`Self::innovate`].
    pub fn apply(&mut self, covariance: &mut Covariance, considered: &[bool]) {
        let (n, m, w, stride) = (covariance.n, self.m, self.columns.len(), covariance.stride);
        self.gain.clear();
        self.gain.extend_from_slice(&self.l);
        for (i, row) in self.gain.chunks_exact_mut(m).enumerate() {
            if considered[i] {
                row.fill(0.0);
            } else {
                forward(&self.lower, m, row);
                backward(&self.lower, m, row);
            }
            self.delta[i] = row.iter().zip(&self.innovation).map(|(k, y)| k * y).sum();
        }
        // A = (I - K H) P = P - K L'
        let p = &mut covariance.p;
        for i in 0..n {
            let k = &self.gain[i * m..i * m + m];
            for j in 0..n {
                let l = &self.l[j * m..j * m + m];
                p[i * stride + j] -= k.iter().zip(l).map(|(k, l)| k * l).sum::<f64>();
            }
        }
        // A (I - K H)' + K R K' = A - (A H' - K R) K'
        self.work.clear();
        for i in 0..n {
            for a in 0..m {
                let h = &self.h[a * w..a * w + w];
                let ah: f64 = h.iter().zip(&self.columns).map(|(h, &c)| h * p[i * stride + c]).sum();
                let kr: f64 = (0..m).map(|b| self.gain[i * m + b] * self.r[b * m + a]).sum();
                self.work.push(ah - kr);
            }
        }
        for i in 0..n {
            let d = &self.work[i * m..i * m + m];
            for j in 0..n {
                let k = &self.gain[j * m..j * m + m];
                p[i * stride + j] -= d.iter().zip(k).map(|(d, k)| d * k).sum::<f64>();
            }
        }
        covariance.symmetrise();
    }
}

/// The lower Cholesky factor of `s`, row-major `m` x `m`; `false` if it is not positive definite.
fn cholesky(s: &[f64], m: usize, lower: &mut Vec<f64>) -> bool {
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
fn forward(lower: &[f64], m: usize, b: &mut [f64]) {
    for i in 0..m {
        let sum: f64 = (0..i).map(|k| lower[i * m + k] * b[k]).sum();
        b[i] = (b[i] - sum) / lower[i * m + i];
    }
}

/// Solves `L' x = y` in place.
fn backward(lower: &[f64], m: usize, y: &mut [f64]) {
    for i in (0..m).rev() {
        let sum: f64 = (i + 1..m).map(|k| lower[k * m + i] * y[k]).sum();
        y[i] = (y[i] - sum) / lower[i * m + i];
    }
}
