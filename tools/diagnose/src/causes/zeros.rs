//! Samples of zeros between others.

use crate::patch::{Patch, path};
use crate::scene::{Instrument, Scene};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::plugin::Kind;
use navfuse_core::units::sample::Sample;

/// Share of samples of zeros from which on a driver may write them, and up to which others tell of the
/// motion.
const SHARE: std::ops::Range<f64> = 0.02..0.98;
/// Longest interval that the driving sensor bridges by default, s.
const BRIDGED: f64 = 0.1;

/// Samples of zeros alone are missing; `None` where the recording has hardly any, or nothing else.
pub(super) fn missing(scene: &Scene<'_>, sensor: &Instrument) -> Option<Patch> {
    let name = sensor.info.name.as_str();
    let zero = |sample: &Sample| {
        (0..sensor.info.channels.len()).all(|k| sample.get(k).unwrap_or(0.0) == 0.0)
    };
    let (mut all, mut zeros) = (0.0, 0.0);
    let (mut last, mut longest) = (None, 0.0_f64);
    for sample in scene.recording.of(name) {
        all += 1.0;
        if zero(sample) {
            zeros += 1.0;
        } else if let Some(before) = last.replace(sample.time) {
            longest = longest.max(sample.time.since(before));
        }
    }
    if !SHARE.contains(&(zeros / all)) {
        return None;
    }
    let mut settings = vec![format!("{}=\"missing\"", path(Kind::Sensor, name, "samples.zeros"))];
    if sensor.info.purpose == Purpose::Input && longest > BRIDGED {
        let gap = (longest * 11.0).ceil() / 10.0;
        settings.push(format!("{}=\"{gap} s\"", path(Kind::Sensor, name, "max_gap")));
    }
    let text =
        format!("{name}: {:.0} % of its samples are zeros, and missing", 100.0 * zeros / all);
    Some(Patch::new(text, settings))
}
