//! Propagation: driving samples, inputs, the step of state and covariance.

pub(super) mod cadence;
pub(super) mod drivers;
pub(super) mod held;
pub(super) mod inputs;
pub(super) mod linear;
pub(super) mod passage;
pub(super) mod pooled;
