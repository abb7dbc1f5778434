//! The blocks of the state over time: estimate, truth, error and bounds of each component.

use crate::columns::{Range, Series};
use crate::recording::Recording;
use crate::style::{TRUTH, axis, label, path};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::manifold::{MAX_TANGENT, Reading};
use navfuse_core::state::{Block, Layout};

/// One component of a block.
pub struct Component {
    /// Name and unit: `roll [deg]`.
    pub label: String,
    /// The same of the error: `roll error [deg]`.
    pub error_label: String,
    /// Estimate with its bounds.
    pub estimate: Series,
    /// Truth.
    pub truth: Series,
    /// Error with the bounds about zero.
    pub error: Series,
    /// Of estimate and truth.
    pub range: Range,
    /// Of the error.
    pub error_range: Range,
}

/// One block that has an uncertainty.
pub struct BlockSeries {
    slot: usize,
    /// The process or sensor that it belongs to.
    pub owner: String,
    /// Its name below the owner.
    pub name: String,
    /// Its components.
    pub components: Vec<Component>,
    /// Whether the truth is a constant of the scenario.
    pub constant: bool,
    /// Whether the truth was ever known.
    pub known: bool,
    /// A position is shown in metres from here, its first estimate.
    origin: Option<Vec<f64>>,
}

/// The blocks of a layout, without those that are held fixed: they do not change and have no uncertainty.
pub fn blocks(layout: &Layout) -> Vec<BlockSeries> {
    let free = layout.blocks.iter().enumerate().filter(|(_, b)| b.tangent.is_some());
    free.map(|(slot, block)| BlockSeries::new(slot, block)).collect()
}

impl BlockSeries {
    fn new(slot: usize, block: &Block) -> Self {
        let (owner, name) = block.name.split_once('.').unwrap_or(("", &block.name));
        let unit = block.spec.display.unit;
        let half_turn = match block.operations.reading {
            Reading::Angles => std::f64::consts::PI / block.spec.display.scale,
            _ => f64::INFINITY,
        };
        let names = match block.operations.reading {
            Reading::Tangent => &["north", "east", "down"],
            _ => block.spec.display.components,
        };
        let component = |k: usize| {
            let name_of = names.get(k).map_or_else(|| k.to_string(), |n| (*n).to_owned());
            let entity = |leaf| path(&["state", owner, name, &name_of, leaf]);
            let error_label = label(&format!("{name_of} error"), unit);
            let label = label(&name_of, unit);
            let truth = (format!("true {label}"), TRUTH, 1.8);
            Component {
                estimate: Series::bounded(entity("estimate"), label.clone(), axis(k), 2.8)
                    .broken_at(half_turn),
                truth: Series::lines(entity("truth"), &[truth]).broken_at(half_turn),
                error: Series::bounded(entity("error"), error_label.clone(), axis(k), 2.8),
                range: Range::default(),
                error_range: Range::default(),
                label,
                error_label,
            }
        };
        Self {
            slot,
            owner: owner.to_owned(),
            name: name.to_owned(),
            components: (0..block.operations.tangent).map(component).collect(),
            constant: block.spec.truth.is_some(),
            known: false,
            origin: None,
        }
    }

    /// Adds an estimate.
    pub fn epoch(&mut self, recording: &Recording, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let block = &epoch.layout.blocks[self.slot];
        let n = block.operations.tangent;
        let values = &epoch.state.values;
        let (mut shown, mut sigma) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        let (mut truth, mut error) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        let origin = self.origin.get_or_insert_with(|| values[block.range()].to_vec());
        let show = |values: &[f64], out: &mut [f64]| match block.operations.reading {
            Reading::Tangent => {
                (block.operations.local)(&values[block.range()], origin, &mut out[..n]);
                out[..n].iter_mut().for_each(|x| *x /= block.spec.display.scale);
            }
            _ => block.show(values, out),
        };
        show(values, &mut shown);
        block.show_sigma(values, epoch.covariance, &mut sigma);
        let true_state = epoch.truth.filter(|t| t.known[self.slot]).map(|t| &t.state.values);
        if let Some(true_values) = true_state {
            self.known = true;
            show(true_values, &mut truth);
            block.show_error(values, true_values, &mut error);
        }
        let time = epoch.state.time;
        for (k, c) in self.components.iter_mut().enumerate() {
            let (x, s) = (shown[k], 3.0 * sigma[k]);
            c.estimate.push(recording, time, &[x, x + s, x - s])?;
            c.range.include(x);
            c.range.bound(x - s, x + s);
            if true_state.is_some() {
                c.truth.push(recording, time, &truth[k..=k])?;
                c.error.push(recording, time, &[error[k], s, -s])?;
                c.range.include(truth[k]);
                c.error_range.include(error[k]);
                c.error_range.bound(-s, s);
            }
        }
        Ok(())
    }

    /// Its series.
    pub fn series(&mut self) -> impl Iterator<Item = &mut Series> {
        self.components.iter_mut().flat_map(|c| [&mut c.estimate, &mut c.truth, &mut c.error])
    }
}
