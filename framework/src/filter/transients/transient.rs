//! Blocks that come and go: addition with a prior or by a sample, and marginalisation.
//!
//! Each change is a linear map of the error state with noise, which the filter applies as a
//! transition and observers receive like any other. Only the rows `y` of the block differ from the
//! identity:
//! ```text
//! prior:        dy := w,                    Cov(w) = prior
//! placed:       dy := -Hy^-1 (Hx dx + v),   Cov(v) = R,  from z [-] h(x, y) = v
//! marginalised: dy := 0
//! ```
//! With `placed`, `Pyx = -Hy^-1 Hx Px` and `Pyy = Hy^-1 (Hx Px Hx' + R) Hy^-T`: the limit of an
//! update with an uninformative prior. Its innovation has no information about `x`.

use crate::filter::ekf::Ekf;
use crate::filter::parts::{Parts, followed};
use crate::model::record::{Event, Level, Observer, Outcome, Rejection, UpdateRecord};
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::roster::{Change, Roster};
use crate::state::covariance::Transition;
use crate::state::manifold::MAX_TANGENT;
use crate::units::sample::Sample;
use nalgebra::DMatrix;

/// Largest number of Newton steps that refine a placed value.
const STEPS: usize = 10;

/// Size of a Newton step, in sigma of the block, below which the value counts as found.
const CONVERGED: f64 = 1e-6;

impl Ekf {
    /// Lets the sensor add and remove blocks before a sample is used. Returns the slot of the block
    /// that the sample places, if it places one.
    pub(in crate::filter) fn admit(
        &mut self,
        sample: &Sample,
        model: &dyn AnyMeasurement,
        observer: &mut dyn Observer,
    ) -> Option<usize> {
        let Parts { estimate, transients, sensors, .. } = &self.parts;
        if self.layout.labels == 0 || sensors[sample.sensor.0].isolation().is_some() {
            return None;
        }
        let mut changes = std::mem::take(&mut self.changes);
        changes.clear();
        let (layout, state, seen) = (&*self.layout, &estimate.state, transients.seen());
        let at = At { layout, state, sample };
        let mut roster = Roster { layout, state, seen, changes: &mut changes };
        model.admit(&at, &mut roster);
        let mut placed = None;
        for change in &changes.list {
            match *change {
                Change::Add { placed: true, pool, label, value } if placed.is_none() => {
                    placed = self.occupy(pool, label, &changes.values[value..]);
                }
                // a sample places one block
                Change::Add { placed: true, .. } => {}
                Change::Add { pool, label, value, .. } => {
                    if let Some(slot) = self.occupy(pool, label, &changes.values[value..]) {
                        self.give_prior(slot, observer);
                        self.report(sample, slot, Some(label), observer);
                    }
                }
                Change::Remove { pool, label } => self.marginalise(sample, pool, label, observer),
            }
        }
        self.changes = changes;
        placed
    }

    /// Gives a free block its label, its value and its truth.
    fn occupy(&mut self, pool: usize, label: u32, value: &[f64]) -> Option<usize> {
        let Parts { estimate, transients, truth, .. } = &mut self.parts;
        let (pool, state) = (&self.layout.pools[pool], &mut estimate.state);
        let free = pool.labels(state).iter().position(Option::is_none)?;
        let slot = pool.slots.start + free;
        let range = self.layout.blocks[slot].range();
        state.labels[pool.first + free] = Some(label);
        state.values[range.clone()].copy_from_slice(&value[..range.len()]);
        transients.occupy(pool.first + free, state.time);
        truth.occupy(&self.layout, slot, pool.truth(label));
        Some(slot)
    }

    /// Makes a block absent.
    fn vacate(&mut self, slot: usize) {
        let (block, state) = (&self.layout.blocks[slot], &mut self.parts.estimate.state);
        let Some(label) = block.label else { return };
        state.labels[label] = None;
        state.values[block.range()].fill(f64::NAN);
        self.parts.truth.vacate(slot);
    }

    fn give_prior(&mut self, slot: usize, observer: &mut dyn Observer) {
        let block = &self.layout.blocks[slot];
        let prior = block.prior(&self.state().values);
        let change = Transition::replacing(&self.layout, block.tangent_range(), &[], &[], &prior);
        self.replace(change, observer);
    }

    fn marginalise(
        &mut self,
        sample: &Sample,
        pool: usize,
        label: u32,
        observer: &mut dyn Observer,
    ) {
        let Some(slot) = self.layout.holder(self.state(), pool, label) else { return };
        let range = self.layout.blocks[slot].tangent_range();
        let none = DMatrix::zeros(range.len(), range.len());
        let change = Transition::replacing(&self.layout, range, &[], &[], &none);
        self.replace(change, observer);
        self.report(sample, slot, None, observer);
        self.vacate(slot);
    }

