//! Whole compositions on simulated trajectories: drivers, aids, faults, past states.
#![allow(
    missing_docs,
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod aiding;
mod checkpoint;
mod drivers;
mod imu_faults;
mod kinematic;
mod late;
mod navigation;
mod noise_free;
mod past;
mod pooled;
mod time_offset;
