//! The filters of the framework as estimators that linearise.

use super::ekf::Ekf;
use super::ukf::Ukf;
use crate::compose::course::Course;
use crate::compose::{estimator::Linearised, snapshot::Snapshot};
use crate::model::estimator_error::EstimatorError;
use crate::model::record::{Observer, Rejection};
use crate::state::covariance::Covariance;
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::io;

impl Linearised for Ekf {
    fn base(&self) -> &dyn Linearised {
        self
    }
    fn base_mut(&mut self) -> &mut dyn Linearised {
        self
    }
    fn take(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        self.take(sample, observer)
    }
    fn take_found(&mut self) -> Option<Vec<Sample>> {
        self.parts.start.take_found()
    }
    fn snapshot(&self) -> Snapshot {
        self.snapshot()
    }
    fn restore(&mut self, snapshot: &Snapshot) {
        self.restore(snapshot);
    }
    fn wrong(&mut self) -> &mut Vec<(usize, Time)> {
        &mut self.parts.wrong
    }
    fn foresee(&mut self) {
        self.decides = self.parts.estimate.mixture.is_none();
    }
    fn exchange(&mut self, snapshot: &mut Snapshot) {
        if let Some(parts) = snapshot.kept_mut() {
            std::mem::swap(&mut self.parts, parts);
        }
    }
    fn reject(&mut self, sample: &Sample, rejection: Rejection, observer: &mut dyn Observer) {
        self.reject(sample, rejection, observer);
    }
    fn searching(&self) -> bool {
        self.searching()
    }
    fn propagated(&self) -> &Covariance {
        self.parts.estimate.reported()
    }
    fn considered(&self) -> &[bool] {
        &self.considered
    }
    fn open_gates(&mut self) {
        let slots = self.parts.sensors.iter_mut();
        slots.for_each(|slot| slot.thresholds.fill(f64::INFINITY));
    }
    fn follow_course(&mut self, course: Box<dyn Course>) {
        self.follow_course(course);
    }
    fn leave_course(&mut self) {
        self.leave_course();
    }
    fn join_course(&mut self) -> Vec<f64> {
        self.join_course()
    }
    fn course_failed(&mut self) -> Option<io::Error> {
        self.course_failed()
    }
    fn offset(&self) -> &[f64] {
        self.parts.estimate.offset()
    }
}

impl Linearised for Ukf {
    fn base(&self) -> &dyn Linearised {
        self.filter()
    }
    fn base_mut(&mut self) -> &mut dyn Linearised {
        self.filter_mut()
    }
}
