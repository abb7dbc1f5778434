//! Axes of an instrument that are turned, mirrored or reversed.

use crate::causes::factors::factors;
use crate::patch::{Patch, path};
use crate::scene::Instrument;
use navfuse_core::document::Document;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::plugin::Kind;

/// An axis of the body: the axis of the instrument along it, and the sign.
type Axes = [(usize, f64); 3];

const NAMES: [&str; 3] = ["x", "y", "z"];

/// The axes of an instrument along those of the body.
const USUAL: Axes = [(0, 1.0), (1, 1.0), (2, 1.0)];

/// All right- and left-handed sets of axes.
fn all() -> Vec<Axes> {
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let signs = (0..8).map(|bits| [0, 1, 2].map(|k| if bits >> k & 1 == 1 { -1.0 } else { 1.0 }));
    signs
        .flat_map(|signs| orders.map(|order| std::array::from_fn(|k| (order[k], signs[k]))))
        .collect()
}

/// The axes that a scenario states for a sensor.
fn stated(document: &Document, sensor: &str) -> Option<Axes> {
    let keys = [Kind::Sensor.table(), sensor, "samples", "axes"];
    let node = keys.into_iter().try_fold(document.root(), |node, key| node.get(key))?;
    let list: [String; 3] = node.parse::<Vec<String>>().ok()?.try_into().ok()?;
    let axes = list.map(|axis| {
        let (sign, name) = axis.strip_prefix('-').map_or((1.0, &*axis), |name| (-1.0, name));
        NAMES.iter().position(|of| *of == name).map(|k| (k, sign))
    });
    let [x, y, z] = axes;
    Some([x?, y?, z?])
}

/// True for a left-handed set: the sign of the permutation times those of its axes is negative.
fn left_handed(axes: &Axes) -> bool {
    let order = axes.map(|(k, _)| k);
    let odd = [[0, 2, 1], [2, 1, 0], [1, 0, 2]].contains(&order);
    axes.iter().map(|(_, sign)| sign).product::<f64>() * if odd { -1.0 } else { 1.0 } < 0.0
}

/// The directions in which the axes of the instrument point.
fn words(axes: &Axes) -> String {
    let ahead = ["forward", "right", "down"];
    let behind = ["back", "left", "up"];
    let direction = |axis: usize| {
        let along = axes.iter().position(|(k, _)| *k == axis).unwrap_or_default();
        if axes[along].1 > 0.0 { ahead[along] } else { behind[along] }
    };
    let hand = if left_handed(axes) { " (left-handed)" } else { "" };
    format!("axes {}, {}, {}{hand}", direction(0), direction(1), direction(2))
}

fn setting(name: &str, axes: &Axes) -> String {
    let axis =
        |(k, sign): (usize, f64)| format!("\"{}{}\"", if sign < 0.0 { "-" } else { "" }, NAMES[k]);
    let list = axes.map(axis).join(", ");
    format!("{}=[{list}]", path(Kind::Sensor, name, "samples.axes"))
}

/// The sets of axes that an instrument with vectors may have. A driving sensor whose left-handed axes
/// turn by the right-hand rule has rates of the opposite sign.
pub(super) fn turned(sensor: &Instrument, document: &Document) -> Vec<Patch> {
    let name = sensor.info.name.as_str();
    let ends = |end: &str| sensor.info.channels.iter().any(|c| c.name.ends_with(end));
    let mut sets = match (ends("_z"), ends("_d")) {
        (true, _) => all(),
        (_, true) => vec![
            USUAL,
            [(1, 1.0), (0, 1.0), (2, -1.0)],
            [(1, 1.0), (0, 1.0), (2, 1.0)],
            [(0, 1.0), (1, 1.0), (2, -1.0)],
        ],
        _ => return Vec::new(),
    };
    let present = stated(document, name).unwrap_or(USUAL);
    sets.retain(|axes| *axes != present);
    let choices = (sets.len() as f64).ln();
    let patch = |axes: &Axes| {
        let text = match ends("_z") {
            true => words(axes),
            false => {
                format!("velocity as {}", setting("", axes).split_once('=').map_or("", |s| s.1))
            }
        };
        Patch { choices, ..Patch::new(format!("{name}: {text}"), vec![setting(name, axes)]) }
    };
    let mut all: Vec<Patch> = sets.iter().map(patch).collect();
    if sensor.info.purpose == Purpose::Input {
        let rates: Vec<(usize, f64)> = (0..sensor.info.channels.len())
            .filter(|k| {
                let name = sensor.info.channel(*k);
                name.starts_with("gyro") || name.starts_with("dtheta")
            })
            .map(|k| (k, -1.0))
            .collect();
        let reversed = factors(document, sensor, "rates reversed", sets.len(), &rates);
        let left = sets.iter().filter(|axes| left_handed(axes)).map(patch);
        all.extend(left.map(|axes| axes.with(&reversed)));
        all.push(reversed);
    }
    all
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn there_are_24_turns_and_24_left_handed_sets() {
        let sets = all();
        assert_eq!(sets.iter().filter(|axes| left_handed(axes)).count(), 24);
        assert_eq!(sets.len(), 48);
    }

    #[test]
    fn axes_that_a_scenario_states_are_known() {
        let text =
            "sensor.imu.samples.axes = [\"y\", \"x\", \"-z\"]\nsensor.dvl.samples.axes = [\"y\"]";
        let document = Document::parse("s.toml", text).unwrap();
        assert_eq!(stated(&document, "imu"), Some([(1, 1.0), (0, 1.0), (2, -1.0)]));
        assert_eq!(stated(&document, "dvl"), None);
        assert_eq!(stated(&document, "depth"), None);
    }

    #[test]
    fn axes_are_described_by_their_directions() {
        let rfu = [(1, 1.0), (0, 1.0), (2, -1.0)];
        assert_eq!(words(&rfu), "axes right, forward, up");
        assert_eq!(setting("imu", &rfu), "sensor.imu.samples.axes=[\"y\", \"x\", \"-z\"]");
    }
}
