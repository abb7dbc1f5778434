//! Sensors and scenarios that navfuse ships, without file formats and viewer.

use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use std::path::Path;

/// Registry of all sensors, processes and the simulation.
pub fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_doppler::LaserDopplerPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_odometer::OdometerPlugin)
        .add(&navfuse_relative_pose::RelativePosePlugin)
        .add(&navfuse_constraints::ConstraintsPlugin)
        .add(&navfuse_heading::HeadingPlugin)
        .add(&navfuse_dead_reckoning::DeadReckoningPlugin)
        .add(&navfuse_acoustic::AcousticPlugin)
        .add(&navfuse_terrain::TerrainPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    registry
}

/// Passes a scenario with settings, each `key.path=value`, to a function.
pub fn scenario<T>(text: &str, settings: &[&str], then: impl FnOnce(&Scenario<'_>) -> T) -> T {
    let registry = registry();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("test.toml", text).unwrap_or_else(|e| panic!("{e}"));
    then(&Scenario::new(&registry, document, &settings).unwrap_or_else(|e| panic!("{e}")))
}

/// Shipped scenario of that file name, such as `pan-wu-3d.toml`.
pub fn document(name: &str) -> Document {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios").join(name);
    Document::from_file(&path).unwrap_or_else(|e| panic!("{e}"))
}
