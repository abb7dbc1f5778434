//! Logs of autopilots and inertial units.
//!
//! | format | written by | content |
//! |---|---|---|
//! | `ulog` | PX4 | any topic, by the formats in the log itself |
//! | `tlog` | ground stations of MAVLink | inertial units, receivers, attitude, position, pressure, ranges |
//! | `novatel` | NovAtel SPAN, ASCII and binary | RAWIMU, INSPVA, BESTPOS and BESTVEL in their forms |
//! | `vectornav` | VectorNav, ASCII | VNYMR, VNIMU, VNGPS, VNINS |
//! | `sbet` | Applanix, `navfuse export` | a trajectory |
//! | `kf-gins` | KF-GINS, binary | increments of an inertial unit |
//! | `dataflash` | ArduPilot | any message, by the formats in the log itself |
//! | `ubx` | receivers of u-blox | NAV-PVT, ESF-MEAS |
//! | `sbf` | receivers of Septentrio | PVTGeodetic, AttEuler, ExtSensorMeas |
//! | `nucleus` | Nortek Nucleus | inertial unit, attitude, depth, bottom and water track |
//! | `psins` | PSINS, text | increments of an inertial unit |
//! | `sbg-ecom` | inertial units of SBG | inertial unit, receivers, velocity log, depth, solution |
//! | `vectornav-binary` | VectorNav, binary | inertial unit, receivers, solution |
//! | `mip` | MicroStrain | inertial unit, receivers, solution |
//! | `lcm` | programs with LCM | any message, by the definitions of its types |
//!
//! The source [`VehicleLog`] gives the samples of a scenario's sensors. A [`Decoder`] gives the
//! messages of a log to any program:
//!
//! ```no_run
//! use navfuse_vehicle_logs::{Format, Options};
//! let options = Options { topics: vec!["sensor_combined".to_owned()], ..Options::default() };
//! let mut log = Format::Ulog.decoder(std::fs::File::open("flight.ulg")?, &options);
//! let mut values = Vec::new();
//! while let Some(record) = log.next(&mut values)? {
//!     println!("{:?} {values:?}", record.stamp);
//! }
//! println!("{:?}", log.damage().describe("message"));
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! Damaged bytes are skipped and reported with their offset and number; see [`navfuse_frames`].

mod checksum;
mod config;
mod connected;
mod dataflash;
mod doubles;
mod format;
mod imc;
mod join;
mod known;
mod lcm;
mod mavlink;
mod mip;
mod novatel;
mod nucleus;
mod packed;
mod psins;
mod record;
mod sbg;
mod septentrio;
mod source;
mod target;
mod term;
mod text;
mod ublox;
mod ulog;
mod vectornav;
mod vectornav_binary;

pub use config::{FieldConfig, SensorConfig, StampUse, VehicleLog};
pub use connected::{ConnectedUnit, LiveFormat};
pub use format::Format;
pub use lcm::LcmTypes;
pub use record::{Decoder, Options, Record, Topic};

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the source type `vehicle-log`.
#[derive(Clone, Copy, Debug)]
pub struct VehicleLogsPlugin;

impl Plugin for VehicleLogsPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<VehicleLog>();
    }

    navfuse_core::named_after_crate!();
}
