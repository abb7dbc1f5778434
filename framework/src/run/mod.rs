//! Running a scenario: from a document to its result.

pub mod background;
mod building;
mod converted;
mod delayed;
mod inputs;
mod merge;
mod mistakes;
mod parts;
mod placing;
mod rules;
pub mod runner;
pub mod scenario;
pub mod schema;
mod sinks;
