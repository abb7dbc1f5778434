//! Path of the estimates, and their errors against the reference.

use crate::model::record::Epoch;
use crate::state::Layout;
use crate::state::manifold::Position;
use crate::units::time::Time;
use serde::Serialize;
use std::any::TypeId;

/// Horizontal position error against the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HorizontalError {
    /// At the last reference, m.
    #[serde(rename = "final")]
    pub last: f64,
    /// Root mean square over all references, m.
    pub rms: f64,
    /// The last error in per cent of the path length of the reference; null for a path below 1 m.
    pub percent_of_distance: Option<f64>,
}

/// A block's estimate compared with the last reference.
#[derive(Clone, Debug)]
pub(crate) struct Compared {
    time: Time,
    /// Time since the comparison before, s.
    interval: f64,
    pub(crate) error: Vec<f64>,
    pub(crate) sigma: Vec<f64>,
}

impl Compared {
    /// True if the comparison is recent enough to hold at the end.
    pub(crate) fn holds_at(&self, end: Time) -> bool {
        end.since(self.time) <= (2.0 * self.interval).max(2.0)
    }
}

/// Estimates of a run compared with the reference.
#[derive(Debug)]
pub(crate) struct Track {
    position: Option<usize>,
    before: Option<Vec<f64>>,
    before_truth: Option<Vec<f64>>,
    distance: f64,
    true_distance: f64,
    errors: (u64, f64, f64),
    pub(crate) compared: Vec<Option<Compared>>,
}

impl Track {
    pub(crate) fn new(layout: &Layout) -> Self {
        let kind = TypeId::of::<Position>();
        Self {
            position: layout.blocks.iter().position(|b| b.operations.kind == kind),
            before: None,
            before_truth: None,
            distance: 0.0,
            true_distance: 0.0,
            errors: (0, 0.0, 0.0),
            compared: vec![None; layout.blocks.len()],
        }
    }

    pub(crate) fn epoch(&mut self, epoch: &Epoch<'_>) {
        if let Some(slot) = self.position {
            let block = &epoch.layout.blocks[slot];
            let step = |before: &mut Option<Vec<f64>>, now: &[f64]| {
                let mut d = [0.0; 3];
                if let Some(before) = before {
                    (block.operations.local)(now, before, &mut d);
                    before.copy_from_slice(now);
                } else {
                    *before = Some(now.to_vec());
                }
                d[0].hypot(d[1])
            };
            let now = &epoch.state.values[block.range()];
            self.distance += step(&mut self.before, now);
            if let Some(truth) = epoch.truth.filter(|t| t.known[slot]) {
                let true_now = &truth.state.values[block.range()];
                self.true_distance += step(&mut self.before_truth, true_now);
                let mut e = [0.0; 3];
                (block.operations.local)(now, true_now, &mut e);
                let (count, squares, _) = self.errors;
                let error = e[0].hypot(e[1]);
                self.errors = (count + 1, squares + error * error, error);
            }
        }
        if let Some(truth) = epoch.truth {
            for (slot, block) in
                epoch.layout.blocks.iter().enumerate().filter(|(slot, _)| truth.known[*slot])
            {
                let (time, n) = (epoch.state.time, block.operations.tangent);
                let compared = self.compared[slot].get_or_insert_with(|| Compared {
                    time,
                    interval: 0.0,
                    error: vec![0.0; n],
                    sigma: vec![0.0; n],
                });
                compared.interval = time.since(std::mem::replace(&mut compared.time, time));
                block.show_error(&epoch.state.values, &truth.state.values, &mut compared.error);
                block.show_sigma(&epoch.state.values, epoch.covariance, &mut compared.sigma);
            }
        }
    }

    /// Horizontal path length, m: of the reference, or of the estimate where no reference reaches
    /// the end.
    pub(crate) fn distance(&self, end: Time) -> f64 {
        let (count, ..) = self.errors;
        let position = self.position.and_then(|slot| self.compared[slot].as_ref());
        let to_the_end = count > 1 && position.is_some_and(|c| c.holds_at(end));
        if to_the_end { self.true_distance } else { self.distance }
    }

    pub(crate) fn horizontal_error(&self) -> Option<HorizontalError> {
        let (count, squares, last) = self.errors;
        (count > 0).then(|| HorizontalError {
            last,
            rms: (squares / count as f64).sqrt(),
            percent_of_distance: (self.true_distance >= 1.0)
                .then(|| 100.0 * last / self.true_distance),
        })
    }
}
