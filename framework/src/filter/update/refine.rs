//! Refinement of an update that passed the gate: robust weights, and the rule.

use crate::model::sensor::robust::Robust;
use crate::model::sensor::rule::{Prior, Rule};
use crate::state::covariance::Update;

/// The innovation that the gate judged, with its memory allocated once.
#[derive(Default)]
pub(in crate::filter) struct Refinement {
    innovation: Vec<f64>,
    s: Vec<f64>,
}

impl Refinement {
    /// Weighs the channels as the sensor asks, and lets its rule move the linearisation. Returns
    /// `false` if the innovation covariance becomes singular: the sample cannot be used. Call after
    /// [`Update::innovate`] and before the outcome is recorded.
    pub(in crate::filter) fn run(
        &mut self,
        prior: &Prior<'_>,
        rule: &mut dyn Rule,
        robust: Robust,
        update: &mut Update,
    ) -> bool {
        self.innovation.clone_from(&update.innovation);
        self.s.clone_from(&update.s);
        if robust != Robust::Off
            && update.weigh(|e| robust.weight(e))
            && update.innovate(prior.covariance).is_none()
        {
            return false;
        }
        !rule.accepted(prior, update) || update.innovate(prior.covariance).is_some()
    }

    /// Innovation and its covariance as the gate judged them. Call after [`Self::run`].
    pub(in crate::filter) fn judged(&self) -> (&[f64], &[f64]) {
        (&self.innovation, &self.s)
    }
}
