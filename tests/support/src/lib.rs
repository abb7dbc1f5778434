//! Scaffolding that the tests of navfuse share: a small laboratory, a judge of runs, readers
//! written by others, needs that are absent, readings of recordings, damage and speed of files, and the
//! scenarios that ship.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "tests fail by panicking"
)]

pub mod absent;
pub mod damage;
pub mod judge;
pub mod lab;
#[cfg(feature = "plugins")]
mod model;
pub mod python;
pub mod recording;
pub mod rts;
#[cfg(feature = "plugins")]
mod shipped;
pub mod speed;
pub mod steps;

#[cfg(feature = "plugins")]
pub use model::ModelBench;
#[cfg(feature = "plugins")]
pub use shipped::{document, registry, scenario};
