//! An instrument that is connected gives the samples of a log of the same bytes.

use crate::generate::{binary_span, nucleus, septentrio, telemetry_of_flight, ublox, units};
use crate::scenario::{read, reading};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, Plugin, Registry, SourceType};
use navfuse_core::units::sample::Sample;
use navfuse_frames::TimeConfig;
use navfuse_vehicle_logs::{ConnectedUnit, LiveFormat};
use schemars::JsonSchema;
use serde::Deserialize;
use std::error::Error;
use std::io::{self, ErrorKind, Read};
use std::path::PathBuf;

/// Bytes that arrive at once, which are fewer than those of any message.
const AT_ONCE: usize = 7;
/// The time at which everything is received, ns since 1970.
const RECEIVED: i64 = 1_790_000_000_000_000_000;

/// A port with the bytes of a file, which arrive in pieces with pauses.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
struct Wire {
    file: PathBuf,
    unit: ConnectedUnit,
    #[serde(default)]
    time: TimeConfig,
}

struct Pieces {
    bytes: io::Cursor<Vec<u8>>,
    pause: bool,
}

impl Read for Pieces {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.pause = !self.pause;
        if self.pause {
            return Err(io::Error::from(ErrorKind::WouldBlock));
        }
        let count = out.len().min(AT_ONCE);
        self.bytes.read(&mut out[..count])
    }
}

/// A source that waits for the bytes of another one.
struct Waiting(Box<dyn Source>);

impl Source for Waiting {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            let next = self.0.next(sample);
            let cause = next.as_ref().err().and_then(Error::source);
            let cause = cause.and_then(|cause| cause.downcast_ref::<io::Error>());
            if cause.is_none_or(|cause| cause.kind() != ErrorKind::WouldBlock) {
                return next;
            }
        }
    }
}

impl SourceType for Wire {
    const TYPE: &'static str = "wire";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let bytes = io::Cursor::new(std::fs::read(context.base.join(&self.file)).unwrap());
        let port = Pieces { bytes, pause: false };
        let clocks = (self.time, (|| RECEIVED) as fn() -> i64);
        let samples = self.unit.connected("log.bin".into(), port, clocks, context)?;
        Ok(vec![Box::new(Waiting(samples))])
    }
}

pub struct WirePlugin;

impl Plugin for WirePlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<Wire>();
    }
}

/// The samples of the sensors in the order of their times, relative to the first one.
fn ordered(samples: Vec<Vec<Sample>>) -> Vec<(i64, String)> {
    let mut all: Vec<Sample> = samples.into_iter().flatten().collect();
    all.sort_by_key(|s| (s.time, s.sensor));
    let first = all[0].time;
    let plain = |s: &Sample| {
        let channels: Vec<_> = (0..16).map(|k| s.get(k).map(f64::to_bits)).collect();
        ((s.time - first).nanos(), format!("{:?} {channels:?}", s.sensor))
    };
    all.iter().map(plain).collect()
}

/// A telemetry log without the times before its messages.
fn unstamped(log: &[u8]) -> Vec<u8> {
    let (mut rest, mut out) = (log, Vec::new());
    while let Some((_, message)) = rest.split_first_chunk::<8>() {
        let length = match message[0] {
            0xfe => 8 + usize::from(message[1]),
            _ => 12 + usize::from(message[1]),
        };
        out.extend_from_slice(&message[..length]);
        rest = &message[length..];
    }
    out
}

#[test]
fn an_instrument_that_is_connected_gives_the_samples_of_its_log() {
    let gnss_and_imu = |imu: &str, gnss: &str| {
        format!(
            "sensors.imu = {{ message = \"{imu}\" }}\nsensors.gnss = {{ message = \"{gnss}\" }}\n"
        )
    };
    let novatel = format!("# increments\n{}", gnss_and_imu("RAWIMUSX", "BESTPOS"));
    for (format, log, keys) in [
        (LiveFormat::Mavlink, telemetry_of_flight(4), gnss_and_imu("HIGHRES_IMU", "GPS_RAW_INT")),
        (LiveFormat::Nucleus, nucleus(40), "sensors.imu = { message = \"NUCLEUS-IMU\" }\n".into()),
        (LiveFormat::Ubx, ublox(4), gnss_and_imu("ESF-MEAS", "NAV-PVT")),
        (LiveFormat::Sbf, septentrio(4), gnss_and_imu("ExtSensorMeas", "PVTGeodetic")),
        (LiveFormat::Novatel, binary_span(4), novatel),
        (LiveFormat::SbgEcom, units::sbg(4), gnss_and_imu("IMU_SHORT", "GPS1_POS")),
        (LiveFormat::VectornavBinary, units::vectornav_binary(4), gnss_and_imu("VN-IMU", "VN-GPS")),
        (LiveFormat::Mip, units::mip(4, false), gnss_and_imu("MIP-IMU", "MIP-GNSS")),
    ] {
        let offline = read(&log, &keys).unwrap_or_else(|e| panic!("{format:?}: {e}"));
        let sent = if format == LiveFormat::Mavlink { unstamped(&log) } else { log };
        let name = match format {
            LiveFormat::SbgEcom => "sbg-ecom".to_owned(),
            LiveFormat::VectornavBinary => "vectornav-binary".to_owned(),
            other => format!("{other:?}").to_lowercase(),
        };
        let keys = format!("[source.wire.unit]\nformat = \"{name}\"\n{keys}");
        let live = reading(&sent, &format!("[source.wire]\nfile = \"log.bin\"\n{keys}"));
        let live = live.unwrap_or_else(|e| panic!("{format:?}: {e}"));
        let [live, offline] = [live, offline].map(|r| ordered(r.samples));
        assert!(offline.len() > 20, "{format:?}: {}", offline.len());
        assert_eq!(live, offline, "{format:?}");
    }
}