    /// Replaces the error of a block.
    fn replace(&mut self, mut change: Transition, observer: &mut dyn Observer) {
        let Parts { estimate, sensors, branch, firsts, .. } = &mut self.parts;
        change.propagate(&mut estimate.covariance);
        observer.transition(&change);
        change.carry_reaches(followed(sensors, branch, firsts));
    }

    /// Logs that a block was added with a label, or marginalised.
    fn report(
        &self,
        sample: &Sample,
        slot: usize,
        added: Option<u32>,
        observer: &mut dyn Observer,
    ) {
        let (block, state) = (&self.layout.blocks[slot], self.state());
        let pool = self.layout.pools.iter().find(|pool| pool.slots.contains(&slot));
        let noun = pool.map_or("block", |pool| pool.name.as_str());
        let label = added.or_else(|| block.label.and_then(|label| state.labels[label]));
        let (label, done) = (label.unwrap_or(0), if added.is_some() { "added" } else { "removed" });
        observer.event(Event {
            time: sample.time,
            level: Level::Info,
            about: self.composition.sensors[sample.sensor.0].info.name.clone(),
            text: format!("{noun} {label} {done}: {}", block.name),
        });
    }

    /// Returns `true` if the sample in the work space has no innovation, since its model reads a
    /// block that is absent.
    pub(in crate::filter) fn reads_absent(&self) -> bool {
        self.layout.labels > 0 && self.work.update.innovation.iter().any(|z| z.is_nan())
    }

    /// Places a new block by a sample, which is thereby used up.
    pub(in crate::filter) fn place(
        &mut self,
        slot: usize,
        sample: &Sample,
        model: &dyn AnyMeasurement,
        observer: &mut dyn Observer,
    ) {
        let present = sample.present() & self.parts.sensors[sample.sensor.0].channels;
        let Some((columns, phi, noise)) = self.solve(slot, sample, model) else {
            self.vacate(slot);
            self.reject(sample, Rejection::Absent, observer);
            return;
        };
        let range = self.layout.blocks[slot].tangent_range();
        let change = Transition::replacing(&self.layout, range, &columns, &phi, &noise);
        self.replace(change, observer);
        let label = self.layout.blocks[slot].label.and_then(|l| self.state().labels[l]);
        self.report(sample, slot, label, observer);
        self.parts.sensors[sample.sensor.0].refused = None;
        observer.update(&UpdateRecord {
            time: sample.time,
            sensor: sample.sensor,
            outcome: Outcome::Placed,
            nis: f64::NAN,
            threshold: f64::NAN,
            present,
            innovation: &[],
            covariance: &[],
        });
    }

    /// Solves `z [-] h(x, y) = 0` for a new block `y` by Newton's method. Returns the columns of
    /// `x`, `-Hy^-1 Hx` row-major and `Hy^-1 R Hy^-T`.
    fn solve(
        &mut self,
        slot: usize,
        sample: &Sample,
        model: &dyn AnyMeasurement,
    ) -> Option<(Vec<usize>, Vec<f64>, DMatrix<f64>)> {
        let range = self.layout.blocks[slot].tangent_range();
        let n = range.len();
        for step in 0..STEPS {
            if !self.evaluate(sample, model) {
                return None;
            }
            let (block, update) = (&self.layout.blocks[slot], &self.work.update);
            let w = update.columns.len();
            let first = update.columns.iter().position(|c| *c == range.start)?;
            if update.m != n {
                return None;
            }
            let h = |i: usize, j: usize| update.h[i * w + j];
            let inverse = DMatrix::from_fn(n, n, |i, j| h(i, first + j)).try_inverse()?;
            let noise = DMatrix::from_fn(n, n, |i, j| update.r[i * n + j]);
            let noise = &inverse * noise * inverse.transpose();
            let mut delta = [0.0; MAX_TANGENT];
            for (i, delta) in delta[..n].iter_mut().enumerate() {
                *delta = (0..n).map(|j| inverse[(i, j)] * update.innovation[j]).sum();
            }
            let small = |i: usize| delta[i].abs() <= CONVERGED * noise[(i, i)].sqrt();
            let found = (0..n).all(small) || (step > 0 && noise.amax() == 0.0);
            if found {
                let others: Vec<usize> =
                    (0..w).filter(|k| !(first..first + n).contains(k)).collect();
                let mut phi = Vec::with_capacity(n * others.len());
                for i in 0..n {
                    let along =
                        |k: &usize| -> f64 { (0..n).map(|j| inverse[(i, j)] * h(j, *k)).sum() };
                    phi.extend(others.iter().map(|k| -along(k)));
                }
                let columns = others.iter().map(|k| update.columns[*k]).collect();
                return Some((columns, phi, noise));
            }
            let value = &mut self.parts.estimate.state.values[block.range()];
            (block.operations.retract)(value, &delta[..n]);
        }
        None
    }
}
