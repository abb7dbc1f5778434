//! The smoother of a run, over the whole of it or with a fixed lag.

use super::error::SmoothError;
use super::forward::Forward;
use super::lag::Lagged;
use super::passes;
use super::quality::QualityReport;
use crate::compose::estimator::Linearised;
use crate::model::record::Epoch;
use crate::state::covariance::{Transition, Update};
use crate::units::sample::Sample;
use crate::units::time::Time;

/// Follows the filter of a run, and gives the smoothed estimates.
pub(crate) struct Smoother {
    forward: Forward,
    lagged: Option<Lagged>,
    error: Option<SmoothError>,
}

impl Smoother {
    /// Prepares for a filter that has not started; `None` if its run is not smoothed.
    pub(crate) fn new(ekf: &dyn Linearised) -> Result<Option<Self>, SmoothError> {
        let estimator = &ekf.composition().estimator;
        if !estimator.smooths() {
            return Ok(None);
        }
        let forward = Forward::new(ekf, estimator.passes() > 1)?;
        let lagged = estimator.lag().map(|lag| Lagged::new(ekf, lag)).transpose()?;
        Ok(Some(Self { forward, lagged, error: None }))
    }

    /// Begins at the start of the filter, which a search has found: the samples until now do not
    /// belong to the smoothed run.
    pub(crate) fn begin(&mut self, ekf: &dyn Linearised) {
        self.error = self.forward.begin(ekf).err();
    }

    /// Notes a sample that the filter takes next.
    pub(crate) fn sample(&mut self, ekf: &dyn Linearised, sample: &Sample) {
        self.forward.sample(ekf, sample);
    }

    /// Notes that the runner records the estimate. That of a filter that has failed has taken a
    /// part of the last step, and is not smoothed.
    pub(crate) fn epoch_between(&mut self, time: Time) {
        if self.forward.failed_step {
            return;
        }
        self.forward.epoch_between();
        self.wait(time, true);
    }

    /// Notes an estimate of the filter, and whether the run records it.
    pub(crate) fn epoch(&mut self, time: Time, recorded: bool) {
        self.forward.epoch(recorded);
        self.wait(time, recorded);
    }

    fn wait(&mut self, time: Time, recorded: bool) {
        if let Some(lagged) = self.lagged.as_mut().filter(|_| recorded) {
            lagged.epoch(time);
        }
    }

    pub(crate) fn transition(&mut self, transition: &Transition) {
        self.forward.transition(transition);
        if let Some(lagged) = &mut self.lagged {
            lagged.transition(transition);
        }
    }

    pub(crate) fn correction(&mut self, update: &Update) {
        self.forward.correction(update);
        if let Some(lagged) = &mut self.lagged {
            lagged.correction(update);
        }
    }

    pub(crate) fn gated(&mut self, update: &Update) {
        self.forward.gated(update);
    }

    /// Notes that the filter uses the samples that it holds.
    pub(crate) fn finish(&mut self) {
        self.forward.finish();
    }

    /// Forgets the last step, in which the filter failed.
    pub(crate) fn take_back(&mut self) {
        self.forward.take_back();
        if let Some(lagged) = &mut self.lagged {
            lagged.take_back();
        }
    }

    /// Error of the smoother, if there was one.
    pub(crate) fn failed(&mut self) -> Option<SmoothError> {
        self.error.take().or_else(|| self.forward.failed())
    }

    /// Returns `true` if an estimate is complete of which the filter is the lag ahead.
    pub(crate) fn is_due(&self, now: Time) -> bool {
        self.lagged.as_ref().is_some_and(|lagged| lagged.is_due(now))
    }

    /// Passes the complete estimates to `each`.
    pub(crate) fn release(&mut self, ekf: &mut dyn Linearised, each: impl FnMut(&Epoch<'_>)) {
        if let Some(lagged) = &mut self.lagged {
            self.error = lagged.release(&mut self.forward, ekf, each).err();
        }
    }

    /// Passes all other estimates to `each`, after the last sample. The filter is left in any
    /// state.
    pub(crate) fn end(
        mut self,
        ekf: &mut dyn Linearised,
        mut each: impl FnMut(&Epoch<'_>),
    ) -> Result<Option<QualityReport>, SmoothError> {
        if let Some(error) = self.failed() {
            return Err(error);
        }
        if let Some(lagged) = &mut self.lagged {
            lagged.finish(&mut self.forward, ekf, each)?;
            return Ok(None);
        }
        let passes = ekf.composition().estimator.passes();
        let mut smoothed = passes::smooth(&mut self.forward, ekf, passes)?;
        let quality = std::mem::take(&mut smoothed.quality);
        smoothed.each(&mut each)?;
        Ok(Some(quality))
    }
}
