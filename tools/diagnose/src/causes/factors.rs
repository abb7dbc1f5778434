//! Factors on the channels of a sensor.

use crate::likelihood::Channels;
use crate::patch::{Patch, path};
use crate::scene::Instrument;
use navfuse_core::document::Document;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::plugin::Kind;
use navfuse_core::units::sample::MAX_CHANNELS;
use std::collections::BTreeMap;

/// The factor that a scenario has on a channel.
fn present_factor(document: &Document, sensor: &str, channel: &str) -> f64 {
    let keys = [Kind::Sensor.table(), sensor, "samples", "factor", channel];
    let node = keys.into_iter().try_fold(document.root(), |node, key| node.get(key));
    node.and_then(|node| node.value().as_float().or(node.value().as_integer().map(|i| i as f64)))
        .unwrap_or(1.0)
}

/// The change that multiplies channels by factors.
pub(super) fn factors(
    document: &Document,
    sensor: &Instrument,
    text: &str,
    choices: usize,
    factors: &[(usize, f64)],
) -> Patch {
    let name = &sensor.info.name;
    let mut stretch = [0.0; MAX_CHANNELS];
    let mut settings = Vec::new();
    for (channel, factor) in factors {
        let of = sensor.info.channel(*channel);
        let whole = factor * present_factor(document, name, of);
        settings.push(format!(
            "{}={whole:?}",
            path(Kind::Sensor, name, &format!("samples.factor.{of}"))
        ));
        stretch[*channel] = factor.abs().ln();
    }
    let measures = sensor.info.purpose == Purpose::Measurement;
    let stretches: Channels<f64> =
        measures.then(|| (name.clone(), stretch)).into_iter().collect::<BTreeMap<_, _>>();
    Patch {
        stretches,
        choices: (choices as f64).ln(),
        ..Patch::new(format!("{name}: {text}"), settings)
    }
}
