//! The parameters of the source.

use navfuse_frames::TimeConfig;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// Reads a recording of NMEA 0183 sentences: GGA, GST, RMC, VTG, ZDA, HDT, THS, DPT, PASHR, PSXN,
/// PRVAT.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Nmea {
    /// The file, absolute or relative to the folder of the scenario.
    pub file: PathBuf,
    /// Name of the sensor that receives position, velocity and their accuracy (GGA, RMC, VTG, GST).
    /// Default, where no sensor is named: the only sensor of type `gnss`.
    pub gnss: Option<String>,
    /// Name of the sensor that receives the true heading (HDT, THS). Default: none.
    pub heading: Option<String>,
    /// Name of the sensor that receives the depth (DPT, PRVAT). Default: none.
    pub depth: Option<String>,
    /// Name of the reference that receives position, velocity and attitude (GGA, RMC, VTG, PASHR,
    /// PSXN). Default: none.
    pub reference: Option<String>,
    /// Talker whose sentences are used, such as `GP`, where several devices write into one file.
    /// Default: all.
    pub talker: Option<String>,
    /// Uses positions of quality 6 to 8 (estimated, manual, simulated) too. Default: false for a
    /// sensor; a reference always uses them.
    #[serde(default)]
    pub estimated: bool,
    /// The clock of the recording.
    #[serde(default)]
    pub time: TimeConfig,
}
