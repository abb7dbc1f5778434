//! Shared by the tests: recordings of the repository's scenarios.
#![allow(dead_code, reason = "every test file uses a part of it")]

use navfuse_calibration::{AttitudeSource, CalibrationData};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_segments::Recording;
use rayon::prelude::*;
use std::path::Path;

pub fn read(name: &str, settings: &[&str]) -> Recording {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios").join(format!("{name}.toml"));
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    let scenario = Scenario::new(&registry, Document::from_file(path).unwrap(), &settings).unwrap();
    Recording::read(&scenario).unwrap_or_else(|e| panic!("{e}"))
}

pub fn data(name: &str, settings: &[&str]) -> CalibrationData {
    CalibrationData::new(read(name, settings), AttitudeSource::Gyros)
        .unwrap_or_else(|e| panic!("{e}"))
}

/// Runs `job` for seeds 1 to `count` on all cores.
pub fn seeds<T: Send>(count: u64, job: impl Fn(u64) -> T + Sync + Send) -> Vec<T> {
    (1..=count).into_par_iter().map(job).collect()
}
