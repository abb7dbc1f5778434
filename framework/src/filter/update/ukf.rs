//! The rule `ukf`: the model is replaced by its linear regression over the sigma points.
//!
//! With the slopes `d_i` and second derivatives `q_ij` of [`super::points`], and `P = L L'` over the
//! columns that the model reads, a Gaussian error gives to the second order of the curvature
//! ```text
//! mean of z        h(x) + sum_i q_ii / 2
//! covariance       D D' + sum_ij q_ij q_ij' / 2 + R,    D = (d_1, d_2, ...)
//! cross-covariance P_xz = P[:, columns] H',             H L = D
//! ```
//! That is a linear model with the Jacobian `H`, a shifted innovation, and the noise
//! `R + sum_ij q_ij q_ij' / 2` (statistical linear regression: Lefebvre, Bruyninckx & De Schutter,
//! IEEE Trans. Autom. Control 47, 2002). Gate, recovery, robust weights and considered states work
//! on it as on any linear model.

use super::points::{SigmaPoints, add_headings, place};
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::rule::{Check, Prior, Rule, RuleType};
use crate::state::covariance::{Covariance, Update};
use crate::units::sample::MAX_CHANNELS;

/// Unscented update: linear regression over sigma points of the uncertainty. It suits a model that
/// is curved within the uncertainty, however accurate the sensor.
#[derive(Default)]
pub struct Unscented(SigmaPoints);

impl RuleType for Unscented {
    const TYPE: &'static str = "ukf";
    const EVALUATES: bool = true;
}

impl Rule for Unscented {
    fn linearised(&mut self, prior: &Prior<'_>, update: &mut Update) {
        let &Prior { ref at, model, covariance, .. } = prior;
        regress(&mut self.0, at, model, covariance, update);
    }

    fn check(&self) -> Check {
        Check::Never
    }
}

/// Replaces the linearisation in the work space by the regression. Call after
/// [`AnyMeasurement::linearise`] at the same state.
fn regress(
    points: &mut SigmaPoints,
    at: &At<'_>,
    model: &dyn AnyMeasurement,
    covariance: &Covariance,
    update: &mut Update,
) {
    add_headings(at.layout, update);
    points.evaluate(at, model, &update.columns, covariance);
    let (m, w) = (update.m, update.columns.len());
    let mut channels = [0; MAX_CHANNELS];
    let present = (0..model.channels()).filter(|&c| at.sample.get(c).is_some());
    channels.iter_mut().zip(present).for_each(|(place, channel)| *place = channel);
    for i in 0..w {
        for j in 0..=i {
            let q = &points.seconds[place(i, j)];
            // q_ji is q_ij, and counts too
            let share = if i == j { 0.5 } else { 1.0 };
            for (a, &c) in channels[..m].iter().enumerate() {
                if i == j {
                    update.innovation[a] -= 0.5 * q[c];
                }
                for (b, &d) in channels[..m].iter().enumerate() {
                    update.r[a * m + b] += share * q[c] * q[d];
                }
            }
        }
    }
    // H + X with X L = D - H L, so that a column without a pivot keeps its derivative
    for (a, &c) in channels[..m].iter().enumerate() {
        let mut x = std::mem::take(&mut points.row);
        x.clear();
        x.resize(w, 0.0);
        let h = &mut update.h[a * w..(a + 1) * w];
        for k in (0..w).rev() {
            let column = (k..w).map(|i| (h[i] + x[i]) * points.root[i * w + k]);
            let left = points.slopes[k][c] - column.sum::<f64>();
            let pivot = points.root[k * w + k];
            x[k] = if pivot > 0.0 { left / pivot } else { 0.0 };
        }
        h.iter_mut().zip(&x).for_each(|(h, x)| *h += x);
        points.row = x;
    }
}
