//! Passage of sigma points through the processes: the propagation of the unscented filter.
//!
//! With `P = L L'` and `s^2 = 3`, two points for each column of `L` pass through the step `f` of
//! all processes, and the differences between their ends and the end of the estimate
//! ```text
//! e_i+ = f(x [+] s l_i) [-] f(x),    e_i- = f(x [+] -s l_i) [-] f(x)
//! ```
//! give mean and covariance (Norgaard, Poulsen & Ravn, Automatica 36, 2000, eqs 38 and 43)
//! ```text
//! x = f(x) [+] sum (e_i+ + e_i-) / (2 s^2)
//! P = sum (e_i+ - e_i-)(..)' / (4 s^2) + (s^2 - 1) / (4 s^4) sum (e_i+ + e_i-)(..)' + Q
//! ```
//! The mean is that of the scaled unscented transform with the same distance. The covariance is
//! positive for any number of states, and the points stay at `sqrt(3)` sigma. `[+]` and `[-]` are
//! the operations of the error injection, with velocities that turn with the heading.

use super::linear::Linear;
use crate::filter::estimate::Estimate;
use crate::filter::update::points::factor;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::{Interval, ProcessModel};
use crate::state::covariance::Covariance;
use crate::state::{Layout, State};
use nalgebra::DMatrix;

/// Square of the distance of the points, in units of sigma.
const SQUARE: f64 = 3.0;

/// Work space of a passage.
pub(in crate::filter) struct Passage {
    root: Vec<f64>,
    columns: Vec<usize>,
    known: Vec<bool>,
    delta: Vec<f64>,
    mean: Vec<f64>,
    /// Errors of the two points of a column at the end.
    ends: [Vec<f64>; 2],
    points: Vec<State>,
    /// Columns `(e+ - e-) / (2 s)` and `sqrt(s^2 - 1) / (2 s^2) (e+ + e-)`.
    spread: DMatrix<f64>,
    product: DMatrix<f64>,
    linear: Covariance,
}

impl Passage {
    pub(in crate::filter) fn new(layout: &Layout) -> Self {
        let n = layout.tangent;
        Self {
            root: Vec::new(),
            columns: (0..n).collect(),
            known: vec![true; layout.blocks.len()],
            delta: vec![0.0; n],
            mean: vec![0.0; n],
            ends: [vec![0.0; n], vec![0.0; n]],
            points: vec![layout.initial_state(); 2 * n],
            spread: DMatrix::zeros(n, 2 * n),
            product: DMatrix::zeros(n, n),
            linear: Covariance::zero(n),
        }
    }

    /// Propagates state and covariance by sigma points.
    pub(super) fn propagate(
        &mut self,
        linear: &mut Linear<'_>,
        considered: &[bool],
        processes: &mut [Box<dyn ProcessModel>],
        estimate: &mut Estimate,
        interval: &Interval<'_>,
    ) -> Result<(), EstimatorError> {
        let w = self;
        let Estimate { state, covariance, .. } = estimate;
        let layout = &linear.composition.layout;
        let n = layout.tangent;
        factor(covariance, &w.columns, &mut w.root);
        let slots = w.known.iter_mut().enumerate();
        slots.for_each(|(slot, known)| *known = !layout.is_absent(state, slot));
        for (k, point) in w.points.iter_mut().enumerate() {
            let (i, side) = (k / 2, if k % 2 == 0 { SQUARE.sqrt() } else { -SQUARE.sqrt() });
            if w.root[i * n + i] == 0.0 {
                continue;
            }
            w.delta.iter_mut().enumerate().for_each(|(j, d)| *d = side * w.root[j * n + i]);
            point.time = state.time;
            point.signals.clone_from(&state.signals);
            point.labels.clone_from(&state.labels);
            layout.displace(state, &mut w.delta, point);
            // each point goes on from the memory that the processes have before the step
            let mut copies = processes.to_vec();
            linear.propagate(&mut copies, point, interval)?;
        }
        // the estimate comes last, so that Phi and Q are those at the estimate
        linear.propagate(processes, state, interval)?;
        w.mean.fill(0.0);
        w.spread.fill(0.0);
        for (i, pair) in w.points.chunks_exact(2).enumerate() {
            if w.root[i * n + i] == 0.0 {
                continue;
            }
            for (end, point) in w.ends.iter_mut().zip(pair) {
                layout.error(point, state, &w.known, end);
            }
            for (j, (ahead, behind)) in w.ends[0].iter().zip(&w.ends[1]).enumerate() {
                let both = ahead + behind;
                w.mean[j] += both / (2.0 * SQUARE);
                w.spread[(j, 2 * i)] = (ahead - behind) / (2.0 * SQUARE.sqrt());
                w.spread[(j, 2 * i + 1)] = (SQUARE - 1.0).sqrt() / (2.0 * SQUARE) * both;
            }
        }
        // an error that is followed moves by the Phi of the estimate
        w.linear.clone_from(covariance);
        linear.transition.propagate(&mut w.linear);
        w.product.gemm(1.0, &w.spread, &w.spread.transpose(), 0.0);
        for j in 0..n {
            (0..=j).for_each(|i| covariance.set(i, j, w.product[(i, j)]));
        }
        linear.transition.add_noise(covariance);
        w.mean.iter_mut().zip(considered).filter(|(_, c)| **c).for_each(|(mean, _)| *mean = 0.0);
        layout.inject(state, &mut w.mean, covariance);
        Ok(())
    }
}
