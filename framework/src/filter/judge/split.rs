//! The branch beside a filter: how it begins, is weighed, reported and decided.

use crate::filter::ekf::Ekf;
use crate::filter::judge::bias::BiasTest;
use crate::filter::judge::branch::Branch;
use crate::filter::judge::lockout::{Conviction, Verdict};
use crate::filter::judge::signature::Signatures;
use crate::filter::parts::Parts;
use crate::filter::update::correct::Attempt;
use crate::model::record::{Event, Level, Observer};
use crate::state::covariance::Covariance;

impl Ekf {
    /// The case that a sensor which is back after a silence or an isolation is wrong.
    pub(in crate::filter) fn doubt(&self, attempt: &Attempt<'_>) -> Option<Branch> {
        let &Attempt { sample, index, .. } = attempt;
        let slot = &self.parts.sensors[index];
        if !slot.lockout.returns(sample.time, &slot.recovery) {
            return None;
        }
        let (update, n) = (&self.work.update, self.considered.len());
        Branch::new(attempt.measured(), &slot.groups, sample.time, update, n)
    }

    /// Adds the case that the filter does not follow when it uses the sample. The covariance keeps
    /// an older case that is in doubt; a new case that is not in doubt does not replace it.
    pub(in crate::filter) fn part(&mut self, doubt: Option<Branch>, verdict: Verdict) {
        let branch = match (doubt, verdict) {
            (Some(branch), Verdict::Adopt) => branch.refused(),
            (Some(branch), Verdict::Try) => branch.even(),
            (Some(branch), Verdict::Pass) => branch,
            _ => return,
        };
        let Parts { estimate, branch: own, .. } = &mut self.parts;
        let doubts = own.as_ref().is_some_and(Branch::is_in_doubt);
        let of_first = own.as_ref().is_some_and(|own| own.first.is_some());
        // a further pass knows the decisions of the first one
        if estimate.offset.is_some() || of_first || doubts && !branch.is_in_doubt() {
            return;
        }
        if let Some(before) = own.replace(branch)
            && doubts
        {
            estimate.covariance = before.mixed(&estimate.covariance, before.weight());
            self.work.update.innovate(&estimate.covariance);
        }
    }

    /// Weighs the branch by a sample.
    pub(in crate::filter) fn weigh(&mut self, attempt: &Attempt<'_>) {
        let Parts { branch, sensors, .. } = &mut self.parts;
        let limit = sensors[attempt.index].thresholds[self.work.update.m];
        if let Some(branch) = branch {
            branch.weigh(attempt.measured(), &self.work.update, limit);
        }
    }

    /// Ends a branch that is decided. If the sensor was wrong, the filter goes on with the estimate of that
    /// case, and isolates the channels that are still off.
    pub(in crate::filter) fn decide(&mut self, observer: &mut dyn Observer) {
        self.take_back(observer);
        self.outvote_first();
        let branch = &mut self.parts.branch;
        if let Some(wrong) = branch.as_ref().and_then(Branch::decided)
            && let Some(branch) = branch.take()
        {
            let (time, since) = (self.state().time, branch.since);
            if wrong {
                self.change_to(&branch);
            }
            self.decide_first(&branch, wrong, observer);
            let slot = &mut self.parts.sensors[branch.sensor];
            if wrong {
                let channels = branch.offset_channels();
                slot.reach.remember(channels, branch.offsets());
                let conviction = Conviction { since, at: time, channels };
                slot.lockout.convict(conviction, &slot.name, observer);
            } else if branch.was_in_doubt() && branch.first.is_none() {
                let text = format!("the filter was off at {since}, not the sensor");
                observer.event(Event { time, level: Level::Info, about: slot.name.clone(), text });
            }
        }
        self.mix();
    }

    /// Goes on with the estimate of a branch. The tests begin again, since they followed the wrong samples.
    pub(super) fn change_to(&mut self, branch: &Branch) {
        let Parts { estimate, sensors, signatures, propagation, watch, history, .. } =
            &mut self.parts;
        let mut delta = branch.follow(&mut estimate.covariance);
        self.layout.inject(&mut estimate.state, &mut delta, &mut estimate.covariance);
        if let Some(history) = history {
            history.corrected(&delta);
        }
        sensors.iter_mut().filter_map(|slot| slot.bias.as_mut()).for_each(BiasTest::restart);
        *signatures = Signatures::new(&self.composition, propagation.transition());
        watch.widened();
    }

    /// Reports from now on the mixture of filter and branch, while there is a doubt.
    pub(in crate::filter) fn mix(&mut self) {
        let Parts { estimate, branch, firsts, .. } = &mut self.parts;
        let cases = branch.iter().chain(&*firsts).filter(|_| !self.decides);
        estimate.mixture = mixture(cases, &estimate.covariance);
    }
}

/// The mixture of a filter with that covariance and the cases that are in doubt; none without such a case.
pub(in crate::filter) fn mixture<'a>(
    cases: impl IntoIterator<Item = &'a Branch>,
    covariance: &Covariance,
) -> Option<Covariance> {
    let doubted = cases.into_iter().filter(|case| case.is_in_doubt());
    doubted.fold(None, |mixed, case| {
        Some(case.mixed(mixed.as_ref().unwrap_or(covariance), case.weight()))
    })
}
