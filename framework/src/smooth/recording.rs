//! What a filter and its passes show to their records, and to the observer of the run.

use super::means::Records;
use crate::model::record::finding::{Basis, Finding};
use crate::model::record::{Observer, UpdateRecord};
use crate::state::State;
use crate::state::covariance::{Covariance, Transition, Update};

/// Keeps a finding if it compares samples with the estimate, and returns any other.
fn kept(findings: &mut Vec<Finding>, finding: Finding) -> Option<Finding> {
    if finding.basis == Basis::Samples {
        return Some(finding);
    }
    findings.push(finding);
    None
}

/// Shows what a pass does to its records, and the maps of the error to the observer.
pub(super) struct Pass<'a> {
    pub(super) records: &'a mut Records,
    pub(super) findings: &'a mut Vec<Finding>,
    pub(super) observer: &'a mut dyn Observer,
}

impl Observer for Pass<'_> {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.records.update(update);
    }
    fn transition(&mut self, transition: &Transition) {
        self.records.transition(transition);
        self.observer.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.records.correction(update);
        self.observer.correction(update);
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.records.moved(state, covariance, offset);
    }
    fn finding(&mut self, finding: Finding) {
        // the run has reported a fault of the samples alone
        kept(self.findings, finding);
    }
}

/// Shows the records what the filter does, and everything to the observer.
pub(super) struct Recording<'a> {
    pub(super) records: &'a mut Records,
    pub(super) findings: &'a mut Vec<Finding>,
    pub(super) observer: &'a mut dyn Observer,
}

impl Observer for Recording<'_> {
    fn behind(&mut self) -> Option<&mut dyn Observer> {
        Some(self.observer)
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.records.update(update);
        self.observer.update(update);
    }
    fn transition(&mut self, transition: &Transition) {
        self.records.transition(transition);
        self.observer.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.records.correction(update);
        self.observer.correction(update);
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.records.moved(state, covariance, offset);
        self.observer.moved(state, covariance, offset);
    }
    fn finding(&mut self, finding: Finding) {
        if let Some(finding) = kept(self.findings, finding) {
            self.observer.finding(finding);
        }
    }
}
