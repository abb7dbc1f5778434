//! The context in which sources and sinks are opened.

use crate::compose::Composition;
use crate::document::did_you_mean;
use crate::model::sensor::SensorInfo;
use crate::model::stream::StreamError;
use crate::plugin::Shared;
use crate::units::sample::SensorId;
use std::path::PathBuf;

/// The context in which a source or sink is opened.
#[derive(Debug)]
#[non_exhaustive]
pub struct OpenContext<'a> {
    /// Composition that the source feeds or the sink records.
    pub composition: &'a Composition,
    /// The folder of the scenario, at which relative paths of inputs start.
    pub base: PathBuf,
    /// The output folder of the run, at which relative paths of outputs start.
    pub output: PathBuf,
    /// Names of the sensors that the scenario disables.
    pub disabled_sensors: Vec<String>,
    /// Number of sources of the scenario.
    pub sources: usize,
    /// Values that this run shares with others, in a campaign.
    pub shared: Option<Shared>,
}

impl<'a> OpenContext<'a> {
    /// The context of a scenario with one source, whose files are in a folder.
    pub fn new(composition: &'a Composition, base: PathBuf) -> Self {
        let output = base.clone();
        let disabled_sensors = Vec::new();
        Self { composition, base, output, disabled_sensors, sources: 1, shared: None }
    }

    /// Finds a sensor that a source names. `None` for a sensor that the scenario disables: such a
    /// sensor may keep the keys by which a source fills it.
    ///
    /// # Errors
    /// When the scenario has no such sensor. The message lists the sensors; the caller adds its key.
    pub fn sensor(&self, name: &str) -> Result<Option<(SensorId, &SensorInfo)>, StreamError> {
        if self.disabled_sensors.iter().any(|disabled| disabled == name) {
            return Ok(None);
        }
        let sensors = &self.composition.sensors;
        if let Some(index) = sensors.iter().position(|s| s.info.name == name) {
            return Ok(Some((SensorId(index), &sensors[index].info)));
        }
        let names: Vec<&str> = sensors.iter().map(|s| s.info.name.as_str()).collect();
        let near = did_you_mean(name, names.iter().copied())
            .map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        let list = names.join(", ");
        Err(StreamError::scenario(format!("there is no [sensor.{name}]{near} (sensors: {list})")))
    }
}
