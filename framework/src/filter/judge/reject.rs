//! Samples that the filter rejects, and the warning about the first of a row.

use crate::filter::ekf::Ekf;
use crate::model::record::{Event, Level, Observer, Outcome, Rejection, UpdateRecord};
use crate::model::sensor::Role;
use crate::units::sample::Sample;
use std::mem::discriminant;

/// Record of a sample that the filter rejects.
pub(in crate::filter) fn rejected(sample: &Sample, rejection: Rejection) -> UpdateRecord<'static> {
    UpdateRecord {
        time: sample.time,
        sensor: sample.sensor,
        outcome: Outcome::Rejected(rejection),
        nis: f64::NAN,
        threshold: f64::NAN,
        present: sample.present(),
        innovation: &[],
        covariance: &[],
    }
}

impl Ekf {
    /// Rejects a sample, with a warning unless the sensor's previous sample was rejected for the
    /// same reason.
    pub(in crate::filter) fn reject(
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
        let before = self.parts.sensors[index].refused.replace(rejection);
        if before.is_some_and(|before| discriminant(&before) == discriminant(&rejection)) {
            return;
        }
        let sensor = &self.composition.sensors[index].info;
        let last = self.parts.sensors[index].last;
        let text = match rejection {
            Rejection::NotFinite(channel) => {
                let name = sensor.channel(channel);
                let value = sample.get(channel).unwrap_or(f64::NAN);
                format!("sample rejected: channel {name} is {value}")
            }
            Rejection::Missing => "sample rejected: channels are missing".to_owned(),
            Rejection::OutOfOrder if sample.time == last => {
                "sample rejected: the sensor already has a sample of this time".to_owned()
            }
            Rejection::OutOfOrder => {
                format!("sample rejected: time goes back from {last} to {}", sample.time)
            }
            Rejection::Late if let Some(late) = self.composition.sensors[index].late => {
                format!("sample rejected: it arrived later than late = {late} allows")
            }
            Rejection::Late if !self.running() => {
                format!("sample rejected: {} is before samples that arrived earlier", sample.time)
            }
            Rejection::Late => {
                let now = self.state().time;
                format!("sample rejected: {} is before the state's {now}", sample.time)
            }
            Rejection::Singular => "sample rejected: the innovation covariance is singular; is \
                                    the sensor's noise zero?"
                .to_owned(),
            Rejection::OutOfRange(channel) | Rejection::TooFast(channel) => {
                let name = sensor.channel(channel);
                let value = sample.get(channel).unwrap_or(f64::NAN);
                let why = if matches!(rejection, Rejection::TooFast(_)) {
                    "changes faster than"
                } else {
                    "is outside"
                };
                format!("sample rejected: channel {name} = {value} {why} its limits")
            }
            Rejection::Unset => "sample rejected: zero in place of a measurement".to_owned(),
            Rejection::Repeated => {
                "sample rejected: it repeats earlier samples while the vehicle moves".to_owned()
            }
            Rejection::Isolated => "sample judged and not used: the sensor is isolated".to_owned(),
            Rejection::NoInput => "sample unused: no driving sample covers its time".to_owned(),
            Rejection::Excluded => "samples unused: the scenario excludes this time".to_owned(),
            Rejection::Prediction => {
                "sample rejected: the sensor's model predicts NaN for it".to_owned()
            }
            Rejection::Absent => "sample unused: the state that it observes is absent".to_owned(),
        };
        let asked = matches!(rejection, Rejection::Excluded | Rejection::Absent);
        observer.event(Event {
            time: sample.time,
            level: if asked { Level::Info } else { Level::Warning },
            about: sensor.name.clone(),
            text,
        });
    }
}
