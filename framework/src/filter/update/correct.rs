//! The measurement update: innovation, judgement, refinement, injection and reset.

use super::work::Work;
use crate::filter::ekf::Ekf;
use crate::filter::estimate::Estimate;
use crate::filter::judge::branch::Branch;
use crate::filter::judge::factor::Treated;
use crate::filter::judge::gate::Judgement;
use crate::filter::judge::groups::failing_alone;
use crate::filter::judge::lockout::Verdict;
use crate::filter::judge::measured::Measured;
use crate::filter::judge::reject::rejected;
use crate::filter::judge::signature::Treatment;
use crate::filter::judge::stuck::stuck_channels;
use crate::filter::parts::Parts;
use crate::filter::transients::seen::Transients;
use crate::model::estimator_error::EstimatorError;
use crate::model::record::{Observer, Outcome, Rejection, UpdateRecord};
use crate::model::sensor::Sensor;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::rule::{Check, Prior};
use crate::state::covariance::Update;
use crate::units::sample::Sample;
use crate::units::time::Time;

/// The sample of one update, and its treatment.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Attempt<'a> {
    pub(in crate::filter) sample: &'a Sample,
    pub(in crate::filter) model: &'a dyn AnyMeasurement,
    /// Number of the sensor.
    pub(in crate::filter) index: usize,
    /// The channels that the sample has, one bit each.
    pub(in crate::filter) present: u16,
    /// Factor of the noise, for a sample that repeats the one before.
    repeated: f64,
}

impl Attempt<'_> {
    /// What the sample measures.
    pub(in crate::filter) fn measured(&self) -> Measured {
        Measured { sensor: self.index, present: self.present }
    }
}

impl Ekf {
    /// Updates the estimate at the state's time.
    pub(in crate::filter) fn correct(
        &mut self,
        sample: &Sample,
        model: &dyn AnyMeasurement,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        self.settle(observer);
        let Some(mut attempt) = self.linearise(sample, model) else {
            return Ok(()); // the sample's time minus its offset is before the start
        };
        if self.reads_absent() {
            self.reject(sample, Rejection::Absent, observer);
            return Ok(());
        }
        let Some(mut nis) = self.work.update.innovate(&self.parts.estimate.covariance) else {
            let Update { innovation, s, .. } = &self.work.update;
            let mut why = Rejection::Singular;
            if innovation.iter().chain(s).any(|value| value.is_nan()) {
                self.check_covariance(sample.time)?;
                why = Rejection::Prediction;
            }
            self.reject(sample, why, observer);
            return Ok(());
        };
        if self.is_stuck(&attempt, observer) {
            return Ok(());
        }
        if let Some(others) = self.without_stuck(&mut attempt, observer) {
            nis = others;
        }
        nis = self.explain_by_noise(&attempt, nis, observer);
        if !self.weigh_firsts(&attempt) {
            nis = self.explain_by_error(&attempt, nis, observer);
        }
        self.watch_velocity(attempt.index);
        self.weigh(&attempt);
        let (doubt, first) = (self.doubt(&attempt), self.doubt_first(&attempt));
        if let Some(judgement) = self.takes_back(&attempt, nis) {
            self.conclude(&attempt, &judgement, observer)?;
        } else if let Some(bad) = self.failing(&attempt, nis) {
            self.correct_by_groups(&attempt, (bad, doubt), observer)?;
        } else {
            let judgement = self.judge(&attempt, nis, observer);
            self.part(doubt, judgement.verdict);
            self.follow_first(first, judgement.verdict);
            self.conclude(&attempt, &judgement, observer)?;
        }
        self.adopt_offset(attempt.index);
        self.correct_parameters();
        self.decide(observer);
        Ok(())
    }

    /// Channels of a refused sample that fail alone or are isolated.
    fn failing(&self, attempt: &Attempt<'_>, nis: f64) -> Option<u16> {
        let slot = &self.parts.sensors[attempt.index];
        let isolated = slot.lockout.isolated();
        let refused = nis > slot.thresholds[self.work.update.m] && slot.lockout.at_limit();
        if slot.groups.len() < 2 || !refused && isolated == 0 {
            return None;
        }
        let groups = (&slot.groups[..], isolated);
        failing_alone(groups, &slot.thresholds, &self.work.update, attempt.present)
    }

