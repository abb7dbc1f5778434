//! Models: motion of blocks, measurements by sensors, and the inputs and outputs of a run.

pub mod chi_square;
pub mod error;
pub mod estimator_error;
pub mod process;
pub mod record;
pub mod sensor;
pub mod simulate;
pub mod stream;
