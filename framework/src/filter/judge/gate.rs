//! The judgement on a sample: its gate, the recovery from lock-out, and its record.

use crate::compose::Composition;
use crate::filter::ekf::Ekf;
use crate::filter::judge::bias::BiasTest;
use crate::filter::judge::factor::Treated;
use crate::filter::judge::groups::failing;
use crate::filter::judge::lockout::{Evidence, GONE, Judged, Largest, Verdict};
use crate::filter::judge::signature::{Explained, Refusal, Signatures, Treatment};
use crate::filter::judge::slot::SensorSlot;
use crate::filter::parts::Parts;
use crate::filter::update::correct::Attempt;
use crate::filter::update::work::Work;
use crate::model::record::{Corrected, Observer, Outcome, Rejection, UpdateRecord};
use crate::model::sensor::gate::Action;
use crate::model::sensor::measurement::At;
use crate::state::covariance::{Covariance, Update};
use crate::units::sample::channels;
use crate::units::time::Time;

/// Share of an innovation's square within which another one repeats it: a tenth of its size.
const SAME: f64 = 0.01;

/// The largest innovation of a sample.
fn largest(update: &Update, present: u16) -> Largest {
    let m = update.m;
    let size = |i: usize| (update.innovation[i].powi(2) / update.s[i * m + i]).sqrt();
    (channels(present).zip(0..m))
        .map(|(channel, i)| Largest { channel, sigmas: size(i) })
        .filter(|next| next.sigmas.is_finite())
        .fold(
            Largest::default(),
            |largest, next| if next.sigmas > largest.sigmas { next } else { largest },
        )
}

/// Inflates the covariance until the innovation is about as large as its mean, `NIS = m`, and
/// returns the new NIS.
///
/// The factor `1 + c = NIS / m` would do in one step if `S` consisted of `H P H'` alone. The
/// measurement noise in `S` makes each step fall short, so the step is repeated; it never
/// overshoots.
fn inflate(
    update: &mut Update,
    covariance: &mut Covariance,
    considered: &[bool],
    unseen: &[f64],
    mut nis: f64,
) -> f64 {
    let m = update.m as f64;
    for _ in 0..64 {
        let c = nis / m - 1.0;
        if nis <= 1.5 * m || !update.inflate(covariance, considered, c) {
            break;
        }
        update.inflate_unseen(covariance, unseen, c);
        let Some(now) = update.innovate(covariance) else { break };
        // no error of the states explains the rest
        let stays = now > 0.95 * nis;
        nis = now;
        if stays {
            break;
        }
    }
    nis
}

/// Returns `true` if another sensor than that of the index is in a lock-out at the same time.
fn shared(composition: &Composition, slots: &[SensorSlot], index: usize) -> bool {
    let since = slots[index].lockout.streak.map_or(Time::MIN, |streak| streak.since);
    let others = slots.iter().zip(&composition.sensors).enumerate().filter(|(k, _)| *k != index);
    others
        .map(|(_, other)| other)
        .any(|(slot, sensor)| !sensor.constraint && slot.last >= since && slot.lockout.suspects())
}

/// Returns `true` if other sensors have removed the error that a group of the sample shows: they
/// contradict the group, and with it the sample. `None` where the first gated sample lacks the channels.
fn contradicted(update: &Update, slot: &SensorSlot, present: u16) -> Option<bool> {
    let gone = |left: Option<f64>| left.map(|left| left <= GONE);
    failing(&slot.groups, &slot.thresholds, update, present)
        .filter_map(|group| gone(update.remaining_of(present, &slot.reach, group)))
        .chain(gone(update.remaining(present, &slot.reach)))
        .reduce(|any, gone| any || gone)
}

/// The judgement on a sample.
#[derive(Clone, Copy, Debug)]
pub(in crate::filter) struct Judgement {
    pub(in crate::filter) verdict: Verdict,
    pub(in crate::filter) outcome: Outcome,
    nis: f64,
    threshold: f64,
}

impl Judgement {
    /// The judgement on channels that pass their own gates.
    pub(in crate::filter) fn passed(nis: f64, threshold: f64) -> Self {
        Self { verdict: Verdict::Pass, outcome: Outcome::Accepted, nis, threshold }
    }

    /// The judgement on a sample that the gate refuses, whatever the lock-out.
    pub(in crate::filter) fn refused(nis: f64, threshold: f64) -> Self {
        Self { verdict: Verdict::Gate, outcome: Outcome::Gated, nis, threshold }
    }
}

