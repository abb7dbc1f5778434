//! The first sample of a sensor, which a wide prior lets pass.
//!
//! Where the filter knows little of what a sensor measures, the gate passes a wrong first sample, and refuses the
//! right ones after it. The case that the first sample alone was wrong is therefore a [`Branch`] of its own, whose
//! offset ends with that sample: `x + B d` is the estimate of a filter that has not used it. Every sample weighs
//! the case, also those of other sensors, until the odds are 1000 : 1 for it, or have fallen by as much, or the sensor
//! has been used often enough. The covariance that is reported contains the case meanwhile.
//!
//! The noise be `R` and the prior variance of a channel `p R`. An error that just passes the gate leaves
//! `p / (p + 1)` of itself, and the innovation after it has the variance `(1 + p / (p + 1)) R`. So the gate can refuse
//! the next right sample only if
//! ```text
//! p^2 / (p + 1) > 1 + p / (p + 1),      p > 1 + sqrt(2),      S = (p + 1) R > (2 + sqrt(2)) R
//! ```

use crate::filter::ekf::Ekf;
use crate::filter::judge::branch::Branch;
use crate::filter::judge::gate::Judgement;
use crate::filter::judge::lockout::{MAJORITY, Verdict, first_was_wrong};
use crate::filter::parts::Parts;
use crate::filter::update::correct::Attempt;
use crate::model::record::Observer;
use crate::model::sensor::gate::Action;
use crate::units::sample::Sample;
use std::f64::consts::SQRT_2;

impl Ekf {
    /// The case that the first sample of a sensor is wrong. Call after
    /// [`innovate`](crate::state::covariance::Update::innovate).
    pub(in crate::filter) fn doubt_first(&self, attempt: &Attempt<'_>) -> Option<Branch> {
        let (update, slot) = (&self.work.update, &self.parts.sensors[attempt.index]);
        let variances = || (0..update.m).map(|k| (update.m + 1) * k);
        let wide = || variances().any(|k| update.s[k] > (2.0 + SQRT_2) * update.r[k]);
        // a further pass leaves out what was wrong
        let judged = slot.recovery.action == Action::Inflate
            && !slot.groups.is_empty()
            && slot.thresholds[update.m].is_finite()
            && self.parts.estimate.offset.is_none();
        if slot.lockout.was_used() || !judged || !wide() {
            return None;
        }
        let (all, n) = ([attempt.present], self.considered.len());
        Branch::new(attempt.measured(), &all, attempt.sample.time, update, n).map(Branch::once)
    }

    /// Follows the case from the use of the first sample on.
    pub(in crate::filter) fn follow_first(&mut self, doubt: Option<Branch>, verdict: Verdict) {
        self.parts.firsts.extend(doubt.filter(|_| verdict == Verdict::Pass));
    }

    /// Weighs the cases by a sample. Returns `true` where one is more likely than not, so that no other error
    /// has to explain the samples.
    pub(in crate::filter) fn weigh_firsts(&mut self, attempt: &Attempt<'_>) -> bool {
        let Parts { firsts, sensors, .. } = &mut self.parts;
        let limit = sensors[attempt.index].thresholds[self.work.update.m];
        for first in &mut *firsts {
            first.weigh(attempt.measured(), &self.work.update, limit);
        }
        firsts.iter().any(|first| first.weight() > 0.5)
    }

    /// The judgement on a sample that the gate refuses, and which decides that a first one was wrong:
    /// [`Self::take_back`] follows.
    pub(in crate::filter) fn takes_back(
        &self,
        attempt: &Attempt<'_>,
        nis: f64,
    ) -> Option<Judgement> {
        let Parts { firsts, sensors, .. } = &self.parts;
        let threshold = sensors[attempt.index].thresholds[self.work.update.m];
        let decided = || firsts.iter().any(|first| first.decided() == Some(true));
        (nis > threshold && decided()).then(|| Judgement::refused(nis, threshold))
    }

    /// Ends the cases that are decided. If a first sample was wrong, the filter goes on with the estimate that
    /// has not used it. Those that contradict it may be wrong instead: that is the case beside it from now on, until
    /// other sensors decide, the samples return, or they are so many that they outvote the first one.
    pub(super) fn take_back(&mut self, observer: &mut dyn Observer) {
        let Parts { estimate, branch, firsts, sensors, .. } = &mut self.parts;
        firsts.retain(|first| {
            first.decided() != Some(false) && sensors[first.sensor].lockout.accepted < MAJORITY
        });
        let Some(at) = firsts.iter().position(|first| first.decided() == Some(true)) else {
            return;
        };
        let first = firsts.swap_remove(at);
        let streak = sensors[first.sensor].lockout.streak;
        // the others stand beside an estimate that is given up
        firsts.clear();
        if let Some(branch) = branch.take() {
            if branch.is_in_doubt() {
                estimate.covariance = branch.mixed(&estimate.covariance, branch.weight());
            }
            self.decide_first(&branch, false, observer);
        }
        self.change_to(&first);
        let time = self.state().time;
        let Parts { sensors, wrong, branch, .. } = &mut self.parts;
        // what contradicted the filter was right
        let contradicting = sensors.iter_mut().filter(|slot| slot.lockout.disagrees());
        contradicting.filter(|slot| slot.isolation().is_none()).for_each(|slot| slot.excuse());
        let slot = &mut sensors[first.sensor];
        slot.excuse();
        slot.lockout.used = None;
        wrong.push((first.sensor, first.since));
        *branch = Some(first.reversed(streak.map_or(time, |streak| streak.since)));
    }

    /// Ends the case that a first sample was right once so many samples contradict it.
    pub(super) fn outvote_first(&mut self) {
        let Parts { branch, sensors, .. } = &mut self.parts;
        let Some(branch) = branch.as_mut().filter(|branch| branch.first.is_some()) else { return };
        if sensors[branch.sensor].lockout.accepted >= MAJORITY {
            branch.overrule();
        }
    }

    /// Reports the decision on a first sample that was taken back: it was right, and is used in a further
    /// pass, or it was wrong.
    pub(in crate::filter) fn decide_first(
        &mut self,
        branch: &Branch,
        right: bool,
        observer: &mut dyn Observer,
    ) {
        let Some(first) = branch.first else { return };
        let time = self.state().time;
        let Parts { sensors, wrong, .. } = &mut self.parts;
        if right {
            wrong.retain(|known| *known != (branch.sensor, first));
        } else {
            observer.finding(first_was_wrong(&sensors[branch.sensor].name, first, time));
        }
    }

    /// Returns `true` for a first sample that was wrong, where the filter takes its samples once more.
    pub(in crate::filter) fn knows_wrong(
        &self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> bool {
        let Parts { sensors, wrong, .. } = &self.parts;
        let (index, time) = (sample.sensor.0, sample.time);
        let known = wrong.contains(&(index, time));
        if known {
            observer.finding(first_was_wrong(&sensors[index].name, time, time));
        }
        known
    }
}
