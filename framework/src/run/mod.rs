//! Running a scenario: from a document to its result.

pub mod runner;
pub mod scenario;
pub mod schema;
pub mod summary;
