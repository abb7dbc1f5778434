//! Work space of an update.

use super::points::SigmaPoints;
use super::refine::Refinement;
use crate::state::covariance::Update;
use crate::units::sample::MAX_CHANNELS;

/// Work space of an update, allocated once.
pub(in crate::filter) struct Work {
    pub(in crate::filter) update: Update,
    pub(in crate::filter) refinement: Refinement,
    pub(in crate::filter) points: SigmaPoints,
    /// A Cholesky factor.
    pub(in crate::filter) lower: Vec<f64>,
}

impl Work {
    pub(in crate::filter) fn new(n: usize) -> Self {
        Self {
            update: Update::with_capacity(n, MAX_CHANNELS),
            refinement: Refinement::default(),
            points: SigmaPoints::default(),
            lower: Vec::with_capacity(MAX_CHANNELS * MAX_CHANNELS),
        }
    }
}