    /// Judges the channels that fail alone, and uses all channels if they are accepted, else the
    /// others.
    fn correct_by_groups(
        &mut self,
        attempt: &Attempt<'_>,
        (channels, doubt): (u16, Option<Branch>),
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let &Attempt { sample, index, present, .. } = attempt;
        let bad = Attempt { present: channels, ..*attempt };
        let good = Attempt { present: present & !channels, ..*attempt };
        let Work { update, whole, .. } = &mut self.work;
        whole.clone_from(update);
        update.restrict(present, channels);
        let Some(nis) = update.innovate(&self.parts.estimate.covariance) else {
            self.reject(sample, Rejection::Singular, observer);
            return Ok(());
        };
        let judgement = self.judge(&bad, nis, observer);
        let accepted = judgement.outcome == Outcome::Accepted;
        if !accepted {
            self.conclude(&bad, &judgement, observer)?;
        }
        self.part(doubt, judgement.verdict);
        let Work { update, whole, .. } = &mut self.work;
        update.clone_from(whole);
        let slot = &self.parts.sensors[index];
        if !accepted {
            update.restrict(present, good.present);
        }
        let Some(nis) = update.innovate(&self.parts.estimate.covariance) else {
            self.reject(sample, Rejection::Singular, observer);
            return Ok(());
        };
        let judgement = Judgement::passed(nis, slot.thresholds[update.m]);
        self.conclude(if accepted { attempt } else { &good }, &judgement, observer)
    }

    /// Records a judged sample, and uses it if it is accepted.
    fn conclude(
        &mut self,
        attempt: &Attempt<'_>,
        judgement: &Judgement,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let accepted = judgement.outcome == Outcome::Accepted;
        if accepted && !self.refine(attempt, judgement.verdict, observer) {
            self.reject(attempt.sample, Rejection::Singular, observer);
            return Ok(());
        }
        self.record(attempt, judgement, observer);
        if !accepted {
            self.withhold((attempt, judgement), observer);
            return Ok(());
        }
        self.apply(attempt, observer);
        self.verify(attempt.sample.time)
    }

    /// Computes innovation, Jacobian and noise of a sample. Returns `false` where a sensor with a
    /// time offset measures a state before the start.
    pub(in crate::filter) fn evaluate(
        &mut self,
        sample: &Sample,
        model: &dyn AnyMeasurement,
    ) -> bool {
        let (Parts { estimate, history, .. }, update) = (&mut self.parts, &mut self.work.update);
        let state = &estimate.state;
        let &Sensor { noise, time_offset, .. } = &self.composition.sensors[sample.sensor.0];
        match time_offset.zip(history.as_mut()) {
            None => model.linearise(&At { layout: &self.layout, state, sample }, update),
            Some((offset, history)) => {
                if !history.linearise(model, offset, &self.layout, state, sample, update) {
                    return false;
                }
            }
        }
        if noise != 1.0 {
            update.r.iter_mut().for_each(|r| *r *= noise * noise);
        }
        true
    }

