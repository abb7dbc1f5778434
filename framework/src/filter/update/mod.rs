//! The measurement update: linearisation, refinement, and its rules.

pub(super) mod correct;
pub(super) mod iterated;
pub(super) mod points;
pub(super) mod refine;
pub(super) mod unscented;
pub(super) mod work;
