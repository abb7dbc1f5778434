//! The rule `iekf`: Gauss-Newton steps to the most probable state.
//!
//! The update minimises, over the error `d` of the estimate `x`,
//! ```text
//! c(d) = d' P^-1 d / 2 + r' R^-1 r / 2,    r = z [-] h(x [+] d)
//! ```
//! Each step solves the model that is linearised at the last `d` (Bell & Cathey, IEEE Trans. Autom.
//! Control 38, 1993, eq. 14):
//! ```text
//! d+ = K (r + H d),   K = P H' (H P H' + R)^-1,   H = dh/d(d) at x [+] d
//! ```
//! `d = P[:, columns] l` holds for every step, so that the prior costs `l' P l / 2` without an
//! inverse, and only the columns that the model reads are iterated. A step is halved while the cost
//! grows. The iteration ends once a step is below a thousandth of the prior sigma. Errors of
//! considered states stay linear, and these states stay where they are.

use super::points::add_headings;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::rule::{Check, Prior, Rule, RuleType};
use crate::state::State;
use crate::state::covariance::{Covariance, Update, backward, cholesky, forward};

/// Largest number of Gauss-Newton steps.
const STEPS: usize = 12;

/// Square of the step, in units of the prior sigma, at which the iteration has converged.
const CONVERGED: f64 = 1e-6;

/// Number of halvings of a step before the iteration stops where it is.
const HALVINGS: usize = 6;

/// Iterated extended Kalman filter: linearises again at the updated estimate until it converges.
/// For an accurate sensor and an estimate that is far off. Its memory is allocated once.
#[derive(Default)]
pub struct Iterated {
    /// Linearisation at the trial of a step.
    trial: Update,
    at: State,
    delta: Vec<f64>,
    /// Covariance of the columns, row-major.
    prior: Vec<f64>,
    /// Lower factors of `R` and `S`.
    noise: Vec<f64>,
    lower: Vec<f64>,
    s: Vec<f64>,
    /// `l` of the last accepted step, and of the trial; the error `P l` of each.
    here: Point,
    next: Point,
    /// `z [-] h` at the last accepted step.
    residual: Vec<f64>,
    work: Vec<f64>,
    converged: bool,
}

/// One state of the iteration over the columns.
#[derive(Default)]
struct Point {
    l: Vec<f64>,
    error: Vec<f64>,
}

impl Point {
    fn resize(&mut self, w: usize) {
        for values in [&mut self.l, &mut self.error] {
            values.clear();
            values.resize(w, 0.0);
        }
    }

    /// Computes the error `P l`, and returns `l' P l`.
    fn spread(&mut self, prior: &[f64]) -> f64 {
        let w = self.l.len();
        for (k, error) in self.error.iter_mut().enumerate() {
            *error = prior[k * w..(k + 1) * w].iter().zip(&self.l).map(|(p, l)| p * l).sum();
        }
        self.error.iter().zip(&self.l).map(|(e, l)| e * l).sum()
    }
}

impl RuleType for Iterated {
    const TYPE: &'static str = "iekf";
    const EVALUATES: bool = true;
}

impl Rule for Iterated {
    fn accepted(&mut self, prior: &Prior<'_>, update: &mut Update) -> bool {
        let &Prior { ref at, model, covariance, considered } = prior;
        self.iterate(at, model, covariance, considered, update);
        true
    }

    /// Replaces the last linear step by the correction at which an iteration stopped, if it has not
    /// converged.
    fn corrects(&self, delta: &mut [f64]) {
        if !self.converged {
            delta.copy_from_slice(&self.delta);
        }
    }

    fn check(&self) -> Check {
        Check::After
    }
}

impl Iterated {
    /// Moves the linearisation in the work space from the state of `at` to the most probable one.
    /// The innovation becomes `r + H d`, for which the linear update gives the last step.
    fn iterate(
        &mut self,
        at: &At<'_>,
        model: &dyn AnyMeasurement,
        covariance: &Covariance,
        considered: &[bool],
        update: &mut Update,
    ) {
        let m = update.m;
        // a sensor without noise has no cost; its update stays that at the prior
        self.converged = !cholesky(&update.r, m, &mut self.noise);
        if self.converged {
            return;
        }
        add_headings(at.layout, update);
        let w = update.columns.len();
        self.prior.clear();
        for &i in &update.columns {
            self.prior.extend(update.columns.iter().map(|&j| covariance.get(i, j)));
        }
        // field by field, which keeps the memory
        self.at.time = at.state.time;
        self.at.values.clone_from(&at.state.values);
        self.at.signals.clone_from(&at.state.signals);
        self.at.labels.clone_from(&at.state.labels);
        self.delta.resize(at.layout.tangent, 0.0);
        self.here.resize(w);
        self.next.resize(w);
        self.residual.clone_from(&update.innovation);
        let mut cost = self.misfit(update, considered, false);
        self.converged = false;
        for _ in 0..STEPS {
            self.pseudo_innovation(considered, update);
            if !self.gain(update) {
                break;
            }
            if self.next.spread(&self.prior) < CONVERGED {
                self.converged = true;
                break;
            }
            match self.step(at, model, considered, update, cost) {
                Some(lower) => cost = lower,
                None => break,
            }
        }
        self.pseudo_innovation(considered, update);
        if !self.converged {
            self.stop(covariance, considered, &update.columns);
        }
    }

