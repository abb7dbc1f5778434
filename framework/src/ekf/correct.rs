//! The update: gate, way out of lock-out, injection and reset.

use super::{Ekf, EstimatorError, rejected};
use crate::compose::{Role, Sensor};
use crate::covariance::{Covariance, Reach, Update};
use crate::gate::{Action, Recovery};
use crate::measurement::{AnyMeasurement, At};
use crate::record::{Event, Level, Observer, Outcome, Rejection, UpdateRecord};
use crate::sample::{MAX_CHANNELS, Sample};
use crate::time::Time;
use std::mem::discriminant;

/// So many gated samples in a row are worth a warning.
const IN_A_ROW: u64 = 5;

/// So few gated samples in a row are no lock-out, however long they took: an outlier on either side of an outage.
const OUTLIERS: u64 = 2;

/// A sensor as the filter sees it.
#[derive(Clone)]
pub(super) struct SensorSlot {
    pub(super) name: String,
    /// The channels that it measures or drives by, one bit each.
    pub(super) channels: u16,
    /// The time of its last sample.
    pub(super) last: Time,
    /// The samples gated in a row until now.
    pub(super) gated: Option<Streak>,
    /// Where the error that the first of them showed has gone since, for the inflation.
    pub(super) reach: Reach,
    /// Why its last sample was rejected, if it was: said once in a row.
    pub(super) refused: Option<Rejection>,
    thresholds: [f64; MAX_CHANNELS + 1],
    recovery: Recovery,
}

/// Samples of one sensor that were gated, without one between them that passed.
#[derive(Clone, Copy)]
pub(super) struct Streak {
    pub(super) since: Time,
    pub(super) count: u64,
    /// Whether it was said that the filter is locked out.
    told: bool,
}

impl SensorSlot {
    /// For an error state of dimension `n`.
    pub(super) fn new(sensor: &Sensor, n: usize) -> Self {
        let used = match &sensor.role {
            Role::Measurement(model) => model.channels(),
            Role::Input(_) | Role::Reference(_) => sensor.info.channels.len(),
        };
        Self {
            name: sensor.info.name.clone(),
            channels: ((1u32 << used) - 1) as u16,
            last: Time::MIN,
            gated: None,
            reach: Reach::with_capacity(n, sensor.info.channels.len()),
            refused: None,
            thresholds: sensor.policy.gate.thresholds(),
            recovery: sensor.policy.recovery,
        }
    }

    /// What becomes of a sample of that normalised innovation squared, with `m` channels: accepted, gated, or accepted
    /// all the same because everything was gated for too long.
    fn judge(&mut self, time: Time, nis: f64, m: usize, observer: &mut dyn Observer) -> Verdict {
        let threshold = self.thresholds[m];
        let mut event = |level, text| observer.event(Event { time, level, about: self.name.clone(), text });
        if nis <= threshold && nis.is_finite() {
            if let Some(Streak { since, count, .. }) = self.gated.take() {
                event(Level::Info, format!("gate passes again after {count} gated samples since {since}"));
            }
            return Verdict::Pass;
        }
        let after = self.recovery.after.value().si();
        let mut streak = self.gated.unwrap_or(Streak { since: time, count: 0, told: false });
        streak.count += 1;
        let Streak { since, count, told, .. } = streak;
        self.gated = Some(streak);
        // one is what a gate is for; several in a row are worth a warning
        if count == 1 {
            event(Level::Info, format!("gate rejects: NIS {nis:.1} is above {threshold:.1}"));
        } else if count == IN_A_ROW {
            event(Level::Warning, format!("{count} samples gated in a row since {since}"));
        }
        if time.since(since) < after || count <= OUTLIERS || !nis.is_finite() {
            return Verdict::Gate;
        }
        let said = format!("locked out: every one of {count} samples was gated since {since}");
        let verdict = match self.recovery.action {
            Action::Report if told => return Verdict::Gate,
            Action::Report => {
                event(Level::Warning, said);
                self.gated = Some(Streak { told: true, ..streak });
                return Verdict::Gate;
            }
            Action::Inflate => {
                event(Level::Warning, format!("{said}; the covariance is inflated and this one used"));
                Verdict::Inflate
            }
            Action::Accept => {
                event(Level::Warning, format!("{said}; this one is used"));
                Verdict::Pass
            }
        };
        self.gated = None;
        verdict
    }
}

enum Verdict {
    Pass,
    Gate,
    Inflate,
}

/// Inflates the covariance until the innovation is about as large as its mean, `NIS = m`; gives the new NIS.
///
/// `1 + c = NIS / m` would do in one step if `S` were all `H P H'`. The noise in it makes the step fall short, so it is
/// repeated; it never goes too far.
fn inflate(update: &mut Update, covariance: &mut Covariance, considered: &[bool], unseen: &[f64], mut nis: f64) -> f64 {
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
    /// The update at the state's time.
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
                    return Ok(()); // it tells of a time before the start
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
        let outcome = if matches!(verdict, Verdict::Gate) { Outcome::Gated } else { Outcome::Accepted };
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
        // with what was injected: a velocity that turns moves by more than the gain says
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

    /// Turns a sample away, and says why unless the sensor's sample before it was turned away for the same reason.
    pub(super) fn reject(&mut self, sample: &Sample, rejection: Rejection, observer: &mut dyn Observer) {
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
                format!("sample rejected: channel {name} is {}", sample.get(channel).unwrap_or(f64::NAN))
            }
            Rejection::Missing => "sample rejected: channels are missing".to_owned(),
            Rejection::OutOfOrder if sample.time == last => "sample rejected: its time is there already".to_owned(),
            Rejection::OutOfOrder => format!("sample rejected: time goes back from {last} to {}", sample.time),
            Rejection::Late => format!("sample rejected: {} is before the state's {}", sample.time, self.state().time),
            Rejection::Singular => {
                "sample rejected: the innovation covariance is singular; is the sensor's noise zero?".to_owned()
            }
            Rejection::NoInput => "sample unused: no driving sample covers its time".to_owned(),
        };
        observer.event(Event { time: sample.time, level: Level::Warning, about: sensor.name.clone(), text });
    }
}
