//! Explanations for states that are not determined.

use crate::component::Determination;
use crate::direction::Direction;
use crate::tracker::Tracker;

/// Smallest correlation of initial errors that is named.
const PARTNER: f64 = 0.5;
/// Largest number of named partners.
const PARTNERS: usize = 2;

/// Motion that determines the scale factor of a velocity log, and two angles of its misalignment.
pub(crate) const AHEAD: &str = "accelerate straight ahead";
/// Motion with forces along a second axis.
pub(crate) const SIDEWAYS: &str = "thrust sideways or dive";
/// Motion that separates the bias of an accelerometer, which turns with the vehicle, from a tilt.
pub(crate) const TURN: &str = "turn by 90 deg";

/// What the columns *still prior* and *bits* of a table of states measure, and which of them decides.
pub const MEASURES: &str = "Still prior decides: at most 6 % is determined, and stays so up to 12 %; at most 50 % is in part. \
    Bits: how often sigma was halved. A state that others drive, such as a velocity, forgets its prior \
    although its sigma grows: it can be determined with few bits.";

/// Explains why the component is not determined; `None` if it is.
pub fn missing(tracker: &Tracker, i: usize) -> Option<String> {
    let (component, now) = (&tracker.components()[i], &tracker.status()[i]);
    match now.verdict {
        Determination::Determined => return None,
        Determination::Considered => {
            return Some("the scenario has mode = \"consider\": the state is not estimated".into());
        }
        Determination::InPart | Determination::NotDetermined => {}
    }
    let measuring = || tracker.sensors().iter().filter(|s| s.measures);
    if measuring().next().is_none() {
        return Some("no sensor measures: enable one".into());
    }
    if measuring().all(|s| s.used == 0) {
        return Some("no measurement has been used so far".into());
    }
    let owner = component.state.split('.').next().unwrap_or_default();
    if let Some(sensor) = measuring().find(|s| s.name == owner && s.used == 0) {
        return Some(format!("no sample of {} was used", sensor.name));
    }
    let readers: Vec<&str> = measuring().filter(|s| s.reads[i]).map(|s| s.name.as_str()).collect();
    let alone = tracker.alone().get(i).copied().unwrap_or(0.0);
    let reading = match readers.as_slice() {
        [] => "no enabled sensor reads it".to_owned(),
        [one] => format!("{one} reads it"),
        [.., last] => format!("{} and {last} read it", readers[..readers.len() - 1].join(", ")),
    };
    let grown = if now.sigma > 1.05 * now.prior {
        let unit =
            if component.unit.is_empty() { String::new() } else { format!(" {}", component.unit) };
        format!("; its sigma has grown from {} to {}{unit}", short(now.prior), short(now.sigma))
    } else {
        String::new()
    };
    // with all other states known, the measurements would hold less information than the prior
    if alone < 1.0 {
        let left = 100.0 / (1.0 + alone).sqrt();
        let so = match readers.as_slice() {
            [] => "and the measurements hardly depend on it",
            _ => "but it hardly changes the measurements",
        };
        let if_known = match left {
            99.5.. => String::new(),
            _ => format!(
                ": even with all other states known, {left:.0} % of its prior sigma would remain"
            ),
        };
        return Some(format!("{reading}, {so}{if_known}{grown}"));
    }
    let with = partners(tracker, i);
    if with.is_empty() {
        return Some(format!("{reading}; it converges slowly, against the process noise{grown}"));
    }
    let with: Vec<String> = with
        .iter()
        .map(|&(k, r)| format!("{} ({r:+.2})", tracker.components()[k].title(tracker.layout())))
        .collect();
    Some(format!(
        "{reading}; so far it is determined only together with {}{grown}",
        with.join(" and ")
    ))
}

/// The motion that helps to determine the component, by the conditions of Theorem 1 of Pan & Wu (2016)
/// and its remarks; `None` if it is determined, or if they have none for it.
pub fn manoeuvre(tracker: &Tracker, i: usize) -> Option<&'static str> {
    let (component, now) = (&tracker.components()[i], &tracker.status()[i]);
    if !matches!(now.verdict, Determination::InPart | Determination::NotDetermined) {
        return None;
    }
    let (owner, state) = component.state.rsplit_once('.')?;
    let log = tracker.sensors().iter().any(|s| s.name == owner && s.velocity && s.measures);
    match (state, component.name.as_str()) {
        ("accel_bias", "x" | "y") => Some(TURN),
        // Remark 2: forces along one axis leave the angle about it open
        ("misalignment", "roll") if log => Some(SIDEWAYS),
        ("misalignment" | "scale", _) if log => Some(AHEAD),
        _ => None,
    }
}

/// Returns the components whose remaining initial errors correlate most with this one, and the
/// correlations.
fn partners(tracker: &Tracker, i: usize) -> Vec<(usize, f64)> {
    let (n, left) = (tracker.components().len(), tracker.left());
    let correlation = |k: usize| left[i * n + k] / (left[i * n + i] * left[k * n + k]).sqrt();
    let mut with: Vec<(usize, f64)> =
        (0..n).filter(|&k| k != i).map(|k| (k, correlation(k))).collect();
    with.retain(|p| p.1.abs() >= PARTNER);
    with.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    with.truncate(PARTNERS);
    with
}

/// Writes a direction in terms of states: `0.98 ins.gyro_bias z + 0.20 ins.attitude yaw`.
pub fn direction(tracker: &Tracker, direction: &Direction) -> String {
    let title = |k: usize| tracker.components()[k].title(tracker.layout());
    match direction.parts.as_slice() {
        [(only, _)] => title(*only),
        [(first, weight), rest @ ..] => {
            let mut text = format!("{weight:.2} {}", title(*first));
            for (k, weight) in rest {
                let sign = if *weight < 0.0 { '-' } else { '+' };
                text += &format!(" {sign} {:.2} {}", weight.abs(), title(*k));
            }
            text
        }
        [] => "many states at once".into(),
    }
}

/// Formats the share of an estimate that is still prior.
pub fn still_prior(weight: f64) -> String {
    format!("{:.0} %", 100.0 * weight)
}

/// Formats a number with one decimal, without a sign before a zero.
pub fn tenths(value: f64) -> String {
    format!("{:.1}", (10.0 * value).round() / 10.0 + 0.0)
}

/// Formats a number with two or three significant digits.
pub fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (1.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_zero_has_a_sign() {
        assert_eq!(
            [-0.04, -0.0, 0.04, -0.06, 2.25].map(tenths),
            ["0.0", "0.0", "0.0", "-0.1", "2.3"]
        );
    }
}
