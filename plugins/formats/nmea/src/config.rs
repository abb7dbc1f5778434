//! The parameters of the source.

use navfuse_core::units::Angle;
use navfuse_frames::{ChecksumUse, TimeConfig};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// Reads a recording of NMEA 0183 sentences: GGA, GST, RMC, VTG, ZDA, HDT, THS, HDG, HDM, DPT,
/// PASHR, PSXN, PRVAT, PTNL GGK, PTSAG, PSONLLD, PSIMSSB.
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
    /// Name of the sensor that receives the magnetic heading (HDG, HDM). A sensor of type
    /// `magnetic-heading` receives it as it is and has a declination of its own; any other receives
    /// the true heading. Default: none.
    pub magnetic: Option<String>,
    /// Declination that makes a magnetic heading true, east positive. Default: the variation in
    /// HDG; a heading without one is left out.
    pub declination: Option<Angle>,
    /// Name of the sensor that receives the positions of an acoustic transponder (PTSAG, PSONLLD,
    /// PSIMSSB), such as one of type `gnss`. Default: none.
    pub usbl: Option<String>,
    /// Number or name of that transponder, such as `"1"`.
    pub beacon: Option<String>,
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
    /// Checksums: `check` (default), or `ignore` for a program that writes wrong checksums, or none.
    /// The sentences with a wrong one are counted.
    #[serde(default)]
    pub checksum: ChecksumUse,
    /// The clock of the recording.
    #[serde(default)]
    pub time: TimeConfig,
}