impl Ekf {
    /// Judges the innovation, and inflates the covariance where the recovery demands it.
    pub(in crate::filter) fn judge(
        &mut self,
        attempt: &Attempt<'_>,
        mut nis: f64,
        observer: &mut dyn Observer,
    ) -> Judgement {
        let Parts { sensors, screening, signatures, .. } = &mut self.parts;
        let update = &self.work.update;
        let &Attempt { sample, index, present, .. } = attempt;
        let slot = &sensors[index];
        let threshold = slot.thresholds[update.m];
        let passes = nis <= threshold && nis.is_finite();
        // evidence on the cause matters for a gated sample, and until the sensor agrees again
        let (share, evidence) = if passes && !slot.lockout.disagrees() {
            (0.0, Evidence { passes, ..Evidence::default() })
        } else {
            let shared = shared(&self.composition, sensors, index);
            let contradicted = contradicted(update, slot, present);
            let ([change, size], common) = update.changed(present, &slot.reach);
            let repeated = common > 0 && change <= slot.thresholds[common].max(SAME * size);
            let replaced = screening.replaced();
            let evidence = Evidence { passes, shared, contradicted, repeated, replaced };
            (update.share(present, &slot.reach), evidence)
        };
        let largest = if passes { Largest::default() } else { largest(update, present) };
        let slot = &mut sensors[index];
        let (sensor, time, m) = (slot.name.as_str(), sample.time, update.m);
        let driver = self.driver.map(|driver| &*self.composition.sensors[driver].info.name);
        let channels = present;
        let judged = Judged { sensor, driver, time, nis, threshold, m, channels, share, largest };
        let isolated = slot.isolation().is_some();
        let verdict = slot.lockout.judge(&judged, evidence, &slot.recovery, observer);
        if let Some(signatures) =
            signatures.as_mut().filter(|_| !isolated && slot.isolation().is_some())
        {
            signatures.isolated();
        }
        if verdict == Verdict::Follow {
            nis = self.forget(index, nis);
        }
        if verdict == Verdict::Obey {
            nis = self.free_position(index, nis);
        }
        if verdict.recovers() {
            nis = self.recover(attempt, nis);
        }
        let outcome = match verdict {
            Verdict::Gate => Outcome::Gated,
            Verdict::Isolate => Outcome::Rejected(Rejection::Isolated),
            _ => Outcome::Accepted,
        };
        Judgement { verdict, outcome, nis, threshold }
    }

    /// Follows the scatter of the samples. Where the gate refuses one, and a wider noise explains what it
    /// refuses, the filter takes that noise from now on and inflates the covariance, which followed
    /// the few samples that passed. Returns the new NIS.
    pub(in crate::filter) fn explain_by_noise(
        &mut self,
        attempt: &Attempt<'_>,
        nis: f64,
        observer: &mut dyn Observer,
    ) -> f64 {
        let &Attempt { sample, index, present, .. } = attempt;
        let (update, slot) = (&mut self.work.update, &mut self.parts.sensors[index]);
        let passes = nis <= slot.thresholds[update.m];
        let Some((scatter, repeats)) = slot.scatter.as_mut().zip(slot.repeats.as_ref()) else {
            return nis;
        };
        scatter.take(update, present, repeats.left(), !passes);
        if passes {
            return nis;
        }
        // of samples that scatter more than their noise, the estimates move by more than their sigma
        if scatter.suspects() {
            self.parts.watch.widened();
        }
        // an innovation that would have jumped with the wider noise too is no noise
        let jump = slot.lockout.jump();
        let Some(excess) = scatter.excess(update, present, jump) else { return nis };
        observer.finding(excess.finding(sample.time, &self.composition.sensors[index].info));
        slot.explain();
        let Parts { estimate, signatures, propagation, .. } = &mut self.parts;
        // the samples that were used count for less by the same factor
        if self.considered.iter().all(|considered| !considered) {
            estimate.covariance.scale(excess.variance());
        }
        *signatures = Signatures::new(&self.composition, propagation.transition());
        match update.innovate(&estimate.covariance) {
            Some(nis) => self.recover(attempt, nis),
            None => nis,
        }
    }

