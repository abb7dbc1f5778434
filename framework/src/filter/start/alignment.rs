//! Initial alignment in the filter: search, trials, and supervision until the alignment is
//! complete.

use super::stage::Stage;
use crate::compose::moved;
use crate::filter::ekf::Ekf;
use crate::filter::estimate::Estimate;
use crate::filter::parts::Parts;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::ProcessError;
use crate::model::process::start::{AlignmentReport, Progress};
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::{Event, Observer};
use crate::model::sensor::Role;
use crate::state::Dynamics;
use crate::state::manifold::MAX_TANGENT;
use crate::units::sample::{MAX_CHANNELS, Sample, SensorId};
use crate::units::time::Time;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::sync::Arc;

/// Largest number of trials of a search.
const TRIALS: usize = 8;

/// Ratio between the prior sigma after a trial and the trial's own sigma.
///
/// The filter uses the samples of the trial a second time, so the first use must carry little
/// information: with a ratio of 5 it carries `1/5^2` = 4 % of the information, 2 % in sigma. A
/// larger ratio fails elsewhere: with 10, a component that the trial improves five to ten times,
/// such as the pitch of a DVL, would keep its stated value although this is degrees off, and the
/// resulting alignment would be wrong by more than its sigma.
const WIDENING: f64 = 5.0;

/// Symmetric root of a covariance, and the inverse root, which is zero where the covariance is
/// zero.
fn roots(covariance: DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let SymmetricEigen { eigenvectors: axes, eigenvalues } = covariance.symmetric_eigen();
    let along = |sigmas: DVector<f64>| &axes * DMatrix::from_diagonal(&sigmas) * axes.transpose();
    let sigmas = eigenvalues.map(|variance| variance.max(0.0).sqrt());
    (along(sigmas.clone()), along(sigmas.map(|sigma| if sigma > 0.0 { 1.0 / sigma } else { 0.0 })))
}

impl Ekf {
    /// Buffers a sample during a search and passes it to the alignment. When the initial values are
    /// found, the filter is ready to begin at the start of the search, and to take the buffered
    /// samples.
    pub(in crate::filter) fn search(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        let (index, sensors) = (sample.sensor.0, &self.composition.sensors);
        let is_driver = self.driver == Some(index);
        let good = self.parts.sensors[index].refuses(&sensors[index], sample, is_driver).is_none();
        let Parts { start, estimate, .. } = &mut self.parts;
        let Stage::Searching(buffer) = &mut start.stage else { return Ok(()) };
        buffer.push(*sample);
        // a faulty sample is reported later, when the filter processes it
        if !good {
            return Ok(());
        }
        let Some((k, alignment)) = start.alignments.iter_mut().enumerate().find_map(|(k, a)| {
            let searches = self.composition.processes[k].searches;
            a.as_mut().filter(|_| searches).map(|a| (k, a))
        }) else {
            return Ok(());
        };
        // the alignment sees what the process will see, with the initial states of input models
        let correction = self.composition.sensors[sample.sensor.0].correction.as_ref();
        let corrected = correction.map(|c| c.correct(&self.layout, &estimate.state, sample));
        let sample = corrected.as_ref().unwrap_or(sample);
        let progress = alignment.search(&self.layout, &mut estimate.state, sample);
        let progress = progress.map_err(|e| self.process_error(k, sample.time, e))?;
        if progress == Progress::Searching {
            return Ok(());
        }
        let stage = std::mem::replace(&mut self.parts.start.stage, Stage::Running);
        let Stage::Searching(buffer) = stage else { return Ok(()) };
        let tried = match progress {
            Progress::Trial => self.trials(k, sample.time, &buffer),
            Progress::Searching | Progress::Found => Ok(()),
        };
        self.parts.start.stage =
            if tried.is_ok() { Stage::Found(buffer) } else { Stage::Searching(buffer) };
        tried
    }

    /// Shows a driving sample to a search that began within its interval: the first one that the
    /// search sees.
    pub(in crate::filter) fn search_within(
        &mut self,
        sample: &Sample,
    ) -> Result<(), EstimatorError> {
        let before = self.parts.pace.input().unwrap_or(Time::MIN);
        self.parts.sensors[sample.sensor.0].last = before;
        self.search(sample)
    }

    /// Begins to run with the initial values that a search has found.
    pub(in crate::filter) fn begin_found(&mut self, observer: &mut dyn Observer) {
        self.begin(observer);
        let Parts { estimate, truth, .. } = &self.parts;
        observer.epoch(&estimate.epoch(&self.layout, truth.at(estimate.state.time)));
    }

    /// Runs through the buffered samples until the alignment accepts the initial values.
    fn trials(&mut self, k: usize, time: Time, buffer: &[Sample]) -> Result<(), EstimatorError> {
        for _ in 0..TRIALS {
            let before = self.snapshot();
            // the prior that a trial finds is that of the first pass
            self.parts.estimate.offset = None;
            self.begin(&mut ());
            let ended = buffer.iter().try_for_each(|sample| self.take(sample, &mut ()));
            let after = self.parts.estimate.clone();
            self.restore(&before);
            // a trial that fails before its end gives no estimate
            if ended.is_ok() {
                self.adopt(&after);
            }
            let Parts { start, estimate, .. } = &mut self.parts;
            let Some(alignment) = &mut start.alignments[k] else { break };
            let progress = alignment.search_again(&self.layout, &mut estimate.state);
            if progress.map_err(|e| self.process_error(k, time, e))? != Progress::Trial {
                break;
            }
        }
        Ok(())
    }

