//! The judgement on a sample: its gate, the recovery from lock-out, and its record.

use crate::compose::Composition;
use crate::filter::ekf::Ekf;
use crate::filter::judge::lockout::{Evidence, GONE, Judged, Verdict};
use crate::filter::judge::slot::SensorSlot;
use crate::filter::parts::Parts;
use crate::filter::update::correct::Attempt;
use crate::model::record::{Observer, Outcome, Rejection, UpdateRecord};
use crate::model::sensor::gate::Action;
use crate::state::covariance::{Covariance, Update};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// Index of the channel with the largest innovation of a sample, and its size in sigma.
fn worst(update: &Update, present: u16) -> (usize, f64) {
    let m = update.m;
    let channels = (0..MAX_CHANNELS).filter(|k| present >> k & 1 == 1);
    (channels.zip(0..m))
        .map(|(channel, i)| (channel, (update.innovation[i].powi(2) / update.s[i * m + i]).sqrt()))
        .filter(|(_, size)| size.is_finite())
        .fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst })
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

/// The judgement on a sample.
#[derive(Clone, Copy, Debug)]
pub(in crate::filter) struct Judgement {
    pub(in crate::filter) verdict: Verdict,
    pub(in crate::filter) outcome: Outcome,
    nis: f64,
    threshold: f64,
}

impl Ekf {
    /// Judges the innovation, and inflates the covariance where the recovery demands it.
    pub(in crate::filter) fn judge(
        &mut self,
        attempt: &Attempt<'_>,
        mut nis: f64,
        observer: &mut dyn Observer,
    ) -> Judgement {
        let Parts { estimate, sensors, signatures, watch, .. } = &mut self.parts;
        let update = &mut self.work.update;
        let &Attempt { sample, index, present, .. } = attempt;
        let slot = &sensors[index];
        let threshold = slot.thresholds[update.m];
        let passes = nis <= threshold && nis.is_finite();
        // evidence on the cause matters for a gated sample, and until the sensor agrees again
        let (share, evidence) = if passes && !slot.lockout.disagrees() {
            (0.0, Evidence { passes, ..Evidence::default() })
        } else {
            let shared = shared(&self.composition, sensors, index);
            let contradicted = update.remaining(present, &slot.reach).map(|left| left <= GONE);
            (update.share(present, &slot.reach), Evidence { passes, shared, contradicted })
        };
        let worst = if passes { (0, 0.0) } else { worst(update, present) };
        let slot = &mut sensors[index];
        let (sensor, time, channels) = (slot.name.as_str(), sample.time, update.m);
        let judged = Judged { sensor, time, nis, threshold, m: channels, share, worst };
        let verdict = slot.lockout.judge(&judged, evidence, &slot.recovery, observer);
        if verdict == Verdict::Inflate {
            let unseen = update.unseen(&self.considered, present, &slot.reach);
            nis = inflate(update, &mut estimate.covariance, &self.considered, &unseen, nis);
            if let Some(signatures) = signatures {
                signatures.recovered();
            }
            watch.widened();
        }
        let outcome = match verdict {
            Verdict::Gate => Outcome::Gated,
            Verdict::Isolate => Outcome::Rejected(Rejection::Isolated),
            Verdict::Pass | Verdict::Accept | Verdict::Inflate => Outcome::Accepted,
        };
        Judgement { verdict, outcome, nis, threshold }
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
        attempt: &Attempt<'_>,
        observer: &mut dyn Observer,
    ) {
        let Parts { estimate, sensors, .. } = &mut self.parts;
        let update = &mut self.work.update;
        let slot = &mut sensors[attempt.index];
        if let Some(repeats) = &mut slot.repeats {
            repeats.keep(update, attempt.present, false);
        }
        if let Some(factor) = &mut slot.factor {
            let info = &self.composition.sensors[attempt.index].info;
            factor.take((attempt.sample, attempt.present), (update, false), info, observer);
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