    /// Keeps the correction at which an iteration stopped without convergence.
    fn stop(&mut self, covariance: &Covariance, considered: &[bool], columns: &[usize]) {
        for (i, d) in self.delta.iter_mut().enumerate() {
            let terms = columns.iter().zip(&self.here.l).map(|(&c, l)| covariance.get(i, c) * l);
            *d = if considered[i] { 0.0 } else { terms.sum() };
        }
    }

    /// Sets the innovation to `r + H d` over the states that the update moves.
    fn pseudo_innovation(&self, considered: &[bool], update: &mut Update) {
        let w = update.columns.len();
        for (a, r) in self.residual.iter().enumerate() {
            let h = &update.h[a * w..(a + 1) * w];
            let moved = h.iter().zip(&update.columns).zip(&self.here.error);
            let moved = moved.filter(|((_, c), _)| !considered[**c]).map(|((h, _), e)| h * e);
            update.innovation[a] = r + moved.sum::<f64>();
        }
    }

    /// Computes the whole step `H' S^-1 y - l` into `next.l`; `false` if `S` is singular.
    fn gain(&mut self, update: &Update) -> bool {
        let (m, w) = (update.m, update.columns.len());
        let row = |a: usize| &update.h[a * w..(a + 1) * w];
        self.s.clear();
        self.s.extend_from_slice(&update.r);
        self.work.clear();
        self.work.resize(w, 0.0);
        for b in 0..m {
            for (k, p) in self.work.iter_mut().enumerate() {
                *p = self.prior[k * w..(k + 1) * w].iter().zip(row(b)).map(|(p, h)| p * h).sum();
            }
            for a in 0..m {
                self.s[a * m + b] += row(a).iter().zip(&self.work).map(|(h, p)| h * p).sum::<f64>();
            }
        }
        if !cholesky(&self.s, m, &mut self.lower) {
            return false;
        }
        self.work.clear();
        self.work.extend_from_slice(&update.innovation);
        forward(&self.lower, m, &mut self.work);
        backward(&self.lower, m, &mut self.work);
        for (k, l) in self.next.l.iter_mut().enumerate() {
            *l = (0..m).map(|a| row(a)[k] * self.work[a]).sum::<f64>() - self.here.l[k];
        }
        true
    }

    /// Takes the step in `next.l`, halved until the cost does not grow, and returns the cost there;
    /// `None` if the cost still grows, or the model reads other states there.
    fn step(
        &mut self,
        at: &At<'_>,
        model: &dyn AnyMeasurement,
        considered: &[bool],
        update: &mut Update,
        cost: f64,
    ) -> Option<f64> {
        self.next.l.iter_mut().zip(&self.here.l).for_each(|(next, here)| *next += here);
        for _ in 0..HALVINGS {
            let prior = self.next.spread(&self.prior);
            self.delta.fill(0.0);
            for (&c, error) in update.columns.iter().zip(&self.next.error) {
                self.delta[c] = if considered[c] { 0.0 } else { *error };
            }
            at.layout.displace(at.state, &mut self.delta, &mut self.at);
            model.linearise(&At { state: &self.at, ..*at }, &mut self.trial);
            add_headings(at.layout, &mut self.trial);
            if self.trial.columns != update.columns || self.trial.m != update.m {
                return None;
            }
            let now = 0.5 * prior + self.misfit(update, considered, true);
            // rounding of the cost is no growth
            if now <= cost * (1.0 + 1e-12) {
                let Update { columns, h, m, .. } = &mut self.trial;
                at.layout.reset_columns(&self.delta, columns, &mut h[..*m * columns.len()]);
                update.h.clone_from(h);
                self.residual.clone_from(&self.trial.innovation);
                std::mem::swap(&mut self.here, &mut self.next);
                return Some(now);
            }
            let halves = self.next.l.iter_mut().zip(&self.here.l);
            halves.for_each(|(next, here)| *next = 0.5 * (*next + here));
        }
        None
    }

    /// `r' R^-1 r / 2`, with the linear part of the considered states: at the trial or at the
    /// beginning.
    fn misfit(&mut self, update: &Update, considered: &[bool], trial: bool) -> f64 {
        let (m, w) = (update.m, update.columns.len());
        self.work.clear();
        self.work.extend_from_slice(if trial { &self.trial.innovation } else { &self.residual });
        if trial {
            for (a, r) in self.work.iter_mut().enumerate() {
                let h = &self.trial.h[a * w..(a + 1) * w];
                let held = h.iter().zip(&update.columns).zip(&self.next.error);
                let held = held.filter(|((_, c), _)| considered[**c]).map(|((h, _), e)| h * e);
                *r -= held.sum::<f64>();
            }
        }
        forward(&self.noise, m, &mut self.work);
        0.5 * self.work.iter().map(|r| r * r).sum::<f64>()
    }
}
