//! Reasons, remedies and messages of a lock-out.

use super::{Isolation, Judged, Lockout, Streak};
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::{Event, Level, Observer};
use crate::units::time::Time;

/// Reasons of an isolation.
pub(super) const CONTRADICTED: &str = "other sensors contradict it";
pub(super) const JUMPED: &str =
    "its innovation jumped between two samples, and an error of the filter would grow gradually";

/// Remedy where the first samples were wrong, or the prior was.
pub(super) const EARLIER: &str = "check the earlier samples, which the filter followed, and exclude them if \
                                  they are wrong; otherwise check the prior";

/// Remedy where the first sample was wrong.
const FIRST: &str = "nothing, if single samples of this sensor are wrong now and then; otherwise look at \
                     what it sends while it starts";

/// Remedy where the sensor is at fault.
pub(super) const SENSOR: &str = "look at the sensor's samples from then on; its range, mounting and \
                                 settings may have changed";

/// Remedy where the filter is at fault.
pub(super) const NOISE: &str = "the uncertainty was too small: raise the noise of the driving sensor, or \
                                the priors, until the innovations are consistent";

/// Remedy where the driving sensor is at fault, or its noise.
const DRIVER: &str = "look at its samples from then on, and at its axes, unit and mounting; if they are right, the \
                      uncertainty was too small: raise its noise, or the priors, until the innovations are consistent";

/// What the filter does where it has to go on with a sensor that it contradicts.
pub(super) const INFLATED: &str = "the covariance is inflated and this sample is used";

/// Remedy where the screening may have replaced right samples.
pub(super) const REPLACED: &str = "the replaced samples were right, as in a hard stop: if you expect such \
                                   shocks, switch off the screening of the driving sensor";

/// Remedy where the fault may be in the sensor or in the filter.
pub(super) const EITHER: &str = "no other sensor decides which one is wrong: look at the sensor's samples \
                                 from then on, and at the noise of the driving sensor; recovery.action = \
                                 \"report\" keeps the filter from adopting them";

/// Remedy where the fault lasts.
const SINCE_THE_START: &str = "check the axes, signs, unit, clock and mounting of the sensor, and then those of \
                               the driving sensor; `navfuse diagnose` tries each";

pub(super) fn log(sample: &Judged<'_>, level: Level, text: String, observer: &mut dyn Observer) {
    observer.event(Event { time: sample.time, level, about: sample.sensor.to_owned(), text });
}

pub(super) fn find(
    sample: &Judged<'_>,
    severity: Severity,
    text: String,
    remedy: &str,
    observer: &mut dyn Observer,
) {
    report(sample, (severity, Basis::Comparison), text, remedy, observer);
}

fn report(
    sample: &Judged<'_>,
    (severity, basis): (Severity, Basis),
    text: String,
    remedy: &str,
    observer: &mut dyn Observer,
) {
    let (time, about, remedy) = (sample.time, sample.sensor.to_owned(), remedy.to_owned());
    observer.finding(Finding { time, about, severity, basis, text, remedy });
}

/// Reports that the filter was wrong, since several sensors contradict it: an error of the driving sensor is in all of them.
pub(super) fn drives_wrong(sample: &Judged<'_>, lock_out: &str, observer: &mut dyn Observer) {
    let (about, text, remedy) = match sample.driver {
        Some(driver) => (driver, format!("{} {lock_out}", sample.sensor), DRIVER),
        None => (sample.sensor, lock_out.to_owned(), NOISE),
    };
    let of = Judged { sensor: about, ..*sample };
    find(&of, Severity::DoNotUse, text, remedy, observer);
}

/// The finding at a time that the first sample of a sensor was wrong.
pub(in crate::filter) fn first_was_wrong(sensor: &str, since: Time, time: Time) -> Finding {
    let (severity, basis) = (Severity::Contained, Basis::Comparison);
    let text = format!(
        "the first sample, at {since}, was wrong, since those after it contradict it; the filter continues as \
         if it had not used it"
    );
    Finding { time, about: sensor.to_owned(), severity, basis, text, remedy: FIRST.to_owned() }
}

/// Reports a sensor that contradicts the filter again and again after it has followed it: an error of the estimate,
/// or a step of either sensor, would have been over.
pub(super) fn lasts_on(
    sample: &Judged<'_>,
    times: u32,
    lock_out: &str,
    observer: &mut dyn Observer,
) {
    let text = format!(
        "{lock_out}; that was so {times} times: the sensor has an error that lasts, or the driving sensor has one"
    );
    report(sample, (Severity::DoNotUse, Basis::Explanation), text, SINCE_THE_START, observer);
}

/// Reports that the filter was off by more than its sigma after a silence, s: its number of gated samples, and
/// their begin.
pub(super) fn coasted(
    sample: &Judged<'_>,
    silence: f64,
    (count, since): (u64, Time),
    observer: &mut dyn Observer,
) {
    let sensor = sample.sensor;
    let text = format!(
        "after {silence:.1} s without a used sample of {sensor} the filter was off by more than its sigma \
         allows: every one of {count} samples since {since} was outside the gate; {INFLATED}"
    );
    report(sample, (Severity::Contained, Basis::Silence), text, NOISE, observer);
}

impl Lockout {
    /// Reports a sensor that is still gated or isolated after the last sample. If it is the only one, the filter has
    /// gone on without any.
    pub(in crate::filter) fn finish(
        &self,
        (sensor, time): (&str, Time),
        only: bool,
        observer: &mut dyn Observer,
    ) {
        let sample = Judged::none(sensor, time);
        if let Some(streak @ Streak { since, count, .. }) = self.streak {
            let last = match count {
                1 => "the last sample was gated".to_owned(),
                _ => format!("the last {count} samples were gated, since {since}"),
            };
            let text = format!("{last}, {}", self.largest(&streak));
            log(&sample, Level::Warning, text, observer);
        }
        if let Some(Isolation { since, contradicted, .. }) = self.isolation {
            let text = format!(
                "the sensor is isolated at the end, and has contradicted the filter since {since}"
            );
            let (severity, remedy) = if contradicted && !only {
                (Severity::Contained, SENSOR)
            } else {
                (Severity::DoNotUse, EITHER)
            };
            find(&sample, severity, text, remedy, observer);
        }
    }
}
