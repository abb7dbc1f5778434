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
mod long_way;
mod names;
mod navigation;
mod noise_free;
mod past;
mod ping;
mod polar;
mod pooled;
mod time_offset;

use navfuse_core::run::scenario::Assembly;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// Every sample of the assembly up to `to` seconds, in order of time.
fn samples(assembly: &mut Assembly, to: f64) -> Vec<Sample> {
    let mut all = Vec::new();
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while source.next(&mut sample).unwrap() && sample.time.seconds() < to {
            all.push(sample);
        }
    }
    all.sort_by_key(|s| s.time);
    all
}
