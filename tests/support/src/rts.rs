//! A dense smoother of Rauch, Tung & Striebel on the records of a run, as the textbooks have it
//! (Gelb, Applied Optimal Estimation, 1974, section 5.2), and the exact covariance of a linear
//! smoother with any gain.

use navfuse_core::model::record::{Epoch, Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::nalgebra::{DMatrix, DVector};
use navfuse_core::state::covariance::{Transition, Update};
use navfuse_core::state::{Layout, State};

/// A step of the filter as a linear map of the error: `e = M e + noise`, and for a correction its
/// innovation `y = H e + v`.
pub struct Step {
    pub map: DMatrix<f64>,
    pub noise: DMatrix<f64>,
    /// `K y` of a correction.
    pub moved: DVector<f64>,
    pub correction: Option<Correction>,
}

pub struct Correction {
    pub h: DMatrix<f64>,
    pub s: DMatrix<f64>,
    pub gain: DMatrix<f64>,
    pub reset: DMatrix<f64>,
    pub innovation: DVector<f64>,
}

/// An estimate with its covariance, and the number of steps before it.
pub struct Estimate {
    pub after: usize,
    pub state: State,
    pub covariance: DMatrix<f64>,
    pub truth: Option<State>,
}

/// Sink that keeps every step of the filter, its estimates, and the smoothed estimates.
#[derive(Default)]
pub struct Records {
    pub layout: Layout,
    pub steps: Vec<Step>,
    pub filtered: Vec<Estimate>,
    pub smoothed: Vec<Estimate>,
    /// Covariance after all steps, from the first estimate on.
    covariance: Option<DMatrix<f64>>,
}

impl Records {
    fn estimate(&self, epoch: &Epoch<'_>) -> Estimate {
        let covariance = epoch.covariance.to_dense();
        let truth = epoch.truth.map(|truth| truth.state.clone());
        Estimate { after: self.steps.len(), state: epoch.state.clone(), covariance, truth }
    }

    /// Adds a step, and carries the covariance over it.
    fn step(&mut self, step: Step) {
        if let Some(p) = &mut self.covariance {
            let next = &step.map * &*p * step.map.transpose() + &step.noise;
            *p = (&next + next.transpose()) * 0.5;
        }
        self.steps.push(step);
    }

    /// Adds a step of noise alone where the filter has widened its covariance, for an error that it
    /// has found.
    fn widen(&mut self, own: DMatrix<f64>) {
        let Some(p) = self.covariance.replace(own.clone()) else { return };
        let wider = own - &p;
        let scale = |i: usize, j: usize| (p[(i, i)] * p[(j, j)]).sqrt();
        let (n, rounding) = (p.nrows(), 1e-6);
        if (0..n).any(|i| (0..n).any(|j| wider[(i, j)].abs() > rounding * scale(i, j))) {
            let (map, moved) = (DMatrix::identity(n, n), DVector::zeros(n));
            self.steps.push(Step { map, noise: wider, moved, correction: None });
        }
    }

    /// Smoothed estimates of the textbook, in the order of the filter's: `x_s [-] x`, and `P_s` of
    /// the error about `x`.
    pub fn rts(&self) -> Vec<(DVector<f64>, DMatrix<f64>)> {
        let end = self.filtered.last().expect("an estimate").after;
        assert_eq!(end, self.steps.len(), "the run ends with an estimate");
        let covariances = self.covariances();
        let mut found = Vec::new();
        let mut estimates = self.filtered.iter().rev().peekable();
        self.backward(&covariances, end, |k, moved, p| {
            while estimates.next_if(|e| e.after == k).is_some() {
                found.push((moved.clone(), p.clone()));
            }
            estimates.peek().is_some()
        });
        found.reverse();
        found
    }

    /// Smoothed estimates of the textbook, each from the steps until one of `ends`.
    pub fn rts_until(&self, ends: &[usize]) -> Vec<(DVector<f64>, DMatrix<f64>)> {
        let covariances = self.covariances();
        let one = |(estimate, end): (&Estimate, &usize)| {
            let mut found = None;
            self.backward(&covariances, *end, |k, moved, p| {
                found = Some((moved.clone(), p.clone()));
                k > estimate.after
            });
            found.expect("an estimate before the end")
        };
        self.filtered.iter().zip(ends).map(one).collect()
    }

    /// Projection of the error at each estimate on all later innovations, with the product of all maps
    /// in between: `x_s [-] x = P sum B' S^-1 y` and `P_s = P - P (sum B' S^-1 B) P` with
    /// `B = H A ... A`. It inverts no covariance of the state, which a clone makes singular.
    pub fn projected(&self) -> Vec<(DVector<f64>, DMatrix<f64>)> {
        let n = self.layout.tangent;
        let one = |estimate: &Estimate| {
            let mut map = DMatrix::identity(n, n);
            let (mut lambda, mut known) = (DVector::zeros(n), DMatrix::zeros(n, n));
            for step in &self.steps[estimate.after..] {
                if let Some(c) = &step.correction {
                    let seen = &c.h * &map;
                    let s = c.s.clone().cholesky().expect("S is positive definite");
                    lambda += seen.tr_mul(&s.solve(&c.innovation));
                    known += seen.tr_mul(&s.solve(&seen));
                }
                map = &step.map * map;
            }
            let p = &estimate.covariance;
            (p * lambda, p - p * known * p)
        };
        self.filtered.iter().map(one).collect()
    }

    /// Largest difference of the smoothed estimates from those of a textbook, in sigma, and of
    /// their covariances, relative to the variances.
    pub fn differences(&self, textbook: Vec<(DVector<f64>, DMatrix<f64>)>) -> (f64, f64) {
        let layout = &self.layout;
        let n = layout.tangent;
        let known = vec![true; layout.blocks.len()];
        assert_eq!(self.filtered.len(), self.smoothed.len());
        assert!(self.filtered.len() >= 40, "{} epochs", self.filtered.len());
        let (mut worst, mut spread) = (0.0_f64, 0.0_f64);
        for ((filtered, smoothed), (moved, p)) in
            self.filtered.iter().zip(&self.smoothed).zip(textbook)
        {
            let mut change = vec![0.0; n];
            layout.error(&smoothed.state, &filtered.state, &known, &mut change);
            let expected = about_the_smoothed(layout, &p, &moved, filtered, smoothed);
            for i in 0..n {
                worst = worst.max((change[i] - moved[i]).abs() / p[(i, i)].sqrt());
                for j in 0..n {
                    let scale = (expected[(i, i)] * expected[(j, j)]).sqrt();
                    let difference = smoothed.covariance[(i, j)] - expected[(i, j)];
                    spread = spread.max(difference.abs() / scale);
                }
            }
        }
        println!("largest difference {worst:.1e} sigma, of the covariance {spread:.1e}");
        (worst, spread)
    }

    /// Covariances before and after each step, from the first estimate on.
    fn covariances(&self) -> Vec<DMatrix<f64>> {
        let first = &self.filtered[0];
        let mut covariances = vec![first.covariance.clone()];
        for step in &self.steps[first.after..] {
            let p = covariances.last().expect("one");
            let next = &step.map * p * step.map.transpose() + &step.noise;
            covariances.push((&next + next.transpose()) * 0.5);
        }
        covariances
    }

    /// Goes back from the state after `end` steps, and shows the smoothed estimate after each
    /// number of steps, until `show` returns `false`.
    fn backward(
        &self,
        covariances: &[DMatrix<f64>],
        end: usize,
        mut show: impl FnMut(usize, &DVector<f64>, &DMatrix<f64>) -> bool,
    ) {
        let first = self.filtered[0].after;
        let mut moved = DVector::zeros(self.layout.tangent);
        let mut p = covariances[end - first].clone();
        for k in (first..=end).rev() {
            if !show(k, &moved, &p) || k == first {
                break;
            }
            let step = &self.steps[k - 1];
            let filtered = &covariances[k - 1 - first];
            if let Some(Correction { reset, .. }) = &step.correction {
                // the error after the correction is that before it, moved and reset
                let back = reset.clone().try_inverse().expect("a reset");
                moved = &step.moved + &back * moved;
                p = &back * p * back.transpose();
                continue;
            }
            // C = P Phi' P-^-1,  x_s = x + C (x_s' - x-),  P_s = P + C (P_s' - P-) C'
            let predicted = &step.map * filtered * step.map.transpose() + &step.noise;
            let gain = inverse(&predicted) * &step.map * filtered;
            let gain = gain.transpose();
            moved = &gain * moved;
            p = filtered + &gain * (p - predicted) * gain.transpose();
        }
    }

    /// Covariance of the error of `x + D P lambda` at each estimate, from the sources of all
    /// errors: the initial error, the noise of each step, and that of each measurement. `kept`
    /// marks the states that are considered.
    pub fn covariances_of_the_errors(&self, kept: &[bool]) -> Vec<DMatrix<f64>> {
        let n = self.layout.tangent;
        let first = &self.filtered[0];
        let steps = &self.steps[first.after..];
        // every source has a column; its covariance is a block on the diagonal
        let sizes = steps.iter().map(|s| s.correction.as_ref().map_or(n, |c| c.h.nrows()));
        let width = n + sizes.sum::<usize>();
        let mut sources = DMatrix::zeros(width, width);
        sources.view_mut((0, 0), (n, n)).copy_from(&first.covariance);
        let mut error = DMatrix::zeros(n, width);
        error.view_mut((0, 0), (n, n)).fill_with_identity();
        let mut p = first.covariance.clone();
        let (mut at, mut errors, mut innovations) = (n, vec![error.clone()], Vec::new());
        let mut covariances = vec![p.clone()];
        for step in steps {
            let mut next = &step.map * &error;
            if let Some(c) = &step.correction {
                let m = c.h.nrows();
                let r = &c.s - &c.h * &p * c.h.transpose();
                sources.view_mut((at, at), (m, m)).copy_from(&r);
                let mut innovation = &c.h * &error;
                (0..m).for_each(|a| innovation[(a, at + a)] += 1.0);
                let mut seen = next.view_mut((0, at), (n, m));
                seen -= &c.reset * &c.gain;
                innovations.push(Some(innovation));
                at += m;
            } else {
                sources.view_mut((at, at), (n, n)).copy_from(&step.noise);
                (0..n).for_each(|i| next[(i, at + i)] += 1.0);
                innovations.push(None);
                at += n;
            }
            p = &step.map * &p * step.map.transpose() + &step.noise;
            error = next;
            errors.push(error.clone());
            covariances.push(p.clone());
        }
        let mut found = Vec::new();
        for estimate in &self.filtered {
            let k = estimate.after - first.after;
            let mut lambda = DMatrix::zeros(n, width);
            let mut map = DMatrix::identity(n, n);
            for (step, innovation) in steps.iter().zip(&innovations).skip(k) {
                if let Some((c, innovation)) = step.correction.as_ref().zip(innovation.as_ref()) {
                    let s = c.s.clone().cholesky().expect("S is positive definite");
                    lambda += (&c.h * &map).transpose() * s.solve(innovation);
                }
                map = &step.map * map;
            }
            let mut given = &covariances[k] * lambda;
            for (i, _) in kept.iter().enumerate().filter(|(_, kept)| **kept) {
                given.row_mut(i).fill(0.0);
            }
            let left = &errors[k] - given;
            found.push(&left * &sources * left.transpose());
        }
        found
    }
}

/// The covariance of the error about the smoothed estimate, from that about the filter's.
fn about_the_smoothed(
    layout: &Layout,
    p: &DMatrix<f64>,
    moved: &DVector<f64>,
    from: &Estimate,
    to: &Estimate,
) -> DMatrix<f64> {
    let n = layout.tangent;
    let mut delta = moved.as_slice().to_vec();
    // the reset takes the change of the velocity itself
    let velocity = layout.find("ins.velocity").expect("an INS");
    for (row, at) in velocity.tangent_range().zip(velocity.range()) {
        delta[row] = to.state.values[at] - from.state.values[at];
    }
    let mut reset = vec![0.0; n * n];
    (0..n).for_each(|i| reset[i * n + i] = 1.0);
    layout.reset_rows(&delta, &mut reset, n);
    let reset = DMatrix::from_row_slice(n, n, &reset);
    &reset * p * reset.transpose()
}

/// Inverse of a covariance, scaled to a diagonal of ones first.
fn inverse(p: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = p.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = DMatrix::from_fn(p.nrows(), p.ncols(), |i, j| scale[i] * p[(i, j)] * scale[j]);
    let inverse = scaled.cholesky().expect("positive definite").inverse();
    DMatrix::from_fn(p.nrows(), p.ncols(), |i, j| scale[i] * inverse[(i, j)] * scale[j])
}

impl Sink for Records {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::FILTERED | Wants::TRANSITIONS | Wants::CORRECTIONS
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.layout = run.layout.clone();
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Transition(transition) => self.transition(transition),
            Record::Correction(correction) => self.correction(correction),
            Record::Filtered(filtered) => self.filtered(filtered),
            Record::Epoch(epoch) => self.epoch(epoch),
            _ => Ok(()),
        }
    }
}

