//! Propagation: the pace of the driving sensors, and the step of state and covariance.

pub(super) mod cadence;
mod drivers;
mod held;
mod inputs;
mod linear;
pub(super) mod pace;
pub(super) mod passage;
mod pooled;
pub(super) mod propagation;
