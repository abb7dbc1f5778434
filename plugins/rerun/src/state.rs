//! The blocks of the state over time: estimate, truth, error and bounds of each component.

use crate::columns::{Range, Series};
use crate::recording::Recording;
use crate::style::{FILTERED, TRUTH, axis, label, path};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::manifold::{MAX_TANGENT, Reading};
use navfuse_core::state::{Block, Layout};

/// One component of a block.
pub struct Component {
    /// Name and unit: `roll [deg]`.
    pub label: String,
    /// Name and unit of the error: `roll error [deg]`.
    pub error_label: String,
    /// The estimate with its bounds.
    pub estimate: Series,
    /// The filter's own estimate with its bounds, in a run that is smoothed.
    pub filtered: Series,
    /// Set once the filter's own estimate was recorded.
    pub smoothed: bool,
    /// The truth.
    pub truth: Series,
    /// The error, with the bounds about zero.
    pub error: Series,
    /// The range of estimate and truth.
    pub range: Range,
    /// The range of the error.
    pub error_range: Range,
}

/// The series of one block that has an uncertainty.
pub struct BlockSeries {
    slot: usize,
    /// The process or sensor that the block belongs to.
    pub owner: String,
    /// The name of the block below its owner.
    pub name: String,
    /// The components of the block.
    pub components: Vec<Component>,
    /// Set where the truth is a constant of the scenario.
    pub constant: bool,
    /// Set once a truth was recorded.
    pub known: bool,
    /// The first estimate: a position is shown in metres from there.
    origin: Option<Vec<f64>>,
}

/// The blocks of a layout, without the fixed ones: those neither change nor have an uncertainty.
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
            let filtered = format!("filter {label}");
            Component {
                filtered: Series::bounded(entity("filtered"), filtered, FILTERED, 1.4)
                    .broken_at(half_turn),
                estimate: Series::bounded(entity("estimate"), label.clone(), axis(k), 2.8)
                    .broken_at(half_turn),
                truth: Series::lines(entity("truth"), &[truth]).broken_at(half_turn),
                error: Series::bounded(entity("error"), error_label.clone(), axis(k), 2.8),
                range: Range::default(),
                error_range: Range::default(),
                smoothed: false,
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

    /// Computes what is shown of a block: its reading, and of a position the metres from the first.
    fn show(&mut self, block: &Block, values: &[f64], out: &mut [f64]) {
        let n = block.operations.tangent;
        let origin = self.origin.get_or_insert_with(|| values[block.range()].to_vec());
        match block.operations.reading {
            Reading::Tangent => {
                (block.operations.local)(&values[block.range()], origin, &mut out[..n]);
                out[..n].iter_mut().for_each(|x| *x /= block.spec.display.scale);
            }
            _ => block.show(values, out),
        }
    }

    /// Adds the filter's own estimate in a run that is smoothed.
    pub fn filtered(
        &mut self,
        recording: &Recording,
        epoch: &Epoch<'_>,
    ) -> Result<(), StreamError> {
        let block = &epoch.layout.blocks[self.slot];
        let (mut shown, mut sigma) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        self.show(block, &epoch.state.values, &mut shown);
        block.show_sigma(&epoch.state.values, epoch.covariance, &mut sigma);
        for (k, c) in self.components.iter_mut().enumerate() {
            let (x, s) = (shown[k], 3.0 * sigma[k]);
            c.smoothed = true;
            c.filtered.push(recording, epoch.state.time, &[x, x + s, x - s])?;
        }
        Ok(())
    }

    /// Adds an estimate and, where it is known, the truth.
    pub fn epoch(&mut self, recording: &Recording, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let block = &epoch.layout.blocks[self.slot];
        let values = &epoch.state.values;
        let (mut shown, mut sigma) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        let (mut truth, mut error) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        self.show(block, values, &mut shown);
        block.show_sigma(values, epoch.covariance, &mut sigma);
        let true_state = epoch.truth.filter(|t| t.known[self.slot]).map(|t| &t.state.values);
        if let Some(true_values) = true_state {
            self.known = true;
            self.show(block, true_values, &mut truth);
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

    /// All series of the block.
    pub fn series(&mut self) -> impl Iterator<Item = &mut Series> {
        self.components
            .iter_mut()
            .flat_map(|c| [&mut c.estimate, &mut c.filtered, &mut c.truth, &mut c.error])
    }
}
