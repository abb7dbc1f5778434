//! Sigma points around the estimate: slopes and second derivatives of a model over the uncertainty
//! of the states that it reads.
//!
//! The covariance of the columns that the model reads has the lower factor `L`, `P = L L'`. The
//! model is evaluated at `x [+] s L u` for few directions `u`, with `s^2 = 3`, at which the
//! differences are exact up to the third order of a Gaussian (Norgaard, Poulsen & Ravn, Automatica
//! 36, 2000). With `z(u) = h(x [+] s L u) [-] h(x)`:
//! ```text
//! d_i  = (z(e_i) - z(-e_i)) / (2 s)              slope along column i of L
//! q_ii = (z(e_i) + z(-e_i)) / s^2                second derivative along it
//! q_ij = (z(u) + z(-u)) / s^2 - (q_ii + q_jj) / 2,    u = (e_i + e_j) / sqrt(2)
//! ```
//! The usual `2 n + 1` points give no mixed derivative `q_ij`, and so miss a product of two
//! unknowns. The pairs cost `n (n - 1)` more evaluations.

use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::covariance::{Covariance, Update};
use crate::state::{Layout, State};
use crate::units::sample::MAX_CHANNELS;

/// Square of the distance of the points, in units of sigma.
const SQUARE: f64 = 3.0;

/// Share of a variance below which the other columns determine the column.
const DETERMINED: f64 = 1e-12;

/// Values of the predicted channels.
type Values = [f64; MAX_CHANNELS];

/// Sigma points and their results, allocated once.
#[derive(Default)]
pub(in crate::filter) struct SigmaPoints {
    at: State,
    delta: Vec<f64>,
    centre: Values,
    /// Lower factor of the covariance of the columns, row-major.
    pub(in crate::filter) root: Vec<f64>,
    /// Slope of the channels along each column of the factor.
    pub(in crate::filter) slopes: Vec<Values>,
    /// Second derivatives `q_ij` with `j <= i`, row after row.
    pub(in crate::filter) seconds: Vec<Values>,
    /// One row of the Jacobian.
    pub(in crate::filter) row: Vec<f64>,
}

impl SigmaPoints {
    /// Evaluates a model at the points around a state; `columns` are those that it reads.
    pub(in crate::filter) fn evaluate(
        &mut self,
        at: &At<'_>,
        model: &dyn AnyMeasurement,
        columns: &[usize],
        covariance: &Covariance,
    ) {
        let w = columns.len();
        // field by field, which keeps the memory
        self.at.time = at.state.time;
        self.at.values.clone_from(&at.state.values);
        self.at.signals.clone_from(&at.state.signals);
        self.at.labels.clone_from(&at.state.labels);
        self.delta.resize(at.layout.tangent, 0.0);
        factor(covariance, columns, &mut self.root);
        model.predict(at, &mut self.centre[..model.channels()]);
        self.slopes.clear();
        self.slopes.resize(w, [0.0; MAX_CHANNELS]);
        self.seconds.clear();
        self.seconds.resize(w * (w + 1) / 2, [0.0; MAX_CHANNELS]);
        for i in 0..w {
            if self.root[i * w + i] == 0.0 {
                continue;
            }
            let (ahead, behind) = self.sides(at, model, columns, i, None);
            let own: Values = std::array::from_fn(|c| (ahead[c] + behind[c]) / SQUARE);
            self.slopes[i] =
                std::array::from_fn(|c| (ahead[c] - behind[c]) / (2.0 * SQUARE.sqrt()));
            self.seconds[place(i, i)] = own;
            for j in 0..i {
                if self.root[j * w + j] == 0.0 {
                    continue;
                }
                let (ahead, behind) = self.sides(at, model, columns, i, Some(j));
                let other = self.seconds[place(j, j)];
                self.seconds[place(i, j)] = std::array::from_fn(|c| {
                    (ahead[c] + behind[c]) / SQUARE - 0.5 * (own[c] + other[c])
                });
            }
        }
    }

