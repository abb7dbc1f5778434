//! The laser Doppler velocimeter.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;
mod determined;
mod model;
mod scenarios;
mod simulation;
