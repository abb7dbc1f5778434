//! The measurement update: gate, recovery from lock-out, injection and reset.

use super::filter::{Ekf, rejected};
use super::lockout::{Evidence, GONE, Judged, Verdict};
use super::slot::SensorSlot;
use super::unscented::regress;
use crate::compose::Composition;
use crate::model::estimator_error::EstimatorError;
use crate::model::gate::Action;
use crate::model::measurement::{AnyMeasurement, At};
use crate::model::record::{Event, Level, Observer, Outcome, Rejection, UpdateRecord};
use crate::model::sensor::{Role, Sensor};
use crate::model::update_rule::UpdateRule;
use crate::state::covariance::{Covariance, Update};
use crate::units::sample::{Channel, Sample};
use crate::units::time::Time;
use std::mem::discriminant;

/// Channel with the largest innovation of a sample, and its size in sigma.
fn worst(update: &Update, present: u16, channels: &[Channel]) -> (&'static str, f64) {
    let m = update.m;
    let names = (channels.iter().enumerate())
        .filter(|(k, _)| u32::from(present).checked_shr(*k as u32).is_some_and(|p| p & 1 == 1));
    (names.zip(0..m))
        .map(|((_, channel), i)| {
            (channel.name, (update.innovation[i].powi(2) / update.s[i * m + i]).sqrt())
        })
        .filter(|(_, size)| size.is_finite())
        .fold(("", 0.0), |worst, next| if next.1 > worst.1 { next } else { worst })
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

impl Ekf {
    /// Updates the estimate at the state's time.
    pub(super) fn correct(
        &mut self,
        sample: &Sample,
        model: &dyn AnyMeasurement,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let m = &mut self.memory;
        let update = &mut self.update;
        let &Sensor { noise, time_offset, update: rule, .. } =
            &self.composition.sensors[sample.sensor.0];
        match time_offset.zip(m.history.as_mut()) {
            None => model.linearise(&At { layout: &self.layout, state: &m.state, sample }, update),
            Some((offset, history)) => {
                if !history.linearise(model, offset, (&self.layout, &m.state), sample, update) {
                    return Ok(()); // its time less the offset is before the start
                }
            }
        }
        if noise != 1.0 {
            update.r.iter_mut().for_each(|r| *r *= noise * noise);
        }
        let index = sample.sensor.0;
        let slot = &mut m.sensors[index];
        let present = sample.present() & slot.channels;
        let repeated = slot.repeats.as_mut().map_or(1.0, |repeats| repeats.take(sample, present));
        if repeated != 1.0 {
            update.r.iter_mut().for_each(|r| *r *= repeated * repeated);
        }
        let at = At { layout: &self.layout, state: &m.state, sample };
        if rule == UpdateRule::Ukf {
            regress(&mut self.points, &at, model, &m.covariance, update);
        }
        let Some(mut nis) = update.innovate(&m.covariance) else {
            self.reject(sample, Rejection::Singular, observer);
            return Ok(());
        };
        if let Some(repeats) = &mut slot.repeats
            && let Some(stuck) = repeats.stuck(update, present, repeated)
        {
            repeats.keep(update, present, false);
            if slot.refused != Some(Rejection::Repeated) {
                observer.finding(stuck.finding(sample.time, &slot.name));
            }
            self.reject(sample, Rejection::Repeated, observer);
            return Ok(());
        }
        slot.refused = None;
        let threshold = slot.thresholds[update.m];
        let passes = nis <= threshold && nis.is_finite();
        let slot = &m.sensors[index];
        // evidence on the cause matters for a gated sample, and until the sensor agrees again
        let (share, evidence) = if passes && !slot.lockout.disagrees() {
            (0.0, Evidence { passes, ..Evidence::default() })
        } else {
            let shared = shared(&self.composition, &m.sensors, index);
            let contradicted = update.remaining(present, &slot.reach).map(|left| left <= GONE);
            (update.share(present, &slot.reach), Evidence { passes, shared, contradicted })
        };
        let slot = &mut m.sensors[index];
        let worst = if passes {
            ("", 0.0)
        } else {
            worst(update, present, &self.composition.sensors[index].info.channels)
        };
        let (sensor, time, m_channels) = (slot.name.as_str(), sample.time, update.m);
        let judged = Judged { sensor, time, nis, threshold, m: m_channels, share, worst };
        let verdict = slot.lockout.judge(&judged, evidence, &slot.recovery, observer);
        if verdict == Verdict::Inflate {
            let unseen = update.unseen(&self.considered, present, &slot.reach);
            nis = inflate(update, &mut m.covariance, &self.considered, &unseen, nis);
        }
        let outcome = match verdict {
            Verdict::Gate => Outcome::Gated,
            Verdict::Isolate => Outcome::Rejected(Rejection::Isolated),
            Verdict::Pass | Verdict::Inflate => Outcome::Accepted,
        };
        let slot = &mut m.sensors[index];
        if outcome == Outcome::Accepted {
            slot.reach.clear();
            if let Some(test) = &mut slot.bias
                && verdict == Verdict::Pass
                && let Some(shift) = test.take(sample.time, update, present)
            {
                let info = &self.composition.sensors[index].info;
                observer.finding(shift.finding(sample.time, info));
            }
            let how = (rule, slot.robust);
            if !self.refinement.run((&at, model), how, &m.covariance, &self.considered, update) {
                self.reject(sample, Rejection::Singular, observer);
                return Ok(());
            }
        }
        let (innovation, covariance) = match outcome {
            Outcome::Accepted => self.refinement.judged(update),
            _ => (&update.innovation[..], &update.s[..]),
        };
        observer.update(&UpdateRecord {
            time: sample.time,
            sensor: sample.sensor,
            outcome,
            nis,
            threshold,
            present,
            innovation,
            covariance,
        });
        if outcome == Outcome::Gated {
            observer.gated(update);
        }
        if outcome != Outcome::Accepted {
            if let Some(repeats) = &mut slot.repeats {
                repeats.keep(update, present, false);
            }
            let first = slot.lockout.streak.is_some_and(|streak| streak.count == 1);
            if first && slot.recovery.action == Action::Inflate {
                update.begin(&m.covariance, &self.considered, present, &mut slot.reach);
            }
            if slot.isolation().is_some() {
                slot.reach.end();
            }
            return Ok(());
        }
        // an unscented update takes the curvature for noise, and an iterated one linearises at its
        // end
        let mut curved = None;
        if let Some(check) = slot.curvature.as_mut().filter(|_| rule == UpdateRule::Ekf)
            && check.is_due(update, &m.covariance)
        {
            curved = check.check(&mut self.points, &at, model, &m.covariance, update);
        }
        update.apply(&mut m.covariance, &self.considered);
        if rule == UpdateRule::Iekf {
            self.refinement.correct(&mut update.delta);
        }
        if let Some(repeats) = &mut slot.repeats {
            repeats.keep(update, present, true);
        }
        for other in m.sensors.iter_mut().filter(|other| !other.reach.is_empty()) {
            update.correct(&mut other.reach);
        }
        self.layout.inject(&mut m.state, &mut update.delta, &mut m.covariance);
        if let Some(check) =
            m.sensors[index].curvature.as_mut().filter(|_| rule == UpdateRule::Iekf)
            && check.is_due(update, &m.covariance)
        {
            let at = At { layout: &self.layout, state: &m.state, sample };
            curved = check.check(&mut self.points, &at, model, &m.covariance, update);
        }
        if let Some(curved) = curved {
            let info = &self.composition.sensors[index].info;
            observer.finding(curved.finding(sample.time, info, &self.layout));
        }
        // the injected error, since a velocity that turns moves by more than the gain alone gives
        observer.correction(update);
        if let Some(history) = &mut m.history {
            history.corrected(&update.delta);
        }
        match m.covariance.first_invalid() {
            None => {
                // while a sensor contradicts the estimate, a correction by another proves nothing
                if m.sensors.iter().all(|slot| !slot.lockout.disagrees()) {
                    self.watch(|monitor, filter| -> Option<()> {
                        monitor.corrected(filter);
                        None
                    });
                }
                Ok(())
            }
            Some(i) => {
                let block = self.layout.blocks.iter().find(|b| b.tangent_range().contains(&i));
                let block = block.map_or_else(String::new, |b| b.name.clone());
                Err(EstimatorError::Covariance { time: sample.time, block })
            }
        }
    }

    /// Rejects a sample, with a warning unless the sensor's previous sample was rejected for the
    /// same reason.
    pub(super) fn reject(
        &mut self,
        sample: &Sample,
        rejection: Rejection,
        observer: &mut dyn Observer,
    ) {
        if matches!(self.composition.sensors[sample.sensor.0].role, Role::Input(_)) {
            observer.input(sample, Some(rejection));
        } else {
            observer.update(&rejected(sample, rejection));
        }
        let index = sample.sensor.0;
        let before = self.memory.sensors[index].refused.replace(rejection);
        if before.is_some_and(|before| discriminant(&before) == discriminant(&rejection)) {
            return;
        }
        let sensor = &self.composition.sensors[index].info;
        let last = self.memory.sensors[index].last;
        let text = match rejection {
            Rejection::NotFinite(channel) => {
                let name = sensor.channels.get(channel).map_or("?", |c| c.name);
                let value = sample.get(channel).unwrap_or(f64::NAN);
                format!("sample rejected: channel {name} is {value}")
            }
            Rejection::Missing => "sample rejected: channels are missing".to_owned(),
            Rejection::OutOfOrder if sample.time == last => {
                "sample rejected: its time is there already".to_owned()
            }
            Rejection::OutOfOrder => {
                format!("sample rejected: time goes back from {last} to {}", sample.time)
            }
            Rejection::Late if let Some(late) = self.composition.sensors[index].late => {
                format!("sample rejected: it arrived later than late = {late} allows")
            }
            Rejection::Late => {
                let now = self.state().time;
                format!("sample rejected: {} is before the state's {now}", sample.time)
            }
            Rejection::Singular => "sample rejected: the innovation covariance is singular; is \
                                    the sensor's noise zero?"
                .to_owned(),
            Rejection::OutOfRange(channel) | Rejection::TooFast(channel) => {
                let name = sensor.channels.get(channel).map_or("?", |c| c.name);
                let value = sample.get(channel).unwrap_or(f64::NAN);
                let why = if matches!(rejection, Rejection::TooFast(_)) {
                    "changes faster than"
                } else {
                    "is outside"
                };
                format!("sample rejected: channel {name} = {value} {why} its limits")
            }
            Rejection::Repeated => {
                "sample rejected: it repeats the samples before, and the vehicle moves".to_owned()
            }
            Rejection::Isolated => "sample judged and not used: the sensor is isolated".to_owned(),
            Rejection::NoInput => "sample unused: no driving sample covers its time".to_owned(),
            Rejection::Excluded => "samples unused: the scenario excludes this time".to_owned(),
        };
        let asked = rejection == Rejection::Excluded;
        observer.event(Event {
            time: sample.time,
            level: if asked { Level::Info } else { Level::Warning },
            about: sensor.name.clone(),
            text,
        });
    }
}
