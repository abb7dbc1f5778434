//! What the tests share: recordings of the scenarios of the repository.
#![allow(dead_code, reason = "every test file uses a part of it")]

use navfuse_calibration::{AttitudeSource, Data};
use navfuse_core::document::Document;
use navfuse_core::registry::Registry;
use navfuse_core::scenario::Scenario;
use navfuse_segments::Recording;
use std::path::Path;

pub fn read(name: &str, settings: &[&str]) -> Recording {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios").join(format!("{name}.toml"));
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_dvl::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    let scenario = Scenario::new(&registry, Document::from_file(path).unwrap(), &settings).unwrap();
    Recording::read(&scenario).unwrap_or_else(|e| panic!("{e}"))
}

pub fn data(name: &str, settings: &[&str]) -> Data {
    Data::new(read(name, settings), AttitudeSource::Gyros).unwrap_or_else(|e| panic!("{e}"))
}

/// Runs `job` for seeds 1 to `count` on all cores.
pub fn seeds<T: Send>(count: u64, job: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    std::thread::scope(|scope| {
        let job = &job;
        let workers: Vec<_> = (0..cores)
            .map(|c| scope.spawn(move || (c + 1..=count).step_by(cores as usize).map(|s| (s, job(s))).collect()))
            .collect();
        let mut all: Vec<(u64, T)> =
            workers.into_iter().flat_map(|w| w.join().unwrap_or_else(|_: _| Vec::new())).collect();
        all.sort_by_key(|a| a.0);
        all.into_iter().map(|a| a.1).collect()
    })
}