    /// Predicts the sample and its derivative, with the noise that the scenario states.
    fn linearise<'a>(
        &mut self,
        sample: &'a Sample,
        model: &'a dyn AnyMeasurement,
    ) -> Option<Attempt<'a>> {
        if !self.evaluate(sample, model) {
            return None;
        }
        let Parts { estimate, sensors, signatures, .. } = &mut self.parts;
        let Work { update, rules, .. } = &mut self.work;
        let index = sample.sensor.0;
        if let Some(offset) = &estimate.offset {
            offset.innovation(update);
        }
        let slot = &mut sensors[index];
        let present = sample.present() & slot.channels;
        let repeated = slot.repeats.as_mut().map_or(1.0, |repeats| repeats.take(sample, present));
        if repeated != 1.0 {
            update.r.iter_mut().for_each(|r| *r *= repeated * repeated);
        }
        if let Some(scatter) = &slot.scatter {
            scatter.widen(update, present);
        }
        if let Some(level) = slot.level() {
            update.r.iter_mut().for_each(|r| *r *= level.variance());
        }
        let Estimate { state, covariance, offset, .. } = estimate;
        let at = At { layout: &self.layout, state, sample };
        let tests = signatures.as_ref().filter(|_| offset.is_none());
        let compensates = tests.is_some_and(|tests| tests.compensates(index));
        if let Some(tests) = tests {
            tests.compensate(index, model, &at, update, present);
        }
        let prior = Prior { at, model, covariance, considered: &self.considered };
        rules.of(index, offset.is_some() || compensates).linearised(&prior, update);
        Some(Attempt { sample, model, index, present, repeated })
    }

    /// Rejects a sample of a sensor that repeats one sample while the vehicle moves.
    fn is_stuck(&mut self, attempt: &Attempt<'_>, observer: &mut dyn Observer) -> bool {
        let &Attempt { sample, present, repeated, .. } = attempt;
        let Parts { estimate, sensors, .. } = &mut self.parts;
        let slot = &mut sensors[attempt.index];
        let moves = estimate.moves(&self.layout);
        let stuck = slot.repeats.as_mut().and_then(|repeats| {
            let stuck = repeats.stuck(&self.work.update, present, repeated, moves)?;
            repeats.keep(&self.work.update, present, false);
            Some(stuck)
        });
        let Some(stuck) = stuck else {
            slot.refused = None;
            return false;
        };
        if slot.refused != Some(Rejection::Repeated) {
            observer.finding(stuck.finding(sample.time, &slot.name));
        }
        self.reject(sample, Rejection::Repeated, observer);
        true
    }

    /// Leaves out the channels that repeat one value while the others vary; returns the normalised
    /// innovation squared of the others.
    fn without_stuck(
        &mut self,
        attempt: &mut Attempt<'_>,
        observer: &mut dyn Observer,
    ) -> Option<f64> {
        let &mut Attempt { sample, index, present, .. } = attempt;
        let Work { update, whole, .. } = &mut self.work;
        let repeats = self.parts.sensors[index].repeats.as_mut()?;
        let [stuck, new] = repeats.stuck_alone(present);
        if stuck == 0 || stuck == present {
            return None;
        }
        repeats.keep(update, present, false);
        whole.clone_from(update);
        update.restrict(present, present & !stuck);
        let Some(nis) = update.innovate(&self.parts.estimate.covariance) else {
            update.clone_from(whole);
            return None;
        };
        if new != 0 {
            let info = &self.composition.sensors[index].info;
            observer.finding(stuck_channels(sample.time, info, new));
        }
        observer.update(&UpdateRecord { present: stuck, ..rejected(sample, Rejection::Repeated) });
        attempt.present = present & !stuck;
        Some(nis)
    }

    /// Weighs the channels of an accepted sample and iterates its linearisation, as the sensor
    /// demands; returns `false` if the innovation covariance turns singular.
    fn refine(
        &mut self,
        attempt: &Attempt<'_>,
        verdict: Verdict,
        observer: &mut dyn Observer,
    ) -> bool {
        let Parts { estimate, sensors, signatures, .. } = &mut self.parts;
        let Work { update, lower, refinement, rules, .. } = &mut self.work;
        let &Attempt { sample, model, index, present, .. } = attempt;
        let slot = &mut sensors[index];
        if !slot.lockout.disagrees() {
            slot.reach.clear();
        }
        if let Some(test) = &mut slot.bias
            && verdict == Verdict::Pass
            && let Some(shift) = test.take(sample.time, update, present)
        {
            let info = &self.composition.sensors[index].info;
            observer.finding(shift.finding(sample.time, info));
        }
        if verdict == Verdict::Pass
            && let Some(level) = slot.level()
        {
            level.take(update, lower);
        }
        let Estimate { state, covariance, offset, .. } = estimate;
        let at = At { layout: &self.layout, state, sample };
        let prior = Prior { at, model, covariance, considered: &self.considered };
        let compensates = signatures.as_ref().is_some_and(|tests| tests.compensates(index));
        let rule = rules.of(index, offset.is_some() || compensates);
        refinement.run(&prior, rule, slot.robust, update)
    }

    /// Updates the covariance, and injects the error into the state.
    fn apply(&mut self, attempt: &Attempt<'_>, observer: &mut dyn Observer) {
        let Parts {
            estimate,
            propagation,
            sensors,
            branch,
            firsts,
            signatures,
            watch,
            transients,
            history,
            ..
        } = &mut self.parts;
        let Work { update, lower, points, rules, .. } = &mut self.work;
        let &Attempt { sample, model, index, present, .. } = attempt;
        // an unscented update treats the curvature as noise, and an iterated one is checked at the
        // state after the update
        let mut curved = None;
        let own = estimate.offset.is_none();
        let compensates = signatures.as_ref().is_some_and(|tests| tests.compensates(index));
        let rule = rules.of(index, !own || compensates);
        let slot = &mut sensors[index];
        if let Some(check) =
            slot.curvature.as_mut().filter(|_| rule.check() == Check::Before && own)
            && check.is_due(update, &estimate.covariance)
        {
            let at = At { layout: &self.layout, state: &estimate.state, sample };
            curved = check.check(points, &at, model, &estimate.covariance, update);
        }
        update.apply(&mut estimate.covariance, &self.considered);
        rule.corrects(&mut update.delta);
        if let Some(factor) = &mut slot.factor {
            let info = &self.composition.sensors[index].info;
            factor.take(&Treated { sample, present, update, used: true }, info, observer);
        }
        if let Some(repeats) = &mut slot.repeats {
            repeats.keep(update, present, true);
        }
        for other in sensors.iter_mut().filter(|other| !other.reach.is_empty()) {
            update.correct(&mut other.reach);
        }
        for case in branch.iter_mut().chain(firsts) {
            case.correct(attempt.measured(), update, sample.time);
        }
        if let Some(signatures) = signatures.as_mut().filter(|_| own) {
            let at = At { layout: &self.layout, state: &estimate.state, sample };
            let along = (&at, propagation.transition());
            let calm = sensors.iter().all(|slot| !slot.lockout.disagrees());
            let info = &self.composition.sensors[index].info;
            let treatment = Treatment { weight: 1.0, used: true, calm, isolated: false };
            let taken = (attempt.measured(), treatment);
            signatures.take(taken, (model, info), along, update, lower);
        }
        if let Some(offset) = &mut estimate.offset {
            offset.correct(&mut update.delta);
            observer.corrected(&offset.d);
        } else {
            self.layout.inject(&mut estimate.state, &mut update.delta, &mut estimate.covariance);
        }
        if let Some(signatures) = signatures.as_mut().filter(|_| own) {
            let widened = signatures.corrected(
                index,
                (&self.layout, &estimate.state),
                (&mut estimate.covariance, &self.considered),
                &|sensor| &self.composition.sensors[sensor].info,
                |finding| observer.finding(finding),
            );
            if widened {
                watch.widened();
            }
        }
        let slot = &mut sensors[index];
        if let Some(check) = slot.curvature.as_mut().filter(|_| rule.check() == Check::After)
            && check.is_due(update, &estimate.covariance)
        {
            let at = At { layout: &self.layout, state: &estimate.state, sample };
            curved = check.check(points, &at, model, &estimate.covariance, update);
        }
        if let Some(curved) = curved {
            let info = &self.composition.sensors[index].info;
            observer.finding(curved.finding(sample.time, info, &self.layout));
        }
        // report the injected error: a velocity that turns with the heading changes by more than
        // the product of gain and innovation
        observer.correction(update);
        transients.note(&self.layout, update, sample.time);
        if let Some(history) = history {
            history.corrected(&update.delta);
        }
    }

    /// Checks that every variance is a positive number.
    fn check_covariance(&self, time: Time) -> Result<(), EstimatorError> {
        let estimate = &self.parts.estimate;
        let invalid =
            Transients::first_invalid(&self.layout, &estimate.state, &estimate.covariance);
        let Some(i) = invalid else { return Ok(()) };
        let block = self.layout.blocks.iter().find(|b| b.tangent_range().contains(&i));
        let block = block.map_or_else(String::new, |b| b.name.clone());
        Err(EstimatorError::Covariance { time, block })
    }

    /// Checks the covariance, and passes the estimate to the monitors while the sensors agree.
    fn verify(&mut self, time: Time) -> Result<(), EstimatorError> {
        self.check_covariance(time)?;
        let Parts { estimate, sensors, watch, .. } = &mut self.parts;
        // while a sensor contradicts the estimate, a correction by another proves nothing
        if sensors.iter().all(|slot| !slot.lockout.disagrees()) {
            watch.corrected(&estimate.view(&self.layout, None));
        }
        Ok(())
    }
}
