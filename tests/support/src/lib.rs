//! Scaffolding that the tests of navfuse share: a small laboratory, and the scenarios that ship.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "tests fail by panicking"
)]

pub mod lab;
pub mod rts;
#[cfg(feature = "plugins")]
mod shipped;

#[cfg(feature = "plugins")]
pub use shipped::{document, registry, scenario};
