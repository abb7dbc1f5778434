//! Terrain navigation: an altimeter over a bottom that a map knows.
//!
//! - [`Terrain`]: the sensor, a range along one beam.
//! - [`Grid`]: the map, heights on a grid of latitude and longitude, read from GeoTIFF or ESRI ASCII.

mod geotiff;
mod grid;
mod sensor;

pub use grid::Grid;
pub use sensor::Terrain;

use navfuse_core::plugin::{Need, Plugin, Registry};

/// Registers the sensor type `terrain`.
#[derive(Clone, Copy, Debug)]
pub struct TerrainPlugin;

impl Plugin for TerrainPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Terrain>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
