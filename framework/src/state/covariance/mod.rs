//! The covariance of the error state: structured propagation and Joseph update.
//!
//! A process model changes few rows of the error state, each from few columns. The transition is
//! therefore a sparse pattern, found once, and one kernel, `y_i = sum_k a_ik x_k` over rows of `x`,
//! does all the work.

mod aligned;
mod back;
mod bands;
mod carried;
mod chain;
mod decay;
mod dense;
mod inputs;
mod kernel;
mod lanes;
mod matrix;
mod noise;
mod pool;
mod product;
mod rank;
mod reach;
mod transition;
mod update;

#[cfg(test)]
mod tests;

pub(crate) use back::{BackwardCorrection, BackwardStep, sandwich};
pub use dense::DenseSlot;
pub use inputs::InputSlot;
pub use matrix::{Covariance, standard_deviation};
pub(crate) use pool::Pool;
pub(crate) use product::{Closure, Product};
pub(crate) use reach::Reach;
pub use transition::{NoiseSlot, PhiDiagonal, PhiSlot, Transition};
pub use update::Update;
pub(crate) use update::{backward, cholesky, forward};
