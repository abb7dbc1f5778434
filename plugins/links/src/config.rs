//! The parameters that all links have: format and clock.

use crate::port::Remark;
use crate::samples::Samples;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::Angle;
use navfuse_dvl_files::{AttitudeUse, DvlFile, Screen};
use navfuse_frames::TimeConfig;
use navfuse_nmea::{ChecksumUse, Nmea};
use navfuse_vehicle_logs::ConnectedUnit;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::Read;
use std::path::PathBuf;
use std::sync::mpsc::Sender;
use std::time::{SystemTime, UNIX_EPOCH};

/// The time of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TimeOfSample {
    /// Its own time stamp.
    #[default]
    Header,
    /// The time at which it arrived, on the clock of this computer.
    Arrival,
}

/// The format of the bytes of a link. Without any of these tables, it is that of sentences of
/// samples.
#[derive(Clone, Debug, Default)]
pub struct Format {
    /// Sentences of NMEA 0183.
    pub nmea: Option<NmeaFormat>,
    /// Messages of a Doppler velocity log.
    pub dvl: Option<DvlFormat>,
    /// Messages of an autopilot, an inertial unit or a receiver.
    pub unit: Option<ConnectedUnit>,
    /// The time of a sample.
    pub time: TimeOfSample,
    /// The zero of the run's clock.
    pub clock: TimeConfig,
    /// Sentences with commands are obeyed.
    pub commands: bool,
}

/// Sentences of NMEA 0183, and the sensors that receive them: see the source of that name.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NmeaFormat {
    /// Name of the sensor that receives position, velocity and their accuracy. Default, where no
    /// sensor is named: the only sensor of type `gnss`.
    pub gnss: Option<String>,
    /// Name of the sensor that receives the true heading. Default: none.
    pub heading: Option<String>,
    /// Name of the sensor that receives the magnetic heading. Default: none.
    pub magnetic: Option<String>,
    /// Declination that makes a magnetic heading true, east positive. Default: the variation in
    /// HDG; a heading without one is left out.
    pub declination: Option<Angle>,
    /// Name of the sensor that receives the positions of an acoustic transponder. Default: none.
    pub usbl: Option<String>,
    /// Number or name of that transponder, such as `"1"`.
    pub beacon: Option<String>,
    /// Name of the sensor that receives the depth. Default: none.
    pub depth: Option<String>,
    /// Name of the reference that receives position, velocity and attitude. Default: none.
    pub reference: Option<String>,
    /// Talker whose sentences are used, such as `GP`. Default: all.
    pub talker: Option<String>,
    /// Uses positions of quality 6 to 8 (estimated, manual, simulated) too. Default: false.
    #[serde(default)]
    pub estimated: bool,
    /// Checksums: `check` (default), or `ignore` for a program that writes wrong ones, or none.
    #[serde(default)]
    pub checksum: ChecksumUse,
}

/// Messages of a Doppler velocity log, and the sensors that receive them: see the source
/// `dvl-file`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DvlFormat {
    /// Format of the messages.
    pub format: navfuse_dvl_files::Format,
    /// Name of the sensor that receives the velocity over the bottom. Default: the only sensor of
    /// type `dvl` or `dvl-beams`.
    pub bottom_track: Option<String>,
    /// Name of the sensor that receives the velocity through the water. Default: none.
    pub water_track: Option<String>,
    /// Name of the sensor that receives the depth of the transducer. Default: none.
    pub depth: Option<String>,
    /// Velocities in ship and Earth coordinates: `refuse` (default), or `file` to turn them back to
    /// the instrument's axes with the attitude in the message.
    #[serde(default)]
    pub attitude: AttitudeUse,
    /// Limits beyond which a velocity is not used.
    #[serde(default)]
    pub screen: Screen,
}

impl Format {
    /// The samples in the bytes of `reader`, the port of that name.
    pub(crate) fn samples(
        self,
        port: &str,
        reader: impl Read + Send + 'static,
        remarks: &Sender<Remark>,
        context: &OpenContext<'_>,
    ) -> Result<Box<dyn Source>, StreamError> {
        let (file, mut time) = (PathBuf::from(port), self.clock);
        if self.time == TimeOfSample::Arrival {
            time.arrival = Some(unix_time);
        }
        match (self.nmea, self.dvl, self.unit) {
            (None, None, None) => {
                let zero = time.zero().map_err(|e| e.at_key("clock"))?;
                let commands = self.commands.then(|| remarks.clone());
                Ok(Box::new(Samples::new(file, reader, zero, commands, context)))
            }
            _ if self.commands => Err(StreamError::scenario("commands are sentences of samples")
                .at_key("commands")
                .with_remedy("remove it, or add a link without `nmea`, `dvl` and `unit`")),
            (None, None, Some(unit)) => unit.connected(file, reader, (time, unix_time), context),
            (Some(n), None, None) => {
                let NmeaFormat { gnss, heading, magnetic, declination, usbl, beacon, .. } = n;
                let NmeaFormat { depth, reference, talker, estimated, checksum, .. } = n;
                let nmea = Nmea {
                    file,
                    gnss,
                    heading,
                    magnetic,
                    declination,
                    usbl,
                    beacon,
                    depth,
                    reference,
                    talker,
                    estimated,
                    checksum,
                    time,
                };
                nmea.connected(reader, context)
            }
            (None, Some(d), None) => {
                let dvl = DvlFile {
                    file,
                    format: Some(d.format),
                    bottom_track: d.bottom_track,
                    water_track: d.water_track,
                    depth: d.depth,
                    attitude: d.attitude,
                    time,
                    screen: d.screen,
                };
                dvl.connected(reader, context)
            }
            _ => Err(StreamError::scenario("a link has one format")
                .with_remedy("keep one of `nmea`, `dvl` and `unit`, or make two links")),
        }
    }
}

/// The clock of this computer, in nanoseconds since 1970.
pub fn unix_time() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
