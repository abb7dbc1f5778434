//! The samples of a vehicle or an inertial unit that is connected: one stream of bytes for all its sensors.

use crate::config::{SensorConfig, StampUse, VehicleLog};
use crate::format::Format;
use crate::mavlink::Tlog;
use crate::mip::Mip;
use crate::record::Decoder;
use crate::source::Stream;
use crate::target::targets;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::Sample;
use navfuse_frames::{ChecksumUse, TimeConfig};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::{BTreeMap, VecDeque};
use std::error::Error;
use std::io::{self, ErrorKind, Read};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes that are read at once.
const READ: usize = 4096;

/// The format of the messages of an instrument that is connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum LiveFormat {
    /// MAVLink, versions 1 and 2, as an autopilot sends it.
    Mavlink,
    /// Nortek Nucleus.
    Nucleus,
    /// UBX of u-blox.
    Ubx,
    /// SBF of Septentrio.
    Sbf,
    /// NovAtel, ASCII and binary.
    Novatel,
    /// SBG (sbgECom).
    SbgEcom,
    /// Binary messages of VectorNav units.
    VectornavBinary,
    /// MIP of MicroStrain, by GPS time.
    Mip,
}

impl LiveFormat {
    /// All formats.
    pub const ALL: [Self; 8] = [
        Self::Mavlink,
        Self::Nucleus,
        Self::Ubx,
        Self::Sbf,
        Self::Novatel,
        Self::SbgEcom,
        Self::VectornavBinary,
        Self::Mip,
    ];

    /// The format of a log of the same messages.
    pub fn log(self) -> Format {
        match self {
            Self::Mavlink => Format::Tlog,
            Self::Nucleus => Format::Nucleus,
            Self::Ubx => Format::Ubx,
            Self::Sbf => Format::Sbf,
            Self::Novatel => Format::Novatel,
            Self::SbgEcom => Format::SbgEcom,
            Self::VectornavBinary => Format::VectornavBinary,
            Self::Mip => Format::Mip,
        }
    }
}

/// Messages of an autopilot, an inertial unit or a receiver, and the sensors that receive them: see the
/// source `vehicle-log`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConnectedUnit {
    /// Format of the messages.
    pub format: LiveFormat,
    /// Message of each sensor, by the name of the sensor.
    pub sensors: BTreeMap<String, SensorConfig>,
    /// Times of MAVLink: `message` (default), the time in a message, or `received`, the time at which it
    /// was received.
    #[serde(default)]
    pub stamp: StampUse,
    /// Number of the inertial unit in NovAtel's list, for RAWIMU and RAWIMUS, which do not have it.
    /// Default: none.
    pub unit: Option<u32>,
}

impl ConnectedUnit {
    /// The samples in the bytes of `reader` as they arrive; `port` is its name in messages, `time` the
    /// clock of the stamps and `now` the clock of this computer in nanoseconds since 1970. An error of
    /// `reader` with the kind `WouldBlock` means that no byte has arrived yet; the next call goes on.
    ///
    /// # Errors
    /// When a sensor does not exist, or a key contradicts another.
    pub fn connected(
        self,
        port: PathBuf,
        reader: impl Read + Send + 'static,
        (time, now): (TimeConfig, fn() -> i64),
        context: &OpenContext<'_>,
    ) -> Result<Box<dyn Source>, StreamError> {
        let (live, format) = (self.format, self.format.log());
        let config = VehicleLog {
            file: port.clone(),
            format: Some(format),
            sensors: self.sensors,
            stamp: self.stamp,
            week: None,
            interval: None,
            unit: self.unit,
            checksum: ChecksumUse::default(),
            definitions: Vec::new(),
            time,
        };
        config.check(format)?;
        let (mut streams, mut branches) = (Vec::new(), Vec::new());
        for target in targets(&config, context)? {
            let (branch, options) = (Branch::default(), config.options(&target));
            let own = branch.clone();
            let decoder: Box<dyn Decoder> = match live {
                LiveFormat::Mavlink => Box::new(Tlog::connected(own, options, now)),
                LiveFormat::Mip => Box::new(Mip::connected(own, options)),
                _ => format.decoder(own, &options),
            };
            let first = streams.is_empty();
            streams.push(Stream::new(&config, target, (format, decoder), port.clone(), first)?);
            branches.push(branch);
        }
        let buffer = vec![0; READ];
        Ok(Box::new(Connected { port, reader, streams, branches, buffer }))
    }
}

/// Bytes of a port on their way to the decoder of one sensor.
#[derive(Clone, Default)]
struct Branch(Arc<Mutex<Bytes>>);

#[derive(Default)]
struct Bytes {
    waiting: VecDeque<u8>,
    ended: bool,
}

impl Branch {
    fn lock(&self) -> MutexGuard<'_, Bytes> {
        // bytes are bytes, whatever happened to a thread that held them
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Read for Branch {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let mut bytes = self.lock();
        if bytes.waiting.is_empty() && !bytes.ended {
            return Err(io::Error::from(ErrorKind::WouldBlock));
        }
        bytes.waiting.read(out)
    }
}

/// The samples of all sensors of one port.
struct Connected<R> {
    port: PathBuf,
    reader: R,
    streams: Vec<Stream>,
    /// For each stream, its bytes.
    branches: Vec<Branch>,
    buffer: Vec<u8>,
}

/// Tests whether a stream has taken all its bytes.
fn is_waiting(error: &StreamError) -> bool {
    let cause = error.source().and_then(|cause| cause.downcast_ref::<io::Error>());
    cause.is_some_and(|cause| cause.kind() == ErrorKind::WouldBlock)
}

impl<R: Read + Send> Source for Connected<R> {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            let mut ended = true;
            for stream in &mut self.streams {
                match stream.next(sample) {
                    Ok(true) => return Ok(true),
                    Ok(false) => {}
                    Err(error) if is_waiting(&error) => ended = false,
                    Err(error) => return Err(error),
                }
            }
            if ended {
                return Ok(false);
            }
            let read = self.reader.read(&mut self.buffer);
            let count = read.map_err(|e| StreamError::read(&self.port, e))?;
            for branch in &self.branches {
                let mut bytes = branch.lock();
                bytes.waiting.extend(&self.buffer[..count]);
                bytes.ended = count == 0;
            }
        }
    }

    fn warning(&mut self) -> Option<String> {
        let parts: Vec<String> = self.streams.iter_mut().filter_map(Source::warning).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
