//! Channels with another unit or sign.

use crate::causes::factors::factors;
use crate::patch::Patch;
use crate::scene::Instrument;
use navfuse_core::document::Document;
use std::f64::consts::PI;

/// Factor, and what the channel then held.
type Unit = (f64, &'static str);

/// Pressure of a metre of sea water, kPa: density 1025 kg/m^3 times standard gravity.
const KPA: f64 = 10.051_816_25;

const LENGTHS: [Unit; 6] = [
    (0.304_8, "in feet"),
    (1.0 / 0.304_8, "in feet, converted twice"),
    (0.001, "in mm"),
    (0.01, "in cm"),
    (1000.0, "in km"),
    (100.0, "100 times too small"),
];
const DEPTHS: [Unit; 6] = [
    (1.0 / KPA, "in kPa"),
    (100.0 / KPA, "in bar"),
    (10.0 / KPA, "in dbar"),
    (0.1 / KPA, "in hPa"),
    (1025.0 / 1000.0, "of sea water's density, in fresh water"),
    (1000.0 / 1025.0, "of fresh water's density, in sea water"),
];
const SPEEDS: [Unit; 7] = [
    (0.001, "in mm/s"),
    (0.01, "in cm/s"),
    (0.304_8, "in ft/s"),
    (1852.0 / 3600.0, "in knots"),
    (1.0 / 3.6, "in km/h"),
    (3.6, "in m/s, converted from km/h"),
    (1000.0, "1000 times too small"),
];
const ANGLES: [Unit; 2] = [(PI / 180.0, "in deg"), (180.0 / PI, "in rad, converted from deg")];
const ACCELERATIONS: [Unit; 6] = [
    (9.806_65, "in g"),
    (1.0 / 9.806_65, "in m/s^2, converted from g"),
    (0.009_806_65, "in mg"),
    (0.304_8, "in ft/s^2"),
    (2.0, "halved"),
    (0.5, "doubled"),
];

/// Ranges of a channel that are set apart.
const SINGLE: [Unit; 2] = [(2.0, "halved"), (0.5, "doubled")];

fn units(suffix: &str) -> &'static [Unit] {
    match suffix {
        "m" => &LENGTHS,
        "mps" => &SPEEDS,
        "rad" | "radps" => &ANGLES,
        "mps2" => &ACCELERATIONS,
        _ => &[],
    }
}

/// One of several channels that has another scale than the rest.
fn single(sensor: &Instrument, document: &Document, same: &[usize]) -> Vec<Patch> {
    let choices = same.len() * SINGLE.len();
    let all = same.iter().flat_map(|k| SINGLE.map(|(factor, what)| (*k, factor, what)));
    let patch = |(k, factor, what)| {
        let text = format!("{} {what}", sensor.info.channel(k));
        factors(document, sensor, &text, choices, &[(k, factor)])
    };
    all.map(patch).collect()
}

/// Changes of the unit of all channels that share one, and of the scale and the sign of each channel.
pub(super) fn changed(sensor: &Instrument, document: &Document) -> Vec<Patch> {
    let count = sensor.used;
    let channels = || (0..count).map(|k| (k, sensor.info.channels[k].unit.suffix()));
    let mut suffixes: Vec<String> = channels().map(|(_, suffix)| suffix).collect();
    suffixes.sort();
    suffixes.dedup();
    let mut all = Vec::new();
    for suffix in &suffixes {
        let same: Vec<usize> = channels().filter(|(_, s)| s == suffix).map(|(k, _)| k).collect();
        let depth = suffix == "m" && same.iter().any(|k| sensor.info.channel(*k) == "depth");
        let mut units = units(suffix).to_vec();
        units.extend(depth.then_some(DEPTHS).into_iter().flatten());
        let names: Vec<&str> = same.iter().map(|k| sensor.info.channel(*k)).collect();
        for (factor, what) in &units {
            let text = format!("{} {what}", names.join(", "));
            let changed: Vec<(usize, f64)> = same.iter().map(|k| (*k, *factor)).collect();
            all.push(factors(document, sensor, &text, units.len(), &changed));
        }
        if same.len() > 1 {
            all.extend(single(sensor, document, &same));
            let text = format!("{} with the other sign", names.join(", "));
            let changed: Vec<(usize, f64)> = same.iter().map(|k| (*k, -1.0)).collect();
            all.push(factors(document, sensor, &text, 2, &changed));
        }
    }
    // three channels of one sign are a set of axes
    let vector = |k: usize| {
        let name = sensor.info.channel(k);
        ["_x", "_y", "_z"].iter().any(|end| name.ends_with(end))
    };
    for k in (0..count).filter(|k| !vector(*k) || sensor.info.channels.len() > 3) {
        let text = format!("{} with the other sign", sensor.info.channel(k));
        all.push(factors(document, sensor, &text, count, &[(k, -1.0)]));
    }
    all
}
