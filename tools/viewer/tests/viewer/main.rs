//! Recordings of runs and figures hold what they should, and the real viewer shows them.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test ends where it fails"
)]

#[path = "../../../../plugins/viewer/tests/common/mod.rs"]
mod common;
mod driver;
mod figures;
mod run;
