//! What is reported of an offset of a clock.

use super::effect::Found;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::state::Layout;
use crate::units::time::Time;

/// A significant offset, beside the one that is taken off already.
pub(super) struct Lag {
    pub(super) found: Found,
    pub(super) known: f64,
    /// Set if the samples would have been sent before they were measured, from the start. Those of the driving sensor
    /// are late then, which is the same to the filter.
    pub(super) early: bool,
}

/// Finding about the sensor, or about the driving one whose samples are late beside those of the sensor.
pub(super) fn finding(
    lag: &Lag,
    time: Time,
    (sensor, driver): (&str, Option<&str>),
    layout: &Layout,
) -> Finding {
    let Lag { found, known, early } = lag;
    let (score, tau) = (&found.score, known + found.score.size());
    let fit = format!(
        "fit a time offset of {tau:+.3} s +- {:.3} s ({:.1} sigma)",
        score.variance().sqrt(),
        score.sigmas().abs()
    );
    let (since, moved) = (score.since, found.moved(layout));
    let (about, text) = match driver.filter(|_| *early) {
        Some(driver) => (
            driver,
            format!(
                "after {since} the samples of {sensor} {fit}: those of {driver} are late by as much, or the clock of \
                 {sensor} is behind; it has moved {moved}"
            ),
        ),
        None => (
            sensor,
            format!("after {since} its samples {fit}, which is not modelled: it has moved {moved}"),
        ),
    };
    let clocks = if about == sensor { sensor.to_owned() } else { format!("{about} and {sensor}") };
    Finding {
        time,
        about: about.to_owned(),
        severity: found.severity,
        basis: Basis::Explanation,
        text,
        remedy: format!(
            "check the clock of {clocks} and the time stamps; if the offset is constant, \
             estimate it at {sensor}: time_offset = {{ sigma = \"{:.1} s\" }}",
            (2.0 * tau.abs()).max(0.1)
        ),
    }
}

/// Finding about a sensor whose samples contradict the offset that was taken off.
pub(super) fn withdrawn(time: Time, sensor: &str) -> Finding {
    Finding {
        time,
        about: sensor.to_owned(),
        severity: Severity::DoNotUse,
        // it names no error, and one of the driving sensor looks like an offset for a while
        basis: Basis::Comparison,
        text:
            "its samples contradict the time offset that they fitted before: it was another error, \
               and the filter goes on as if it had not known an offset"
                .to_owned(),
        remedy: "check the sensor; `navfuse diagnose` tries each plausible error".to_owned(),
    }
}
