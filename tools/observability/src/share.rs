//! The share of each sensor in the information about each state over time.

use crate::tracker::SensorShare;
use navfuse_core::units::thin::{Merge, Thin};
use navfuse_figures::{Axis, Curve, Figure, Look, Panel};
use std::ops::Range;

/// Largest number of times: shares are slow.
const ROWS: usize = 128;
/// Panels beside one another.
const COLUMNS: usize = 4;

/// The information of each sensor on each component up to some times.
#[derive(Clone, Debug)]
pub(crate) struct Bits(Thin<Row>);

impl Default for Bits {
    fn default() -> Self {
        Self(Thin::with_rows(ROWS))
    }
}

/// The information up to a time, s: the components of each sensor in turn, bits.
#[derive(Clone, Debug)]
struct Row(f64, Vec<f64>);

impl Merge for Row {
    fn merge(&mut self, next: Self) {
        *self = next;
    }
}

impl Bits {
    /// Adds the information up to a time, s.
    pub fn push(&mut self, time: f64, sensors: &[SensorShare]) {
        let bits = sensors.iter().flat_map(|sensor| sensor.bits.iter().copied()).collect();
        self.0.push(Row(time, bits));
    }
}

/// The shares in the information about a component, or about all of a block.
#[derive(Clone, Debug)]
pub struct StateShares {
    /// Name for display.
    pub title: String,
    /// Times, s, and the share of each sensor at each time, from 0 to 1.
    pub rows: Vec<(f64, Vec<f64>)>,
}

/// The share of each sensor in the information about each state over time: the information of all of its
/// samples so far, over that of all sensors.
#[derive(Clone, Debug, Default)]
pub struct Shares {
    /// Names of the sensors with used samples.
    pub sensors: Vec<String>,
    /// The states on which there is information.
    pub states: Vec<StateShares>,
}

impl Shares {
    /// The shares of groups of components, each with a title.
    pub(crate) fn new(
        bits: &Bits,
        sensors: &[SensorShare],
        groups: impl Iterator<Item = (String, Range<usize>)>,
    ) -> Self {
        let used: Vec<usize> = (0..sensors.len()).filter(|s| sensors[*s].used > 0).collect();
        let of = |group: &Range<usize>| {
            let row = |Row(time, bits): &Row| {
                let each = || {
                    let of = |s: &usize| &bits[s * (bits.len() / sensors.len())..][group.clone()];
                    used.iter().map(move |s| of(s).iter().sum::<f64>())
                };
                let sum: f64 = each().sum();
                (sum > 0.0).then(|| (*time, each().map(|bits| bits / sum).collect()))
            };
            bits.0.rows().iter().filter_map(row).collect::<Vec<_>>()
        };
        let states = groups.filter_map(|(title, group)| {
            let rows = of(&group);
            (!rows.is_empty()).then_some(StateShares { title, rows })
        });
        let states = states.collect();
        Self { sensors: used.iter().map(|s| sensors[*s].name.clone()).collect(), states }
    }

    /// Plots the shares, one panel for each state; `None` without any information.
    pub fn figure(&self) -> Option<Figure> {
        let panel = |state: &StateShares| {
            let curve = |(k, name): (usize, &String)| Curve {
                name: name.clone(),
                look: Look::Data(k),
                points: state.rows.iter().map(|(time, of)| [*time, of[k]]).collect(),
            };
            Panel {
                title: state.title.clone(),
                x: Axis::time(),
                y: Axis::linear("share of the information").within([0.0, 1.0]),
                curves: self.sensors.iter().enumerate().map(curve).collect(),
                bands: Vec::new(),
            }
        };
        let panels: Vec<Panel> = self.states.iter().map(panel).collect();
        (!panels.is_empty()).then(|| Figure {
            name: "information".into(),
            title: String::new(),
            columns: COLUMNS.min(panels.len()),
            panels,
        })
    }
}
