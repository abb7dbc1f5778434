//! The error-state extended Kalman filter.
//!
//! The filter owns injection, reset, gating and the covariance; models never touch them.
//! Measurements wait until the samples of the driving sensor reach their time. The filter then
//! splits the driving interval there, so that every update happens at its own time.

use super::course::guide::Guide;
use super::parts::Parts;
use super::propagate::passage::Passage;
use super::propagate::propagation::{Method, Stepper};
use super::update::work::Work;
use crate::compose::Composition;
use crate::compose::estimator::Linearised;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::screening::Spread;
use crate::model::process::{Input, Interval};
use crate::model::record::{Observer, Rejection};
use crate::model::sensor::Role;
use crate::model::sensor::roster::Changes;
use crate::state::{Layout, Mode};
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::sync::Arc;

/// An error-state EKF, which takes samples in order of time.
pub struct Ekf {
    pub(super) composition: Composition,
    pub(super) layout: Arc<Layout>,
    /// Sensor that drives the first driven process.
    pub(super) driver: Option<usize>,
    pub(super) considered: Vec<bool>,
    /// Work space of updates.
    pub(super) work: Work,
    /// Work space of steps, with their method.
    pub(super) stepper: Stepper,
    /// Work space for the blocks that come and go.
    pub(super) changes: Changes,
    /// Trajectory at which a further pass of the smoother linearises.
    pub(super) guide: Option<Box<Guide>>,
    /// Everything that changes while the filter runs.
    pub(super) parts: Parts,
}

impl Ekf {
    /// Creates a filter for the composition, which waits for its start.
    pub fn new(composition: Composition) -> Self {
        Self::with(composition, Method::Linear)
    }

    /// Creates a filter that propagates by sigma points.
    pub(super) fn with_sigma_points(composition: Composition) -> Self {
        let passage = Box::new(Passage::new(&composition.layout));
        Self::with(composition, Method::SigmaPoints(passage))
    }

    fn with(composition: Composition, method: Method) -> Self {
        let layout = Arc::clone(&composition.layout);
        let mut considered = vec![false; layout.tangent];
        for block in layout.blocks.iter().filter(|b| b.spec.mode == Mode::Consider) {
            considered[block.tangent_range()].fill(true);
        }
        Self {
            driver: composition.processes.iter().find_map(|p| p.input),
            considered,
            work: Work::new(&composition),
            stepper: Stepper::new(&composition, method),
            changes: Changes::default(),
            guide: None,
            parts: Parts::new(&composition),
            layout,
            composition,
        }
    }

