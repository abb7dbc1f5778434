//! The statements of Pan & Wu (2016) on their results in section 3, one by one, over several seeds.
//! `docs/src/explanation/pan-wu.md` shows the same as figures.
//!
//! Every run has its own noise and initial errors. The IMU runs at 20 Hz, which changes no sigma by
//! 0.1 %. Sigmas depend on chance only through the linearisation, so their bounds hold for each
//! seed. Bounds of errors are those of root mean squares over the seeds.

mod filter;
mod observer;
mod runs;
