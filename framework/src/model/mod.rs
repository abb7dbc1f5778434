//! Models: motion of blocks, measurements by sensors, and the inputs and outputs of a run.

pub mod chi_square;
pub mod delivery;
pub mod detector;
pub mod error;
pub mod estimator_error;
pub mod fault;
pub mod finding;
pub mod gate;
pub mod input;
pub mod limits;
pub mod measurement;
pub mod monitor;
pub mod motion;
pub mod mounting;
pub mod process;
mod process_error;
pub mod record;
pub mod robust;
pub mod roster;
pub mod screening;
pub mod sensor;
pub mod simulate;
pub mod start;
pub mod stream;
mod stream_error;
pub mod update_rule;
pub mod verdict;
