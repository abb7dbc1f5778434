//! The framework through its public interface, with sensors and processes of the tests.
#![allow(
    missing_docs,
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod background;
mod calibration_modes;
mod checkpoint;
mod custom_manifold;
mod custom_process;
mod custom_sensor;
mod driving;
mod dynamic_sensor;
mod estimators;
mod examples;
mod field;
mod files;
mod health;
mod lockout;
mod manifolds;
mod mounting;
mod plugins;
mod relinearise;
mod runner;
mod samples;
mod session;
mod smoother;
mod transients;
mod update_rules;
