//! How the filter starts, and what a reference tells it.

use super::filter::{Ekf, EstimatorError, Memory, Snapshot};
use super::phase::Start;
use crate::compose::draw::displacement;
use crate::compose::moved;
use crate::model::process::{Moment, ProcessError, Report, Search};
use crate::model::record::{Epoch, Event, Level, Observer, Rejection, Truth, UpdateRecord};
use crate::model::sensor::{Reference, Role};
use crate::state::Dynamics;
use crate::state::manifold::MAX_TANGENT;
use crate::units::sample::{MAX_CHANNELS, Sample, SensorId};
use crate::units::time::Time;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::sync::Arc;

/// The most trials of a search.
const TRIALS: usize = 8;

/// What a trial leaves with a sigma `s` starts again where the trial found it, with a prior of so many `s` if that is less than
/// its own. So the samples are used twice, the first time for `1/WIDER^2` of what they tell: 4 % of the information, 2 % in
/// sigma. With ten, what is known five to ten times better than before, such as the pitch of a DVL, would stay where it was
/// stated, degrees off: what is found with it is then wrong by more than sigma.
const WIDER: f64 = 5.0;

/// The symmetric root of a covariance and its inverse, which is zero where the covariance is.
fn roots(covariance: DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let SymmetricEigen { eigenvectors: axes, eigenvalues } = covariance.symmetric_eigen();
    let along = |sigmas: DVector<f64>| &axes * DMatrix::from_diagonal(&sigmas) * axes.transpose();
    let sigmas = eigenvalues.map(|variance| variance.max(0.0).sqrt());
    (along(sigmas.clone()), along(sigmas.map(|sigma| if sigma > 0.0 { 1.0 / sigma } else { 0.0 })))
}

/// Hears nothing.
struct Nobody;