    /// Names an offset of the sensor's clock, or an error of the driving sensor, where it explains the
    /// samples that the gate has refused so far, and is about to refuse one more. Returns the NIS, which
    /// is smaller if the covariance was widened.
    pub(in crate::filter) fn explain_by_error(
        &mut self,
        attempt: &Attempt<'_>,
        nis: f64,
        observer: &mut dyn Observer,
    ) -> f64 {
        let Parts { estimate, sensors, signatures, watch, .. } = &mut self.parts;
        let (update, slot) = (&mut self.work.update, &sensors[attempt.index]);
        let refuses = slot.lockout.at_limit() || slot.isolation().is_some();
        let passes = nis <= slot.thresholds[update.m];
        let Some(signatures) = signatures.as_mut().filter(|_| refuses && !passes) else {
            return nis;
        };
        if estimate.offset.is_some() {
            return nis;
        }
        let refusing = sensors.iter().filter(|slot| slot.lockout.disagrees()).count();
        let (sensor, insists) = (attempt.index, slot.lockout.insists());
        let of = Refusal { sensor, insists, shared: refusing > 1 };
        let states = (&mut estimate.covariance, &self.considered[..]);
        let info = |sensor: usize| &self.composition.sensors[sensor].info;
        match signatures.explain(of, (&self.layout, &estimate.state), states, &info) {
            Explained::Nothing => return nis,
            Explained::Offset(finding) => {
                finding.into_iter().for_each(|finding| observer.finding(finding));
                sensors[attempt.index].excuse();
            }
            Explained::Driver(finding) => {
                observer.finding(finding);
                sensors.iter_mut().for_each(SensorSlot::excuse);
                sensors
                    .iter_mut()
                    .filter_map(|slot| slot.bias.as_mut())
                    .for_each(BiasTest::restart);
                watch.widened();
                return update.innovate(&estimate.covariance).unwrap_or(nis);
            }
        }
        nis
    }

    /// Goes on with the estimate of a filter that has known the offset of the sensor's clock, if one was
    /// found with this sample.
    pub(in crate::filter) fn adopt_offset(&mut self, index: usize) {
        if let Some(delta) = self.parts.signatures.as_mut().and_then(|tests| tests.adopt(index)) {
            self.go_on(delta, true);
        }
    }

    /// The fixed blocks that were found to be wrong, and are estimated since then.
    pub(in crate::filter) fn corrected(&self) -> Vec<Corrected> {
        let Parts { estimate, signatures, .. } = &self.parts;
        let tests = signatures.as_ref();
        tests.map_or_else(Vec::new, |t| t.estimated(&estimate.state, &self.layout))
    }

    /// Corrects the fixed blocks that were found to be wrong, and what their errors have moved the state by.
    pub(in crate::filter) fn correct_parameters(&mut self) {
        let Parts { estimate, signatures, .. } = &mut self.parts;
        let tests = signatures.as_mut().filter(|_| estimate.offset.is_none());
        if let Some(found) = tests.and_then(|t| t.correct(&mut estimate.state, &self.layout)) {
            self.go_on(found.delta, found.news);
        }
    }

    /// Goes on with the estimate of a filter that has known an error, which may be news.
    fn go_on(&mut self, mut delta: Vec<f64>, news: bool) {
        let Parts { estimate, sensors, watch, history, .. } = &mut self.parts;
        self.layout.inject(&mut estimate.state, &mut delta, &mut estimate.covariance);
        if let Some(history) = history {
            history.corrected(&delta);
        }
        if news {
            // the means of the innovations up to here are those of the error
            sensors.iter_mut().filter_map(|slot| slot.bias.as_mut()).for_each(BiasTest::restart);
            watch.widened();
        }
    }

    /// Adds the priors of what this sensor measures to the covariance: its samples before were wrong. Where
    /// no other sensor was used, nothing is known beyond any prior. Returns the new NIS.
    fn forget(&mut self, index: usize, nis: f64) -> f64 {
        let Parts { estimate, sensors, .. } = &mut self.parts;
        let update = &mut self.work.update;
        let others = || sensors.iter().enumerate().filter(|(k, _)| *k != index);
        let alone = !others().any(|(_, slot)| slot.lockout.was_used());
        let forgotten = |row: usize| alone || update.columns.contains(&row);
        let (values, covariance) = (&estimate.state.values, &mut estimate.covariance);
        let blocks = self.layout.blocks.iter().filter(|b| b.estimated() && b.label.is_none());
        for block in blocks {
            let (range, prior) = (block.tangent_range(), block.prior(values));
            for (i, row) in range.clone().enumerate().filter(|(_, row)| forgotten(*row)) {
                for (j, column) in range.clone().enumerate().filter(|(_, c)| forgotten(*c)) {
                    covariance.set(row, column, covariance.get(row, column) + prior[(i, j)]);
                }
            }
        }
        update.innovate(covariance).unwrap_or(nis)
    }

