//! The command as a user calls it, and the library as a program does, on shipped scenarios.
#![allow(
    missing_docs,
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod alignment;
mod bad_input;
mod bound;
mod calibrate;
mod campaign;
mod command;
#[path = "../common/mod.rs"]
mod common;
mod consistency;
mod detection;
mod diagnose;
mod diagnose_driving;
mod diagnose_recorded;
mod export;
mod gallery;
mod import;
mod import_layouts;
mod live;
mod many_sensors;
mod nothing_lost;
mod observability;
mod pan_wu;
mod paper;
mod parked;
mod report;
mod sample_recording;
mod scenario_reference;
mod sensitivity;
mod slurm;
mod smoothing;
mod snapir;
mod survey;
mod systems;
mod terminal;
mod time_offset;
mod wording;