impl Observer for Nobody {
    fn epoch(&mut self, _: &Epoch<'_>) {}
    fn update(&mut self, _: &UpdateRecord<'_>) {}
    fn input(&mut self, _: &Sample, _: Option<Rejection>) {}
    fn event(&mut self, _: Event) {}
}

impl Ekf {
    /// Starts from the blocks' initial values, or from the truth that a reference just gave.
    pub(super) fn initialise(
        &mut self,
        time: Time,
        from_reference: bool,
        observer: &mut dyn Observer,
    ) {
        let m = &mut self.memory;
        let signals = std::mem::take(&mut m.state.signals);
        m.state = self.layout.initial_state();
        m.state.signals = signals;
        m.state.time = time;
        for (slot, block) in self.layout.blocks.iter().enumerate() {
            let told = from_reference && m.known[slot] && !m.constants.known[slot];
            if told {
                m.state.values[block.range()].copy_from_slice(&m.truth.values[block.range()]);
            }
            let range = block.tangent_range();
            if range.is_empty() {
                continue;
            }
            let prior = block.prior(&m.state.values);
            for (i, row) in range.clone().enumerate() {
                for (j, column) in range.clone().enumerate() {
                    m.covariance.set(row, column, prior[(i, j)]);
                }
            }
            if let Some(random) = &mut m.draws
                && told
                && let Some(delta) = displacement(block, &m.state.values, random)
            {
                (block.operations.retract)(
                    &mut m.state.values[block.range()],
                    &delta[..range.len()],
                );
            }
        }
        if self.composition.processes.iter().any(|p| p.searches) {
            self.memory.start = Start::Searching(Vec::new());
        } else {
            self.begin(observer);
        }
    }

    /// The filter runs from here on.
    fn begin(&mut self, observer: &mut dyn Observer) {
        let m = &mut self.memory;
        m.processes.iter_mut().for_each(|p| p.restart());
        if let Some(history) = &mut m.history {
            history.begin(&m.state);
        }
        m.start = Start::Running;
        let time = m.state.time;
        let text = format!("started with {} states", self.layout.tangent);
        observer.event(Event { time, level: Level::Info, about: "estimator".into(), text });
    }

    /// Keeps a sample while a process searches, and shows it to the process. When that has found, the filter starts where the
    /// search began, and takes all samples since.
    pub(super) fn search(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let good = self.refuse(sample, self.driver == Some(sample.sensor.0)).is_none();
        let m = &mut self.memory;
        let Start::Searching(held) = &mut m.start else { return Ok(()) };
        held.push(*sample);
        let Some(k) = self.composition.processes.iter().position(|p| p.searches) else {
            return Ok(());
        };
        // what is wrong with a sample is told when it is used
        if !good {
            return Ok(());
        }
        let search = m.processes[k].search(&self.layout, &mut m.state, sample);
        match search.map_err(|e| self.failed(k, sample.time, e))? {
            Search::On => return Ok(()),
            Search::Trial => self.trials(k, sample.time)?,
            Search::Found => {}
        }
        let Start::Searching(held) = std::mem::replace(&mut self.memory.start, Start::Running)
        else {
            return Ok(());
        };
        self.begin(observer);
        let m = &self.memory;
        let told = m.truth.time == m.state.time;
        let truth = told.then_some(Truth { state: &m.truth, known: &m.known });
        observer.epoch(&Epoch {
            layout: &self.layout,
            state: &m.state,
            covariance: &m.covariance,
            truth,
        });
        let period = self.composition.estimator.output_period();
        let mut next = self.memory.state.time;
        for sample in &held {
            let now = self.memory.state.time;
            // a reference tells the epochs at its own times
            if !self.has_reference() && now >= next && sample.time > now {
                next = Time::from_nanos((now.nanos().div_euclid(period) + 1) * period);
                observer.epoch(&self.epoch());
            }
            self.process(sample, observer)?;
        }
        Ok(())
    }

    /// Runs through what was seen until the process is content with the start that it finds.
    fn trials(&mut self, k: usize, time: Time) -> Result<(), EstimatorError> {
        for _ in 0..TRIALS {
            let before = self.snapshot();
            let Start::Searching(held) = std::mem::replace(&mut self.memory.start, Start::Running)
            else {
                break;
            };
            self.begin(&mut Nobody);
            let ended = held.iter().try_for_each(|sample| self.process(sample, &mut Nobody));
            let after = self.snapshot();
            self.restore(&before);
            // of a trial that ends before its end nothing is learnt
            if ended.is_ok() {
                self.learn(&after);
            }
            let m = &mut self.memory;
            let search = m.processes[k].search_again(&self.layout, &mut m.state);
            if search.map_err(|e| self.failed(k, time, e))? != Search::Trial {
                break;
            }
        }
        Ok(())
    }

    /// Takes over, of the blocks that no process moves, what a trial knows far better than their prior does.
    ///
    /// That is told by directions, not by components: along the axes in which the trial's covariance is diagonal where the
    /// prior is the identity. A DVL on a vehicle that goes ahead tells nothing of a rotation about the velocity as it reads it,
    /// which with degrees of misalignment is no axis of its own; a prior that is narrow along these axes would tell of it.
    ///
    /// The prior of a constant becomes narrow too, which holds it where the trial has found it: with all of a wide prior the
    /// first samples, which tell little of it, would carry it off, and the filter would linearise in the wrong place after
    /// all. What wanders keeps its prior: what a trial finds at its end it need not have been at the start.
    fn learn(&mut self, Snapshot(after): &Snapshot) {
        let moved = moved(&self.layout, &self.composition.processes);
        let Memory { state, covariance, .. } = &mut self.memory;
        for (block, _) in self
            .layout
            .blocks
            .iter()
            .zip(moved)
            .filter(|(block, moved)| block.estimated() && !moved)
        {
            let (n, first) = (block.operations.tangent, block.tangent_range().start);
            let found = &after.state.values[block.range()];
            let mut back = [0.0; MAX_TANGENT];
            (block.operations.local)(&state.values[block.range()], found, &mut back[..n]);
            state.values[block.range()].copy_from_slice(found);
            // from where the trial found it back to where it was, along the directions that the trial did not find
            let (root, inverse) = roots(block.prior(&state.values));
            let left = DMatrix::from_fn(n, n, |i, j| after.covariance.get(first + i, first + j));
            let parts = (&inverse * left * &inverse).symmetric_eigen();
            let parted = parts.eigenvalues.map(|part| part.max(0.0) * WIDER * WIDER);
            let mut along =
                parts.eigenvectors.tr_mul(&(inverse * DVector::from_column_slice(&back[..n])));
            along
                .iter_mut()
                .zip(&parted)
                .filter(|(_, part)| **part < 1.0)
                .for_each(|(a, _)| *a = 0.0);
            let back = root * &parts.eigenvectors * along;
            (block.operations.retract)(&mut state.values[block.range()], back.as_slice());
            let constant = matches!(block.spec.dynamics, Dynamics::Constant);
            let narrow = parted.map(|part| if constant { part.min(1.0).sqrt() } else { 1.0 });
            let root = roots(block.prior(&state.values)).0
                * &parts.eigenvectors
                * DMatrix::from_diagonal(&narrow);
            let prior = &root * root.transpose();
            for i in 0..n {
                for j in 0..=i {
                    covariance.set(first + i, first + j, prior[(i, j)]);
                }
            }
        }
    }

    /// Asks the processes that watch, and corrects the state by the constraint of one that says that it holds.
    pub(super) fn watch(&mut self, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        for k in 0..self.memory.processes.len() {
            let constraint = self.composition.processes[k].constraint;
            let m = &mut self.memory;
            let gated = constraint
                .and_then(|c| m.sensors[c].gated)
                .map(|streak| (streak.since, streak.count));
            let now =
                Moment { layout: &self.layout, state: &m.state, covariance: &m.covariance, gated };
            let watch = m.processes[k]
                .watch(&now)
                .map_err(|e| self.failed(k, self.memory.state.time, e))?;
            let time = self.memory.state.time;
            if let Some((level, text)) = watch.said {
                observer.event(Event {
                    time,
                    level,
                    about: self.composition.processes[k].name.clone(),
                    text,
                });
            }
            if let Some(index) = constraint.filter(|_| watch.constrain)
                && let Role::Measurement(model) = &self.composition.sensors[index].role
            {
                let model = Arc::clone(model);
                let sample =
                    Sample::new(time, SensorId(index), &[0.0; MAX_CHANNELS][..model.channels()]);
                self.memory.sensors[index].last = time;
                self.correct(&sample, model.as_ref(), observer)?;
            }
        }
        Ok(())
    }

    fn failed(&self, k: usize, time: Time, error: ProcessError) -> EstimatorError {
        let process = self.composition.processes[k].name.clone();
        EstimatorError::Process { time, process, error }
    }

    /// What a process has not finished.
    pub(crate) fn unfinished(&self) -> impl Iterator<Item = Event> + '_ {
        let m = &self.memory;
        let now = Moment {
            layout: &self.layout,
            state: &m.state,
            covariance: &m.covariance,
            gated: None,
        };
        let parts = m.processes.iter().zip(&self.composition.processes);
        parts.filter_map(move |(model, part)| {
            let (level, text) = model.unfinished(&now)?;
            Some(Event { time: now.state.time, level, about: part.name.clone(), text })
        })
    }

    /// How processes found their start, each with its name.
    pub(crate) fn reports(&self) -> impl Iterator<Item = (&str, Report)> + '_ {
        let parts = self.memory.processes.iter().zip(&self.composition.processes);
        parts.filter_map(|(model, part)| Some((part.name.as_str(), model.report()?)))
    }

