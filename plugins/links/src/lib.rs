//! Links: samples that arrive over UDP, TCP, serial ports and standard input while a vehicle moves,
//! and estimates that leave over UDP or a serial port, as JSON, NMEA 0183 or MAVLink.
//!
//! A link reads one stream of bytes for all sensors that it feeds, on a thread of its own. Its
//! format is that of NMEA 0183, of a Doppler velocity log, of an autopilot, an inertial unit or a receiver,
//! or [sentences](Sentence) of samples. A port that is lost is opened again.

mod blend;
mod config;
mod datagrams;
mod feed;
mod instrument;
mod mavlink;
mod port;
mod ports;
mod samples;
mod sentence;
mod serial;
mod sink;
mod way;

pub use blend::Blend;
pub use config::{DvlFormat, Format, NmeaFormat, TimeOfSample, unix_time};
pub use feed::PortFeed;
pub use instrument::{write_fix, write_water_linked};
pub use mavlink::{Autopilot, MavlinkFormat, MavlinkMessage};
pub use port::{Remark, is_worth_a_report};
pub use ports::{StandardInput, Tcp, Udp};
pub use sentence::{Sentence, write_sentence};
pub use serial::{Serial, serial_port};
pub use sink::{EstimateFormat, Known, Motion, SerialSink, UdpSink};

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the link types `udp`, `tcp`, `serial` and `stdin`, and the sink types `udp` and `serial`.
#[derive(Clone, Copy, Debug)]
pub struct LinksPlugin;

impl Plugin for LinksPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.link::<Udp>();
        registry.link::<Tcp>();
        registry.link::<Serial>();
        registry.link::<StandardInput>();
        registry.sink::<UdpSink>();
        registry.sink::<SerialSink>();
    }

    navfuse_core::named_after_crate!();
}
