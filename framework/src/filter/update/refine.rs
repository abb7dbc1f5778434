//! Refinement of an update that passed the gate: robust weights, and the iteration.

use crate::filter::update::iterated::Iterated;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::robust::Robust;
use crate::model::sensor::update_rule::UpdateRule;
use crate::state::covariance::{Covariance, Update};

/// Refinement, and the innovation that the gate judged, with their memory allocated once.
#[derive(Default)]
pub(in crate::filter) struct Refinement {
    iterated: Iterated,
    innovation: Vec<f64>,
    s: Vec<f64>,
    refined: bool,
}

impl Refinement {
    /// Weighs the channels and moves the linearisation, as the sensor asks. Returns `false` if the
    /// innovation covariance becomes singular: the sample cannot be used. Call after
    /// [`Update::innovate`] and before the outcome is recorded.
    pub(in crate::filter) fn run(
        &mut self,
        (at, model): (&At<'_>, &dyn AnyMeasurement),
        (rule, robust): (UpdateRule, Robust),
        covariance: &Covariance,
        considered: &[bool],
        update: &mut Update,
    ) -> bool {
        self.refined = robust != Robust::Off || rule == UpdateRule::Iekf;
        if !self.refined {
            return true;
        }
        self.innovation.clone_from(&update.innovation);
        self.s.clone_from(&update.s);
        if robust != Robust::Off
            && update.weigh(|e| robust.weight(e))
            && update.innovate(covariance).is_none()
        {
            return false;
        }
        if rule == UpdateRule::Iekf {
            self.iterated.iterate(at, model, covariance, considered, update);
            return update.innovate(covariance).is_some();
        }
        true
    }

    /// Innovation and its covariance as the gate judged them. Call after [`Self::run`].
    pub(in crate::filter) fn judged<'a>(&'a self, update: &'a Update) -> (&'a [f64], &'a [f64]) {
        if self.refined { (&self.innovation, &self.s) } else { (&update.innovation, &update.s) }
    }

    /// Replaces the linear step of an iterated update that has not converged. Call after
    /// [`Update::apply`].
    pub(in crate::filter) fn correct(&self, delta: &mut [f64]) {
        self.iterated.correct(delta);
    }
}
