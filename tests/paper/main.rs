//! What Pan & Wu (2016) say of their results in section 3, sentence by sentence, over several seeds. `docs/src/explanation/pan-wu.md`
//! shows the same as figures.
//!
//! Every run has its own noise and initial errors. The IMU runs at 20 Hz, which changes no sigma by 0.1 %. Sigmas do not depend
//! on chance but for the linearisation, so their bounds hold for each seed; those of errors are root mean squares over the seeds.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../common/mod.rs"]
mod common;
mod filter;
mod observer;
mod runs;
