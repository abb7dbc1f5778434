//! The clock of a driving sensor, whose offset is no state of a filter.

use crate::causes::LAGS;
use crate::patch::{Clock, Patch, path};
use navfuse_core::document::Document;
use navfuse_core::plugin::Kind;

/// Smallest interval between clocks that are tried, s.
const FINEST: f64 = 0.002;

/// The clock put back and forward.
pub(super) fn shifted(name: &str, document: &Document) -> Vec<Patch> {
    let keys = [Kind::Sensor.table(), name, "samples", "clock"];
    if keys.into_iter().try_fold(document.root(), |node, key| node.get(key)).is_some() {
        return Vec::new();
    }
    let both = LAGS.into_iter().flat_map(|lag| [(lag, 0.4 * lag), (-lag, 0.4 * lag)]);
    both.map(|(shift, step)| at(name, shift, step)).collect()
}

/// Clocks about that of a change, a third of the interval apart; none where that is fine.
pub(crate) fn closer(patch: &Patch) -> Vec<Patch> {
    let Some(Clock { sensor, shift, step }) = &patch.clock else { return Vec::new() };
    let third = step / 3.0;
    let around = [-2.0, -1.0, 1.0, 2.0].map(|k| shift + k * third);
    let finer = around.map(|shift| at(sensor, shift, third));
    if third < FINEST { Vec::new() } else { finer.into() }
}

/// The clock put forward, where those at this distance are tried too.
fn at(name: &str, shift: f64, step: f64) -> Patch {
    let key = path(Kind::Sensor, name, "samples.clock");
    Patch {
        parameters: 1,
        clock: Some(Clock { sensor: name.to_owned(), shift, step }),
        ..Patch::new(
            format!("{name}: clock {shift:+.3} s"),
            vec![format!("{key}=\"{shift:.3} s\"")],
        )
    }
}
