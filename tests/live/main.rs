//! Live runs from end to end: the command on samples that arrive over its links.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

#[path = "../common/mod.rs"]
mod common;
mod desk;
mod embedded;
mod faults;
mod mavlink;
mod restart;
mod sockets;
