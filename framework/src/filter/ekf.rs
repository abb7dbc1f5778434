//! The error-state extended Kalman filter.
//!
//! The filter owns injection, reset, gating and the covariance; models never touch them.
//! Measurements wait until the samples of the driving sensor reach their time. The filter then
//! splits the driving interval there, so that every update happens at its own time.

use super::course::guide::Guide;
use super::parts::{Parts, followed};
use super::propagate::passage::Passage;
use super::propagate::propagation::{Method, Stepper};
use super::screen::screened::Driver;
use super::update::work::Work;
use crate::compose::Composition;
use crate::compose::estimator::Linearised;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::screening::Spread;
use crate::model::process::{Input, Interval};
use crate::model::record::{Observer, Rejection};
use crate::model::sensor::Role;
use crate::model::sensor::roster::Changes;
use crate::state::Layout;
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::ops::RangeBounds;
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
    /// Set where the estimate is reported without the cases that are in doubt: they are decided later in the run.
    pub(super) decides: bool,
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
        let mut parts = Parts::new(&composition);
        if let Method::SigmaPoints(_) = method {
            parts.propagation.take_every_step();
        }
        Self {
            driver: composition.driver(),
            considered: layout.considered(),
            work: Work::new(&composition),
            stepper: Stepper::new(&composition, method),
            changes: Changes::default(),
            guide: None,
            decides: false,
            parts,
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

    /// Takes a sample like [`Self::process`], but leaves the samples of a search that ends to the
    /// caller: see [`Linearised::take_found`].
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
        let wrong = self.knows_wrong(sample, observer).then_some(Rejection::Isolated);
        let refuses = || self.parts.sensors[index].refuses(sensor, sample, is_input);
        if let Some(rejection) = wrong.or_else(refuses) {
            self.reject(sample, rejection, observer);
            self.lose_past(sample);
            return Ok(());
        }
        self.parts.sensors[index].take(sample);
        if self.driver == Some(index) {
            self.parts.sensors[index].refused = None;
            return self.screen(sample, observer);
        }
        self.use_at_its_time(sample, observer)
    }

    /// Screens a sample of the driving sensor, and drives with the samples that pass.
    fn screen(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let waits = self.parts.start.waits();
        let info = &self.composition.sensors[sample.sensor.0].info;
        if self.parts.screening.take(sample, Driver { info, waits }, observer) {
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
        let input = self.parts.pace.input_of(sample, spread);
        let Some(input) = self.reach_begin(input, observer)? else { return Ok(()) };
        if !self.running() {
            self.prepare(input, observer)?;
        }
        self.use_waiting(..=sample.time, Some(input), observer)?;
        if self.searching() && self.state().time < sample.time {
            return self.search_within(sample);
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

    /// Advances to the measurements that wait within a span of time, and uses each.
    pub(super) fn use_waiting(
        &mut self,
        span: impl RangeBounds<Time>,
        input: Option<Input<'_>>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        while !self.searching()
            && let Some(waiting) = self.parts.pace.next_within(&span)
        {
            self.advance(waiting.time, input, observer)?;
            self.use_sample(&waiting, observer)?;
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
        self.take_due(observer);
        let Self { composition, considered, stepper, parts, .. } = self;
        let (interval, estimate) = (Interval { from, to, input }, &mut parts.estimate);
        if let Some((signatures, input)) = parts.signatures.as_mut().zip(input) {
            signatures.driven(input.sample, to.since(from));
        }
        if parts.propagation.step(stepper, composition, considered, estimate, &interval)? {
            self.move_covariance(observer);
        }
        let Parts { propagation, estimate, signatures, history, .. } = &mut self.parts;
        if let Some(signatures) = signatures {
            signatures.moved(to);
        }
        if let Some(history) = history {
            history.moved(&estimate.state, propagation.transition());
        }
        Ok(())
    }

    /// Propagates the covariance over the last step, or over all steps that the pool holds.
    fn move_covariance(&mut self, observer: &mut dyn Observer) {
        let Parts { propagation, estimate, sensors, branch, firsts, .. } = &mut self.parts;
        let transition = propagation.move_covariance(&self.stepper, &mut estimate.covariance);
        observer.transition(transition);
        estimate.follow(self.guide.as_deref_mut(), &self.layout, transition);
        transition.carry_reaches(followed(sensors, branch, firsts));
        observer.moved(&estimate.state, &estimate.covariance, estimate.offset());
        self.mix();
    }

    /// Propagates the covariance to the state's time.
    pub(crate) fn settle(&mut self, observer: &mut dyn Observer) {
        if self.parts.propagation.is_behind() {
            self.move_covariance(observer);
        }
    }
}
