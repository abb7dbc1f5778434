//! The measurement update: gate, recovery from lock-out, injection and reset.

use super::filter::{Ekf, EstimatorError, rejected};
use super::slot::Verdict;
use crate::model::gate::Action;
use crate::model::measurement::{AnyMeasurement, At};
use crate::model::record::{Event, Level, Observer, Outcome, Rejection, UpdateRecord};
use crate::model::sensor::Sensor;
use crate::state::covariance::{Covariance, Update};
use crate::units::sample::Sample;
use std::mem::discriminant;

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
        match update.innovate(covariance) {
            Some(now) => nis = now,
            None => break,
        }
    }
    nis
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
        let &Sensor { noise, time_offset, .. } = &self.composition.sensors[sample.sensor.0];
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
        let Some(mut nis) = update.innovate(&m.covariance) else {
            self.reject(sample, Rejection::Singular, observer);
            return Ok(());
        };
        let slot = &mut m.sensors[sample.sensor.0];
        slot.refused = None;
        let threshold = slot.thresholds[update.m];
        let verdict = slot.judge(sample.time, nis, update.m, observer);
        let present = sample.present() & slot.channels;
        if matches!(verdict, Verdict::Inflate) {
            let unseen = update.unseen(&self.considered, present, &slot.reach);
            nis = inflate(update, &mut m.covariance, &self.considered, &unseen, nis);
        }
        let outcome =
            if matches!(verdict, Verdict::Gate) { Outcome::Gated } else { Outcome::Accepted };
        observer.update(&UpdateRecord {
            time: sample.time,
            sensor: sample.sensor,
            outcome,
            nis,
            threshold,
            present,
            innovation: &update.innovation,
            covariance: &update.s,
        });
        if outcome == Outcome::Gated {
            let first = slot.gated.is_some_and(|streak| streak.count == 1);
            if first && slot.recovery.action == Action::Inflate {
                update.begin(&m.covariance, &self.considered, present, &mut slot.reach);
            }
            return Ok(());
        }
        slot.reach.clear();
        update.apply(&mut m.covariance, &self.considered);
        for other in m.sensors.iter_mut().filter(|other| !other.reach.is_empty()) {
            update.correct(&mut other.reach);
        }
        self.layout.inject(&mut m.state, &mut update.delta, &mut m.covariance);
        // the injected error, since a velocity that turns moves by more than the gain alone gives
        observer.correction(update);
        if let Some(history) = &mut m.history {
            history.corrected(&update.delta);
        }
        match m.covariance.first_invalid() {
            None => Ok(()),
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
        if self.driver == Some(sample.sensor.0) {
            observer.input(sample, Some(rejection));
        } else {
            observer.update(&rejected(sample, rejection));
        }
        let before = self.memory.sensors[sample.sensor.0].refused.replace(rejection);
        if before.is_some_and(|before| discriminant(&before) == discriminant(&rejection)) {
            return;
        }
        let sensor = &self.composition.sensors[sample.sensor.0].info;
        let last = self.memory.sensors[sample.sensor.0].last;
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
            Rejection::Late => {
                let now = self.state().time;
                format!("sample rejected: {} is before the state's {now}", sample.time)
            }
            Rejection::Singular => "sample rejected: the innovation covariance is singular; is \
                                    the sensor's noise zero?"
                .to_owned(),
            Rejection::NoInput => "sample unused: no driving sample covers its time".to_owned(),
        };
        observer.event(Event {
            time: sample.time,
            level: Level::Warning,
            about: sensor.name.clone(),
            text,
        });
    }
}
