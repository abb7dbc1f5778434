//! Running a scenario: from a document to its result.

pub mod background;
mod building;
mod delayed;
pub(crate) mod estimators;
mod inputs;
mod merge;
mod mistakes;
mod output_rate;
mod outputs;
mod parts;
mod rules;
pub mod runner;
pub mod scenario;
pub mod schema;
mod silence;
mod sinks;
pub mod summary;
mod track;
mod verdict;