impl Records {
    fn transition(&mut self, transition: &Transition) -> Result<(), StreamError> {
        let n = self.layout.tangent;
        let (map, noise) = (transition.phi_dense(n), transition.noise_dense(n));
        self.step(Step { map, noise, moved: DVector::zeros(n), correction: None });
        Ok(())
    }

    fn correction(&mut self, update: &Update) -> Result<(), StreamError> {
        let (n, m) = (self.layout.tangent, update.m);
        let mut h = DMatrix::zeros(m, n);
        for (k, &c) in update.columns.iter().enumerate() {
            (0..m).for_each(|a| h[(a, c)] = update.h[a * update.columns.len() + k]);
        }
        let s = DMatrix::from_row_slice(m, m, &update.s);
        let gain = DMatrix::from_row_slice(n, m, update.gain());
        let innovation = DVector::from_column_slice(&update.innovation);
        let mut reset = vec![0.0; n * n];
        (0..n).for_each(|i| reset[i * n + i] = 1.0);
        self.layout.reset_rows(&update.delta, &mut reset, n);
        let reset = DMatrix::from_row_slice(n, n, &reset);
        let r = DMatrix::from_row_slice(m, m, &update.r);
        let carried = &reset * &gain;
        self.step(Step {
            map: &reset * (DMatrix::identity(n, n) - &gain * &h),
            noise: &carried * r * carried.transpose(),
            moved: &gain * &innovation,
            correction: Some(Correction { h, s, gain, reset, innovation }),
        });
        Ok(())
    }

    fn filtered(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.widen(epoch.covariance.to_dense());
        self.filtered.push(self.estimate(epoch));
        Ok(())
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let estimate = self.estimate(epoch);
        self.smoothed.push(estimate);
        Ok(())
    }
}
