//! Doppler velocity logs, by axes and by beams, over the bottom and through the water.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod beams;
mod common;
mod noise;
mod profile;
mod sound;
mod water;
