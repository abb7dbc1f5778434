//! The recording and the scenario that are looked at.

use crate::recording::Recording;
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::model::sensor::{Role, Sensor, SensorInfo};
use navfuse_core::plugin::Registry;

/// A sensor of the scenario.
pub(crate) struct Instrument {
    pub info: SensorInfo,
    /// Number of channels that it measures or drives by.
    pub used: usize,
    /// Set if no source has samples of it.
    pub constraint: bool,
}

/// What a scenario has that may be wrong.
pub(crate) struct Scene<'a> {
    pub registry: &'a Registry,
    pub document: &'a Document,
    pub recording: &'a Recording,
    pub sensors: Vec<Instrument>,
    /// Names and types of the processes.
    pub processes: Vec<(String, String)>,
}

impl<'a> Scene<'a> {
    pub fn new(
        registry: &'a Registry,
        document: &'a Document,
        composition: &Composition,
        recording: &'a Recording,
    ) -> Self {
        let instrument = |sensor: &Sensor| Instrument {
            info: sensor.info.clone(),
            used: match &sensor.role {
                Role::Measurement(model) => model.channels(),
                Role::Input(_) | Role::Reference(_) => sensor.info.channels.len(),
            },
            constraint: sensor.constraint,
        };
        let processes = composition.processes.iter();
        Self {
            registry,
            document,
            recording,
            sensors: composition.sensors.iter().map(instrument).collect(),
            processes: processes.map(|p| (p.name.clone(), p.kind.clone())).collect(),
        }
    }
}
