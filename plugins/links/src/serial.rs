//! Serial ports, by the crate `serialport`: it knows the ports of Linux, macOS and Windows, and reads
//! with a time limit, which is all that a thread of its own needs.

use crate::config::{DvlFormat, Format, NmeaFormat, TimeOfSample};
use crate::port::PATIENCE;
use crate::ports::lasting;
use navfuse_core::model::stream::{Feed, StreamError};
use navfuse_core::plugin::{LinkType, OpenContext};
use navfuse_frames::TimeConfig;
use navfuse_vehicle_logs::ConnectedUnit;
use schemars::JsonSchema;
use serde::Deserialize;
use serialport::SerialPort;
use std::io::{self, Read};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Reads a serial port, with 8 data bits, no parity and one stop bit, and opens it again whenever the
/// cable is pulled out. Without `nmea`, `dvl` or `unit` the bytes are sentences of samples.
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
    /// The bytes are messages of an autopilot (MAVLink), an inertial unit or a receiver.
    pub unit: Option<ConnectedUnit>,
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
        let Self { device, baud, nmea, dvl, unit, time, clock, commands } = self;
        check_rate(baud)?;
        let name = format!("serial {device}");
        let open = move |_: &_| {
            Ok(Box::new(shared_port(&device, baud, PATIENCE)?) as Box<dyn Read + Send>)
        };
        lasting(
            name,
            Box::new(open),
            Format { nmea, dvl, unit, time, clock, commands },
            (false, context),
        )
    }
}

/// Checks the rate of a port.
///
/// # Errors
/// When it is zero.
pub fn check_rate(baud: u32) -> Result<(), StreamError> {
    let remedy = "give the rate of the instrument, such as 115200";
    match baud {
        0 => Err(StreamError::network("a port of 0 bit/s carries nothing".to_owned())
            .at_key("baud")
            .with_remedy(remedy)),
        _ => Ok(()),
    }
}

/// Opens a serial port for reading and writing, each of which waits for at most `patience`.
///
/// # Errors
/// If there is no such port, another program has it, or it cannot be set to the rate.
pub fn serial_port(device: &str, baud: u32, patience: Duration) -> io::Result<Box<dyn SerialPort>> {
    Ok(serialport::new(device, baud).timeout(patience).open()?)
}

/// The ports that this program has open, each for the link that reads it and the sink that writes it: the
/// system lets nobody open a port twice.
static PORTS: Mutex<Vec<(String, Box<dyn SerialPort>)>> = Mutex::new(Vec::new());

/// Opens a serial port, or shares the one that a link or a sink of this program has open.
///
/// # Errors
/// As [`serial_port`].
pub fn shared_port(device: &str, baud: u32, patience: Duration) -> io::Result<Box<dyn SerialPort>> {
    // a list is a list, whatever happened to a thread that held it
    let mut ports = PORTS.lock().unwrap_or_else(PoisonError::into_inner);
    let known = ports.iter().position(|(name, _)| name == device);
    if let Some(known) = known {
        // a port that is gone, such as one that was unplugged, answers nothing
        if ports[known].1.bytes_to_read().is_ok()
            && let Ok(mut port) = ports[known].1.try_clone()
        {
            port.set_timeout(patience)?;
            return Ok(port);
        }
        ports.swap_remove(known);
    }
    let port = serial_port(device, baud, patience)?;
    ports.push((device.to_owned(), port.try_clone()?));
    Ok(port)
}
