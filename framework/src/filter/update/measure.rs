//! Use of a sample at the state's time, by the role of its sensor.

use crate::filter::ekf::Ekf;
use crate::model::estimator_error::EstimatorError;
use crate::model::record::{Observer, Rejection};
use crate::model::sensor::Role;
use crate::units::sample::Sample;
use std::sync::Arc;

impl Ekf {
    /// Uses a measurement or reference at the state's time, or rejects it.
    pub(in crate::filter) fn use_sample(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let role = &self.composition.sensors[sample.sensor.0].role;
        if !matches!(role, Role::Input(_)) {
            self.settle(observer);
        }
        match &self.composition.sensors[sample.sensor.0].role {
            Role::Input(_) => {
                self.hold(sample, observer);
                Ok(())
            }
            Role::Reference(reference) => {
                let reference = Arc::clone(reference);
                self.follow(sample, reference.as_ref(), observer);
                Ok(())
            }
            Role::Measurement(_) if !self.running() => Ok(()),
            Role::Measurement(_) if sample.time < self.state().time => {
                self.reject(sample, Rejection::Late, observer);
                self.lose_past(sample);
                Ok(())
            }
            Role::Measurement(model) => {
                let (model, mut completed) = (Arc::clone(model), *sample);
                model.complete(&mut completed);
                let event = self.composition.sensors[sample.sensor.0].is_event(&completed);
                if self.has_past(sample.sensor.0) && !event {
                    match self.admit(&completed, model.as_ref(), observer) {
                        Some(slot) => self.place(slot, &completed, model.as_ref(), observer),
                        None => self.correct(&completed, model.as_ref(), observer)?,
                    }
                }
                if model.keyframe(&completed) {
                    self.take_past(sample.sensor.0, observer);
                }
                self.detect(sample, observer)
            }
        }
    }
}