    /// Frees the position along the channels that contradict it, so that the sample replaces it there
    /// and corrects nothing else. Returns the new NIS.
    fn free_position(&mut self, index: usize, nis: f64) -> f64 {
        let Some(position) = self.layout.vehicle().position else { return nis };
        let (update, covariance) = (&mut self.work.update, &mut self.parts.estimate.covariance);
        let columns = self.layout.blocks[position.slot()].tangent_range();
        update.free(covariance, columns, self.parts.sensors[index].thresholds[1]);
        update.innovate(covariance).unwrap_or(nis)
    }

    /// Inflates the covariance until the innovation is plausible, and returns the new NIS.
    fn recover(&mut self, attempt: &Attempt<'_>, nis: f64) -> f64 {
        let Parts { estimate, sensors, firsts, signatures, watch, .. } = &mut self.parts;
        firsts.clear();
        let (update, reach) = (&mut self.work.update, &sensors[attempt.index].reach);
        let unseen = update.unseen(&self.considered, attempt.present, reach);
        let nis = inflate(update, &mut estimate.covariance, &self.considered, &unseen, nis);
        // the means of the innovations up to here are those of another fault
        sensors.iter_mut().filter_map(|slot| slot.bias.as_mut()).for_each(BiasTest::restart);
        if let Some(signatures) = signatures {
            signatures.recovered();
        }
        watch.widened();
        nis
    }

    /// Passes the record of the update to the observer.
    pub(in crate::filter) fn record(
        &self,
        attempt: &Attempt<'_>,
        judgement: &Judgement,
        observer: &mut dyn Observer,
    ) {
        let &Judgement { outcome, nis, threshold, .. } = judgement;
        let update = &self.work.update;
        let (innovation, covariance) = match outcome {
            Outcome::Accepted => self.work.refinement.judged(),
            _ => (&update.innovation[..], &update.s[..]),
        };
        observer.update(&UpdateRecord {
            time: attempt.sample.time,
            sensor: attempt.sample.sensor,
            outcome,
            nis,
            threshold,
            present: attempt.present,
            innovation,
            covariance,
        });
        if outcome == Outcome::Gated {
            observer.gated(update);
        }
    }

    /// Keeps what a sample that is not used shows of the fault.
    pub(in crate::filter) fn withhold(
        &mut self,
        (attempt, judgement): (&Attempt<'_>, &Judgement),
        observer: &mut dyn Observer,
    ) {
        let Parts { estimate, sensors, firsts, signatures, propagation, .. } = &mut self.parts;
        let Work { update, lower, .. } = &mut self.work;
        let &Attempt { sample, index, present, model, .. } = attempt;
        let slot = &mut sensors[index];
        for first in firsts {
            first.learn(attempt.measured(), update, slot.thresholds[update.m]);
        }
        if let Some(signatures) = signatures.as_mut().filter(|_| estimate.offset.is_none()) {
            let at = At { layout: &self.layout, state: &estimate.state, sample };
            let along = (&at, propagation.transition());
            // as Huber's estimator weighs what is beyond its limit
            let weight = (slot.thresholds[update.m] / judgement.nis).sqrt().min(1.0);
            let isolated = slot.isolation().is_some();
            let treatment = Treatment { weight, used: false, calm: false, isolated };
            let info = &self.composition.sensors[index].info;
            let taken = (attempt.measured(), treatment);
            signatures.take(taken, (model, info), along, update, lower);
        }
        if let Some(repeats) = &mut slot.repeats {
            repeats.keep(update, present, false);
        }
        if let Some(factor) = &mut slot.factor {
            let info = &self.composition.sensors[index].info;
            factor.take(&Treated { sample, present, update, used: false }, info, observer);
        }
        let first = slot.lockout.streak.is_some_and(|streak| streak.count == 1);
        if first && slot.recovery.action == Action::Inflate {
            update.begin(&estimate.covariance, &self.considered, attempt.present, &mut slot.reach);
        }
        if slot.isolation().is_some() {
            slot.reach.end();
        }
    }
}