    /// Changes of the channels at both points along a direction: column `i` of the factor, or
    /// between it and another.
    fn sides(
        &mut self,
        at: &At<'_>,
        model: &dyn AnyMeasurement,
        columns: &[usize],
        i: usize,
        other: Option<usize>,
    ) -> (Values, Values) {
        let (w, n) = (columns.len(), model.channels());
        let length = SQUARE.sqrt() * if other.is_some() { 0.5_f64.sqrt() } else { 1.0 };
        let mut side = |length: f64| {
            self.delta.fill(0.0);
            for (k, &column) in columns.iter().enumerate() {
                let second = other.map_or(0.0, |j| self.root[k * w + j]);
                self.delta[column] = length * (self.root[k * w + i] + second);
            }
            at.layout.displace(at.state, &mut self.delta, &mut self.at);
            let mut z = [0.0; MAX_CHANNELS];
            model.predict(&At { state: &self.at, ..*at }, &mut z[..n]);
            (0..n).for_each(|c| z[c] = model.difference(c, z[c], self.centre[c]));
            z
        };
        (side(length), side(-length))
    }
}

/// Place of the second derivative `q_ij`, `j <= i`.
pub(in crate::filter) fn place(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// Adds the heading with which a velocity that the model reads turns: the velocity then moves along
/// its own group at a sigma point.
pub(in crate::filter) fn add_headings(layout: &Layout, update: &mut Update) {
    for (velocity, attitude) in layout.headings() {
        let reads = |column: &usize| update.columns.contains(column);
        if !reads(&velocity.start) || reads(&attitude.start) {
            continue;
        }
        let (w, wide) = (update.columns.len(), update.columns.len() + attitude.len());
        update.columns.extend(attitude);
        update.h.truncate(update.m * w);
        update.h.resize(update.m * wide, 0.0);
        for a in (0..update.m).rev() {
            update.h.copy_within(a * w..(a + 1) * w, a * wide);
            update.h[a * wide + w..(a + 1) * wide].fill(0.0);
        }
    }
}

/// Computes the lower factor of the covariance of some columns. A column that the columns before it
/// determine gets a diagonal of zero.
pub(in crate::filter) fn factor(covariance: &Covariance, columns: &[usize], root: &mut Vec<f64>) {
    let w = columns.len();
    root.clear();
    root.resize(w * w, 0.0);
    for i in 0..w {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| root[i * w + k] * root[j * w + k]).sum();
            let left = covariance.get(columns[i], columns[j]) - sum;
            let pivot = root[j * w + j];
            if i == j {
                let free = left > DETERMINED * covariance.get(columns[i], columns[i]);
                root[i * w + i] = if free { left.sqrt() } else { 0.0 };
            } else if pivot > 0.0 {
                root[i * w + j] = left / pivot;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::compose::Composer;
    use crate::state::manifold::{Rotation, Vector};
    use crate::state::{BlockSpec, Dynamics, Mode, display};

    /// A model of two channels reads a velocity, in columns 0 to 2, and no attitude.
    #[test]
    fn the_heading_of_a_velocity_is_read_with_slopes_of_zero() {
        let mut composer = Composer::default();
        composer.begin("ins");
        let spec = || BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0; 3],
            sigma: vec![1.0; 3],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::VELOCITY,
        };
        let velocity = composer.block::<Vector<3>>("velocity", spec()).expect("a velocity");
        let attitude = composer.block::<Rotation>("attitude", spec()).expect("an attitude");
        composer.turns_with_heading(velocity, attitude);
        let layout = composer.finish().0;
        let mut update = Update::with_capacity(6, 2);
        update.m = 2;
        update.columns.extend(0..3);
        update.h.extend([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        for _ in 0..2 {
            add_headings(&layout, &mut update);
            assert_eq!(update.columns, [0, 1, 2, 3, 4, 5], "only once");
            let rows = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 4.0, 5.0, 6.0, 0.0, 0.0, 0.0];
            assert_eq!(update.h, rows);
        }
    }
}
