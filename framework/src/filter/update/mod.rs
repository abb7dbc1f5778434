//! The measurement update: linearisation, refinement, and its rules.

pub(super) mod correct;
pub(super) mod iekf;
mod measure;
pub(super) mod points;
mod refine;
mod rules;
pub(super) mod ukf;
pub(super) mod work;