    /// A reference's sample: the filter starts from it if it waits for one, and is compared with it at its own time.
    pub(super) fn follow(
        &mut self,
        sample: &Sample,
        reference: &dyn Reference,
        observer: &mut dyn Observer,
    ) {
        let m = &mut self.memory;
        let behind = m.input.is_some_and(|input| sample.time < input);
        let (starts, compares) = match m.start {
            // one that comes after later driving samples is too late: they could not be used again
            Start::FromReference(start) => (sample.time >= start && !behind, false),
            Start::At(_) | Start::Searching(_) => (false, false),
            Start::Running => (false, sample.time == m.state.time),
        };
        if !starts && !compares {
            return;
        }
        let Some(mut motion) = reference.motion(&self.layout, &m.state, sample) else { return };
        motion.time = sample.time;
        m.constants.advance(&self.layout, sample.time);
        m.truth.values.copy_from_slice(&m.constants.state.values);
        m.truth.time = sample.time;
        m.known.copy_from_slice(&m.constants.known);
        for process in &m.processes {
            process.follow(&self.layout, &motion, &mut m.truth, &mut m.known);
        }
        if starts {
            self.initialise(sample.time, true, observer);
        }
        if !self.running() {
            return; // nothing to compare before a process has found its start
        }
        let m = &self.memory;
        let truth = Some(Truth { state: &m.truth, known: &m.known });
        observer.epoch(&Epoch {
            layout: &self.layout,
            state: &m.state,
            covariance: &m.covariance,
            truth,
        });
    }
}
