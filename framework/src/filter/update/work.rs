//! Work space of an update.

use super::points::SigmaPoints;
use super::refine::Refinement;
use super::rules::Rules;
use crate::compose::Composition;
use crate::state::covariance::Update;
use crate::units::sample::MAX_CHANNELS;

/// Work space of an update, allocated once.
pub(in crate::filter) struct Work {
    pub(in crate::filter) update: Update,
    /// All channels of a sample that is judged by groups.
    pub(super) whole: Update,
    pub(in crate::filter) refinement: Refinement,
    pub(super) rules: Rules,
    /// Points of the check of the curvature.
    pub(super) points: SigmaPoints,
    /// A Cholesky factor.
    pub(in crate::filter) lower: Vec<f64>,
}

impl Work {
    pub(in crate::filter) fn new(composition: &Composition) -> Self {
        Self {
            update: Update::with_capacity(composition.layout.tangent, MAX_CHANNELS),
            whole: Update::default(),
            refinement: Refinement::default(),
            rules: Rules::new(composition),
            points: SigmaPoints::default(),
            lower: Vec::with_capacity(MAX_CHANNELS * MAX_CHANNELS),
        }
    }
}
