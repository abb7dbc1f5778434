//! Serial ports, by the crate `serialport`: it knows the ports of Linux, macOS and Windows, and reads
//! with a time limit, which is all that a thread of its own needs.

use crate::config::{DvlFormat, Format, NmeaFormat, TimeOfSample};
use crate::port::PATIENCE;
use crate::ports::lasting;
use navfuse_core::model::stream::{Feed, StreamError};
use navfuse_core::plugin::{LinkType, OpenContext};
use navfuse_frames::TimeConfig;
use schemars::JsonSchema;
use serde::Deserialize;
use serialport::SerialPort;
use std::io::{self, Read};
use std::time::Duration;

/// Reads a serial port, with 8 data bits, no parity and one stop bit, and opens it again whenever the
/// cable is pulled out. Without `nmea` or `dvl` the bytes are sentences of samples.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Serial {
    /// The port, such as `/dev/ttyUSB0`, or `COM3` on Windows. A name in `/dev/serial/by-id` stays
    /// the same when the instruments are plugged in again in another order.
    pub device: String,
    /// Bits a second, such as 4800, 9600 or 115200.
    pub baud: u32,
    /// The bytes are sentences of NMEA 0183.
    pub nmea: Option<NmeaFormat>,
    /// The bytes are messages of a Doppler velocity log.
    pub dvl: Option<DvlFormat>,
    /// Time of a sample: `header`, its own stamp, or `arrival`. Default: `header`.
    #[serde(default)]
    pub time: TimeOfSample,
    /// The clock of the stamps.
    #[serde(default)]
    pub clock: TimeConfig,
    /// Obeys sentences with commands, such as a reset. Default: false.
    #[serde(default)]
    pub commands: bool,
}

impl LinkType for Serial {
    const TYPE: &'static str = "serial";

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError> {
        let Self { device, baud, nmea, dvl, time, clock, commands } = self;
        if baud == 0 {
            return Err(StreamError::network("a port of 0 bit/s carries nothing".to_owned())
                .at_key("baud")
                .with_remedy("give the rate of the instrument, such as 115200"));
        }
        let name = format!("serial {device}");
        let open = move |_: &_| {
            Ok(Box::new(serial_port(&device, baud, PATIENCE)?) as Box<dyn Read + Send>)
        };
        lasting(name, Box::new(open), Format { nmea, dvl, time, clock, commands }, (false, context))
    }
}

/// Opens a serial port for reading and writing, each of which waits for at most `patience`.
///
/// # Errors
/// If there is no such port, another program has it, or it cannot be set to the rate.
pub fn serial_port(device: &str, baud: u32, patience: Duration) -> io::Result<Box<dyn SerialPort>> {
    Ok(serialport::new(device, baud).timeout(patience).open()?)
}
