//! Files as Doppler velocity logs write them.
//!
//! | format | instruments | content |
//! |---|---|---|
//! | `pd0` | Teledyne Workhorse, Navigator, Explorer, Pathfinder, Pioneer, Tasman; others with PD0 output | bottom and water track in beam, instrument, ship or Earth coordinates; depth |
//! | `pd4` | the same, as PD4 or PD5 | bottom and water track; depth (PD5) |
//! | `pd6` | the same | bottom and water track; depth |
//! | `ad2cp` | Nortek Signature, DVL 500 and 1000 | bottom track, water track of a DVL |
//! | `nortek-nmea` | Nortek DVL, Signature | bottom and water track |
//! | `water-linked-json`, `water-linked-serial` | Water Linked A50, A125 | bottom track |
//!
//! The source [`DvlFile`] gives the samples of a scenario's sensors. A [`Decoder`] gives the
//! [`Ping`]s of a file to any program:
//!
//! ```no_run
//! use navfuse_dvl_files::Format;
//! let mut pings = Format::Pd0.decoder(std::fs::File::open("dive.pd0")?);
//! while let Some(ping) = pings.next()? {
//!     println!("{:?} {:?}", ping.stamp, ping.bottom.and_then(|track| track.axes));
//! }
//! println!("{:?}", pings.damage().describe("ensemble"));
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! All velocities are turned to those of the vehicle along the instrument's axes forward, right,
//! down. Damaged bytes are skipped and reported with their offset and number; see
//! [`navfuse_frames`].

mod ad2cp;
mod bytes;
mod config;
mod format;
mod nortek;
mod pd0;
mod pd4;
mod pd6;
mod ping;
mod source;
mod target;
mod teledyne;
mod text;
mod water_linked;

pub use config::{AttitudeUse, DvlFile, Screen};
pub use format::Format;
pub use navfuse_frames::{Damage, Gap, Stamp, TimeConfig};
pub use ping::{Attitude, Coordinates, Decoder, Ping, TrackedVelocity};

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the source type `dvl-file`.
#[derive(Clone, Copy, Debug)]
pub struct DvlFilesPlugin;

impl Plugin for DvlFilesPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<DvlFile>();
    }

    navfuse_core::named_after_crate!();
}
