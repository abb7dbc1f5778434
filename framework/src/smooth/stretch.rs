//! Stretches of the run as one step: the sums of the backward recursion for a boundary that stays
//! in place, so that the steps after the boundary need not be passed again for every estimate.
//!
//! `M` leads the error across a stretch, and `b`, `C` are the adjoint and its covariance at its
//! beginning, from the samples within. A stretch from `t` to the boundary and one from there to the
//! present then give, at `t`,
//! ```text
//! lambda = b1 + M1' b2                              Lambda = C1 + M1' C2 M1
//! ```
//! Beside considered states, the covariance `Omega` of the adjoint also has the samples of the
//! first stretch with the information of the second one:
//! ```text
//! Omega = O1 + M1' O2 M1 + M1' C2 X1 + (M1' C2 X1)',     X = sum M+ (C S^-1 H) M-
//! ```
//! with the products `M-` before and `M+` after each sample, and its `C = G (P H' - K S)`.

use super::adjoint::Correction;
use crate::state::Layout;
use crate::state::covariance::{BackwardStep, Transition, Update, backward, cholesky, forward};
use nalgebra::DMatrix;

/// Products of the maps from a time to the boundary, in the backward pass.
#[derive(Clone, Debug)]
pub(super) struct Products {
    n: usize,
    /// `M'` and, beside considered states, `X'`, row-major.
    pub(super) map: Vec<f64>,
    pub(super) mixed: Vec<f64>,
}

impl Products {
    /// No step up to the boundary.
    pub(super) fn identity(n: usize, considers: bool) -> Self {
        let mut map = vec![0.0; n * n];
        (0..n).for_each(|i| map[i * n + i] = 1.0);
        Self { n, map, mixed: vec![0.0; if considers { n * n } else { 0 }] }
    }

    fn squares(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        [&mut self.map, &mut self.mixed].into_iter().filter(|square| !square.is_empty())
    }

    /// Passes over a transition.
    pub(super) fn pass(&mut self, step: &mut BackwardStep, phi: &[f64]) {
        let n = self.n;
        self.squares().for_each(|square| step.carry(phi, square, n));
    }

    /// Passes over the reset after the injection of `delta`.
    pub(super) fn reset(&mut self, layout: &Layout, delta: &[f64]) {
        let n = self.n;
        self.squares().for_each(|square| layout.reset_back(delta, square, n));
    }

    /// Passes over a correction whose reset has been passed: `M' = A' M'` and
    /// `X' = A' X' + H' S^-1 C' M'`. `solved` is `S^-1 H`, and `remaining` is `C` before the reset.
    pub(super) fn correct(
        &mut self,
        correction: &Correction<'_>,
        solved: &DMatrix<f64>,
        remaining: Option<&DMatrix<f64>>,
    ) {
        let n = self.n;
        let &Correction { m, columns, .. } = correction;
        let mut seen = vec![0.0; m * n];
        if let Some(remaining) = remaining {
            subtract(&mut self.mixed, &mut seen, n, correction);
            seen.fill(0.0);
            for (i, row) in self.map.chunks_exact(n).enumerate() {
                for (a, seen) in seen.chunks_exact_mut(n).enumerate() {
                    if remaining[(i, a)] != 0.0 {
                        add(seen, remaining[(i, a)], row);
                    }
                }
            }
            for (k, &c) in columns.iter().enumerate() {
                for (a, seen) in seen.chunks_exact(n).enumerate() {
                    add(&mut self.mixed[c * n..][..n], solved[(a, k)], seen);
                }
            }
            seen.fill(0.0);
        }
        subtract(&mut self.map, &mut seen, n, correction);
    }
}

/// `X = (I - K H)' X`, with zeros in `seen` before.
fn subtract(x: &mut [f64], seen: &mut [f64], n: usize, correction: &Correction<'_>) {
    let &Correction { m, columns, h, gain, .. } = correction;
    let w = columns.len();
    for (row, gain) in x.chunks_exact(n).zip(gain.chunks_exact(m)) {
        for (seen, k) in seen.chunks_exact_mut(n).zip(gain) {
            add(seen, *k, row);
        }
    }
    for (k, &c) in columns.iter().enumerate() {
        for (a, seen) in seen.chunks_exact(n).enumerate() {
            add(&mut x[c * n..][..n], -h[a * w + k], seen);
        }
    }
}

/// The steps from the boundary to the present, which the filter adds one by one.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    n: usize,
    /// Length of the rows of `map` and `mixed`: a multiple of four.
    stride: usize,
    /// `M` and, beside considered states, `X`.
    map: Vec<f64>,
    mixed: Vec<f64>,
    considered: Vec<bool>,
    pub(super) lambda: Vec<f64>,
    /// `C` and, beside considered states, `O`, with rows of `n`.
    pub(super) information: Vec<f64>,
    pub(super) spread: Vec<f64>,
    /// Set while there is no step.
    pub(super) empty: bool,
    work: Vec<f64>,
}

