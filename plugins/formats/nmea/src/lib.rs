//! NMEA 0183: recordings of sentences as samples of GNSS, heading, depth and reference.
//!
//! The source type `nmea` is for scenarios. A program of its own reads the sentences of any stream
//! with [`parse`]:
//!
//! ```
//! use navfuse_frames::{Frames, Sentences};
//! use navfuse_nmea::{Sentence, parse};
//! let bytes = &b"noise$HEHDT,123.4,T*2B\r\n"[..];
//! let mut frames = Frames::new(bytes, Sentences::NMEA);
//! while let Some(frame) = frames.next()? {
//!     let sentence = parse(Sentences::NMEA.content(frame.bytes));
//!     assert_eq!(sentence, Some(Sentence::Heading(123.4_f64.to_radians())));
//! }
//! assert_eq!(frames.damage().bytes(), 5);
//! # Ok::<(), std::io::Error>(())
//! ```

mod beacon;
mod config;
mod connected;
mod epoch;
mod receiver;
mod sentence;
mod source;
mod target;
mod vessel;
pub mod writing;

pub use beacon::Beacon;
pub use config::Nmea;
pub use navfuse_frames::ChecksumUse;
pub use sentence::{Sentence, parse};
pub use vessel::Axes;

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the source type `nmea`.
#[derive(Clone, Copy, Debug)]
pub struct NmeaPlugin;

impl Plugin for NmeaPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<Nmea>();
    }

    navfuse_core::named_after_crate!();
}
