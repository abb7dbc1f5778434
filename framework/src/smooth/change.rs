//! Changes of the estimates by further passes.

use crate::state::Layout;
use crate::units::time::Time;
use serde::Serialize;

/// Passes over a smoothed run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Passes {
    /// Number of passes.
    pub count: u32,
    /// Largest change of a component by each pass after the first, in its smoothed sigma.
    pub changes: Vec<f64>,
    /// `true` if the last pass changed no component by more than 0.001 sigma.
    pub converged: bool,
    /// Result in words.
    pub text: String,
}

/// Largest change of an estimate by a pass.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Change {
    /// In the smoothed sigma.
    pub(super) size: f64,
    /// Error state, and time.
    pub(super) component: usize,
    pub(super) time: Time,
}

impl Change {
    /// Takes the change of a component at a time.
    pub(super) fn take(&mut self, size: f64, component: usize, time: Time) {
        // a value that is not a number counts as the largest
        if size > self.size || size.is_nan() {
            *self = Self { size, component, time };
        }
    }

    /// The change in words.
    pub(super) fn words(&self, layout: &Layout) -> String {
        let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&self.component));
        let name = block.map_or("", |block| &block.name);
        format!("{name} by {:.2e} sigma at {}", self.size, self.time)
    }
}