impl Stretch {
    pub(super) fn new(n: usize, considered: &[bool]) -> Self {
        let stride = n.max(1).next_multiple_of(4);
        let considers = considered.contains(&true);
        let size = |any: bool, width: usize| if any { n * width } else { 0 };
        let mut stretch = Self {
            n,
            stride,
            map: vec![0.0; n * stride],
            mixed: vec![0.0; size(considers, stride)],
            considered: if considers { considered.to_vec() } else { Vec::new() },
            lambda: vec![0.0; n],
            information: vec![0.0; n * n],
            spread: vec![0.0; size(considers, n)],
            empty: true,
            work: Vec::new(),
        };
        stretch.clear();
        stretch
    }

    /// Moves the boundary to the present.
    pub(super) fn clear(&mut self) {
        let Self { map, mixed, lambda, information, spread, .. } = self;
        [map, mixed, lambda, information, spread].into_iter().for_each(|sums| sums.fill(0.0));
        (0..self.n).for_each(|i| self.map[i * self.stride + i] = 1.0);
        self.empty = true;
    }

    /// `M = Phi M`.
    pub(super) fn transition(&mut self, transition: &Transition) {
        let Self { map, mixed, stride, work, .. } = self;
        for square in [map, mixed].into_iter().filter(|s| !s.is_empty()) {
            transition.carry(square, *stride, work);
        }
        self.empty = false;
    }

    /// `b = b + (H M)' S^-1 y`, `C = C + (H M)' S^-1 H M`, `M = G (I - K H) M`.
    pub(super) fn correction(&mut self, layout: &Layout, update: &Update) {
        let (n, stride, m, w) = (self.n, self.stride, update.m, update.columns.len());
        let mut lower = Vec::with_capacity(m * m);
        if !cholesky(&update.s, m, &mut lower) {
            return; // the filter has used this S, so it is positive definite
        }
        let project = |x: &[f64]| {
            let mut seen = vec![0.0; m * stride];
            for (seen, h) in seen.chunks_exact_mut(stride).zip(update.h.chunks_exact(w)) {
                for (&c, h) in update.columns.iter().zip(h) {
                    add(seen, *h, &x[c * stride..][..stride]);
                }
            }
            seen
        };
        let seen = project(&self.map);
        let mut innovation = update.innovation.clone();
        forward(&lower, m, &mut innovation);
        backward(&lower, m, &mut innovation);
        for (seen, y) in seen.chunks_exact(stride).zip(&innovation) {
            add(&mut self.lambda, *y, seen);
        }
        // S^-1 H M, one column after the other
        let mut solved = vec![0.0; m * stride];
        let mut column = vec![0.0; m];
        for j in 0..n {
            (0..m).for_each(|a| column[a] = seen[a * stride + j]);
            forward(&lower, m, &mut column);
            backward(&lower, m, &mut column);
            (0..m).for_each(|a| solved[a * stride + j] = column[a]);
        }
        outer(&mut self.information, &seen, &solved, stride);
        if !self.considered.is_empty() {
            let mixed = project(&self.mixed);
            // O + (H M)' S^-1 H M + (H M)' S^-1 H X + its transpose
            outer(&mut self.spread, &seen, &solved, stride);
            outer(&mut self.spread, &solved, &mixed, stride);
            outer(&mut self.spread, &mixed, &solved, stride);
            // X = (I - K H) X + C S^-1 H M, whose gain is zero in the rows of C
            correct(&mut self.mixed, update.gain(), &mixed, stride);
            let cross: Vec<f64> = update.cross_covariance().collect();
            for (i, _) in self.considered.iter().enumerate().filter(|(_, kept)| **kept) {
                for (a, solved) in solved.chunks_exact(stride).enumerate() {
                    add(&mut self.mixed[i * stride..][..stride], cross[i * m + a], solved);
                }
            }
            layout.reset_rows(&update.delta, &mut self.mixed, stride);
        }
        correct(&mut self.map, update.gain(), &seen, stride);
        layout.reset_rows(&update.delta, &mut self.map, stride);
        self.empty = false;
    }
}

/// `X = X + A' B` for rows of `stride` in `A` and `B`.
fn outer(x: &mut [f64], a: &[f64], b: &[f64], stride: usize) {
    let n = x.len().isqrt();
    for (a, b) in a.chunks_exact(stride).zip(b.chunks_exact(stride)) {
        x.chunks_exact_mut(n).zip(a).for_each(|(row, f)| add(row, *f, b));
    }
}

/// `X = X - K (H X)`.
fn correct(x: &mut [f64], gain: &[f64], seen: &[f64], stride: usize) {
    let m = seen.len() / stride;
    for (row, gain) in x.chunks_exact_mut(stride).zip(gain.chunks_exact(m)) {
        for (seen, k) in seen.chunks_exact(stride).zip(gain) {
            add(row, -k, seen);
        }
    }
}

/// `a += f b`.
#[inline]
fn add(a: &mut [f64], f: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += f * b;
    }
}
