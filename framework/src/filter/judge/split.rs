//! The branch beside a filter: how it begins, is weighed, reported and decided.

use crate::filter::ekf::Ekf;
use crate::filter::judge::branch::Branch;
use crate::filter::parts::Parts;
use crate::filter::update::correct::Attempt;
use crate::model::record::{Event, Level, Observer};

impl Ekf {
    /// Parts from a case that the filter does not follow. An older one that is still undecided stays in the
    /// covariance.
    pub(super) fn part(&mut self, branch: Branch) {
        let Parts { estimate, branch: own, .. } = &mut self.parts;
        if estimate.offset.is_some() {
            return; // a further pass knows the decisions of the first one
        }
        if let Some(before) = own.replace(branch) {
            estimate.covariance = before.mixed(&estimate.covariance, before.weight());
            self.work.update.innovate(&estimate.covariance);
        }
    }

    /// Weighs the branch by a sample.
    pub(in crate::filter) fn weigh(&mut self, attempt: &Attempt<'_>) {
        let Parts { branch, sensors, .. } = &mut self.parts;
        let limit = sensors[attempt.index].thresholds[self.work.update.m];
        if let Some(branch) = branch {
            branch.weigh((attempt.index, attempt.present), &self.work.update, limit);
        }
    }

    /// Ends a branch that is decided. If the sensor was wrong, the covariance contains what the filter has
    /// taken from it, so that the next samples undo that, and a sensor that is still off is isolated.
    pub(in crate::filter) fn decide(&mut self, observer: &mut dyn Observer) {
        let Parts { estimate, branch, sensors, watch, .. } = &mut self.parts;
        if let Some(wrong) = branch.as_ref().and_then(Branch::decided)
            && let Some(branch) = branch.take()
        {
            let (slot, time, since) =
                (&mut sensors[branch.sensor], estimate.state.time, branch.since);
            if wrong {
                estimate.covariance = branch.mixed(&estimate.covariance, 1.0);
                watch.widened();
                slot.lockout.convict((since, time), branch.channels(), &slot.name, observer);
            } else {
                let text = format!("the filter was off at {since}, and not the sensor");
                observer.event(Event { time, level: Level::Info, about: slot.name.clone(), text });
            }
        }
        self.mix();
    }

    /// Reports from now on the mixture of filter and branch, where there is one.
    pub(in crate::filter) fn mix(&mut self) {
        let Parts { estimate, branch, .. } = &mut self.parts;
        let mixed = branch.as_ref().map(|b| b.mixed(&estimate.covariance, b.weight()));
        estimate.mixture = mixed;
    }
}