    /// Adopts a trial's estimates of the blocks that no process moves, where they are much more
    /// certain than the prior.
    ///
    /// The comparison goes by directions, not by components: along the axes in which the trial's
    /// covariance is diagonal and the prior is the identity. A DVL on a vehicle that moves straight
    /// ahead does not observe a rotation about the velocity vector, and with degrees of
    /// misalignment that rotation is no component of its own; a prior that is narrow in single
    /// components would constrain it.
    ///
    /// The prior of a constant becomes narrow along the adopted directions, which holds the
    /// constant where the trial found it: with the full prior the first samples, which carry little
    /// information, would move it away, and the filter would linearise in the wrong place again. A
    /// block that wanders keeps its prior, since its value at the end of the trial is not its value
    /// at the start.
    fn adopt(&mut self, after: &Estimate) {
        let moved = moved(&self.layout, &self.composition.processes);
        let Estimate { state, covariance, .. } = &mut self.parts.estimate;
        let blocks = self.layout.blocks.iter().zip(moved);
        for (block, _) in blocks.filter(|(block, moved)| block.estimated() && !moved) {
            let (n, first) = (block.operations.tangent, block.tangent_range().start);
            let found = &after.state.values[block.range()];
            let mut back = [0.0; MAX_TANGENT];
            (block.operations.local)(&state.values[block.range()], found, &mut back[..n]);
            state.values[block.range()].copy_from_slice(found);
            // back to the prior value along the directions that the trial did not find
            let (root, inverse) = roots(block.prior(&state.values));
            let left = DMatrix::from_fn(n, n, |i, j| after.covariance.get(first + i, first + j));
            let parts = (&inverse * left * &inverse).symmetric_eigen();
            let widened = parts.eigenvalues.map(|part| part.max(0.0) * WIDENING * WIDENING);
            let whitened = inverse * DVector::from_column_slice(&back[..n]);
            let mut along = parts.eigenvectors.tr_mul(&whitened);
            let adopted = along.iter_mut().zip(&widened).filter(|(_, part)| **part < 1.0);
            adopted.for_each(|(a, _)| *a = 0.0);
            let back = root * &parts.eigenvectors * along;
            (block.operations.retract)(&mut state.values[block.range()], back.as_slice());
            let constant = matches!(block.spec.dynamics, Dynamics::Constant);
            let narrow = widened.map(|part| if constant { part.min(1.0).sqrt() } else { 1.0 });
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

    /// Lets every alignment supervise the filter, and applies the constraint of a process where the
    /// alignment asks for it.
    pub(in crate::filter) fn supervise(
        &mut self,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        for k in 0..self.parts.start.alignments.len() {
            let constraint = self.composition.processes[k].constraint;
            let Parts { start, sensors, estimate, .. } = &mut self.parts;
            let Some(alignment) = &mut start.alignments[k] else { continue };
            let streak = constraint.and_then(|c| sensors[c].lockout.streak);
            let gated = streak.map(|streak| (streak.since, streak.count));
            let view = estimate.view(&self.layout, gated);
            let supervision = alignment
                .supervise(&view)
                .map_err(|e| self.process_error(k, self.state().time, e))?;
            let time = self.state().time;
            let again = self.composition.estimator.linearises_again();
            if let Some((text, remedy)) = supervision.doubt.filter(|_| !again) {
                let about = self.composition.processes[k].name.clone();
                let (severity, basis) = (Severity::Doubtful, Basis::Comparison);
                observer.finding(Finding { time, about, severity, basis, text, remedy });
            }
            if let Some((level, text)) = supervision.message {
                let about = self.composition.processes[k].name.clone();
                observer.event(Event { time, level, about, text });
            }
            if let Some(index) = constraint.filter(|_| supervision.constrain)
                && let Role::Measurement(model) = &self.composition.sensors[index].role
            {
                let model = Arc::clone(model);
                let zeros = &[0.0; MAX_CHANNELS][..model.channels()];
                let sample = Sample::new(time, SensorId(index), zeros);
                self.parts.sensors[index].last = time;
                self.correct(&sample, model.as_ref(), observer)?;
            }
        }
        Ok(())
    }

    fn process_error(&self, k: usize, time: Time, error: ProcessError) -> EstimatorError {
        let process = self.composition.processes[k].name.clone();
        EstimatorError::Process { time, process, error }
    }

    /// Incomplete alignments, one event each.
    pub(crate) fn unfinished(&self) -> impl Iterator<Item = Event> + '_ {
        let Parts { start, estimate, .. } = &self.parts;
        let view = estimate.view(&self.layout, None);
        let parts = start.alignments.iter().zip(&self.composition.processes);
        parts.filter_map(move |(alignment, part)| {
            let (level, text) = alignment.as_ref()?.unfinished(&view)?;
            Some(Event { time: view.state.time, level, about: part.name.clone(), text })
        })
    }

    /// Results of the alignments, each with the name of its process.
    pub(crate) fn alignments(&self) -> impl Iterator<Item = (&str, AlignmentReport)> + '_ {
        let processes = &self.composition.processes;
        let reports = self.parts.start.reports();
        reports.map(|(k, report)| (processes[k].name.as_str(), report))
    }
}