    /// Takes a sample: propagates to its time and uses it.
    ///
    /// # Errors
    /// When the filter cannot continue. The estimate before the sample stays.
    pub fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        self.take(sample, observer)?;
        match self.take_found() {
            Some(samples) => self.catch_up(&samples, observer),
            None => Ok(()),
        }
    }

    /// Takes a sample as [`Self::process`] does, except that the samples of a search that ends are
    /// left to the caller: see [`Linearised::take_found`].
    pub(crate) fn take(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        if self.searching() {
            return self.search(sample);
        }
        if self.parts.start.has_found() {
            self.begin_found(observer);
        }
        let index = sample.sensor.0;
        let sensor = &self.composition.sensors[index];
        let is_input = matches!(sensor.role, Role::Input(_));
        if let Some(rejection) = self.parts.sensors[index].refuses(sensor, sample, is_input) {
            self.reject(sample, rejection, observer);
            self.lose_past(sample);
            return Ok(());
        }
        self.parts.sensors[index].take(sample);
        if self.driver == Some(index) {
            self.parts.sensors[index].refused = None;
            return self.screen(sample, observer);
        }
        if self.driver.is_none() {
            if self.parts.start.is_due(sample.time) {
                self.initialise(sample.time, false, observer);
            }
            self.advance(sample.time, None, observer)?;
            return self.use_sample(sample, observer);
        }
        if self.parts.pace.input().is_some_and(|input| sample.time <= input) {
            return self.use_sample(sample, observer);
        }
        self.wait(sample, observer);
        self.coast_on(sample.time, observer)
    }

    /// Screens a sample of the driving sensor, and drives with the samples that pass.
    fn screen(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let waits = self.parts.start.waits();
        let info = &self.composition.sensors[sample.sensor.0].info;
        if self.parts.screening.take(sample, (info, waits), observer) {
            return self.drive(sample, None, observer);
        }
        self.use_screened(observer)
    }

    /// Drives with the samples that the screening has released.
    pub(super) fn use_screened(
        &mut self,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        while let Some((sample, spread)) = self.parts.screening.next() {
            self.drive(&sample, spread.as_ref(), observer)?;
        }
        Ok(())
    }

    /// Takes a driving sample, and uses the queued samples within its interval on the way.
    fn drive(
        &mut self,
        sample: &Sample,
        spread: Option<&Spread>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let (duration, usual) = self.parts.pace.intervals(sample);
        if self.running() && sample.time <= self.state().time && duration > usual {
            self.reject(sample, Rejection::Late, observer); // time went on without it
            return Ok(());
        }
        let begin = self.coast_to(sample, duration, usual, observer)?;
        let duration = if begin.is_some() { usual } else { duration };
        if usual < duration {
            self.report_missing(sample, duration, usual, observer);
        }
        let input = Input { sample, duration, usual, spread };
        if !self.running() {
            self.prepare(input, observer);
        }
        while !self.searching()
            && let Some(waiting) = self.parts.pace.next_until(sample.time)
        {
            self.advance(waiting.time, Some(input), observer)?;
            self.use_sample(&waiting, observer)?;
        }
        if self.searching() && self.state().time < sample.time {
            // the search began within the interval of this sample, which is the first one that it
            // sees
            let before = self.parts.pace.input().unwrap_or(Time::MIN);
            self.parts.sensors[sample.sensor.0].last = before;
            return self.search(sample);
        }
        self.parts.pace.reach(sample);
        self.advance(sample.time, Some(input), observer)?;
        observer.input(sample, None);
        if self.running() {
            self.watch_input(input, observer);
            self.supervise(observer)?;
            self.detect(sample, observer)?;
        }
        Ok(())
    }

    /// Propagates state and covariance to a later time.
    pub(super) fn advance(
        &mut self,
        to: Time,
        input: Option<Input<'_>>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let from = self.state().time;
        if to <= from || !self.running() {
            return Ok(());
        }
        let Self { composition, considered, stepper, parts, .. } = self;
        let (interval, run) = (Interval { from, to, input }, (&*composition, &considered[..]));
        if parts.propagation.step(stepper, run, &mut parts.estimate, &interval)? {
            self.move_covariance(observer);
        }
        Ok(())
    }

    /// Propagates the covariance over the last step, or over all steps that the pool holds.
    fn move_covariance(&mut self, observer: &mut dyn Observer) {
        let Parts { propagation, estimate, sensors, signatures, history, .. } = &mut self.parts;
        let transition = propagation.move_covariance(&self.stepper, &mut estimate.covariance);
        observer.transition(transition);
        if let Some((guide, offset)) = self.guide.as_mut().zip(estimate.offset.as_mut()) {
            guide.propagate(&self.layout, &mut estimate.state, offset, transition);
        }
        observer.moved(&estimate.state, &estimate.covariance, estimate.offset());
        for slot in sensors.iter_mut().filter(|slot| !slot.reach.is_empty()) {
            transition.carry_reach(&mut slot.reach);
        }
        if let Some(signatures) = signatures {
            signatures.moved(estimate.state.time);
        }
        if let Some(history) = history {
            history.moved(&estimate.state, transition);
        }
    }

    /// Propagates the covariance to the state's time.
    pub(crate) fn settle(&mut self, observer: &mut dyn Observer) {
        if self.parts.propagation.is_behind() {
            self.move_covariance(observer);
        }
    }
}
