//! Logs of DUNE (`.lsf`): packets of the inter-module communication (IMC) of LSTS, as its public message
//! definitions describe them, versions 5.3 to 5.5.

use crate::checksum::crc16_ibm;
use crate::packed::{Packed, Place, Topics};
use crate::record::{Decoder, Options, Record, Topic};
use navfuse_frames::Number::{F32, F64, U8, U16};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// The second byte of a packet, after that of the version; written by a host with the low byte first.
const MARK: u8 = 0xfe;
/// First bytes of the versions 5.0 to 5.15.
const VERSIONS: std::ops::RangeInclusive<u8> = 0x50..=0x5f;
/// Sizes in bytes of the header, mark to destination, and of the checksum.
const HEADER: usize = 20;
const CHECKSUM: usize = 2;
/// Bits of the validity of a fix: position, course, speed, accuracies.
const POSITION: u16 = 1 << 2;
const OPTIONAL: [(usize, u16); 4] = [(6, 1 << 3), (7, 1 << 4), (8, 1 << 5), (9, 1 << 6)];
/// Kinds of fix that are measurements: stand-alone and differential.
const MEASURED: f64 = 1.0;

/// A message of a size, whose number of a kind is both.
const fn message(id: u32, size: u32, name: &'static str, places: &'static [Place]) -> Packed {
    Packed { id: id << 16 | size, name, places }
}

const ROTATION: &[Place] = &[("x", 28, F64), ("y", 36, F64), ("z", 44, F64)];
const VELOCITY: &[Place] = &[("validity", 20, U8), ("x", 21, F64), ("y", 29, F64), ("z", 37, F64)];
const GPS: u32 = 253;
const STATE: u32 = 350;
const GROUND: u32 = 259;
const WATER: u32 = 260;

/// The messages, from the first byte of their packet on.
const KINDS: &[Packed] = &[
    message(254, 40, "EulerAngles", &[("phi", 28, F64), ("theta", 36, F64), ("psi", 44, F64)]),
    message(256, 32, "AngularVelocity", ROTATION),
    message(257, 32, "Acceleration", ROTATION),
    message(GROUND, 25, "GroundVelocity", VELOCITY),
    message(WATER, 25, "WaterVelocity", VELOCITY),
    message(264, 8, "Pressure", &[("value", 20, F64)]),
    message(265, 4, "Depth", &[("value", 20, F32)]),
    // the height has four bytes, and had eight until version 5.3
    message(
        GPS,
        56,
        "GpsFix",
        &[
            ("valid", 20, U16),
            ("type", 22, U8),
            ("satellites", 51, U8),
            ("lat", 31, F64),
            ("lon", 39, F64),
            ("height", 47, F32),
            ("cog", 52, F32),
            ("sog", 56, F32),
            ("hacc", 68, F32),
            ("vacc", 72, F32),
        ],
    ),
    message(
        GPS,
        60,
        "GpsFix",
        &[
            ("valid", 20, U16),
            ("type", 22, U8),
            ("satellites", 55, U8),
            ("lat", 31, F64),
            ("lon", 39, F64),
            ("height", 47, F64),
            ("cog", 56, F32),
            ("sog", 60, F32),
            ("hacc", 72, F32),
            ("vacc", 76, F32),
        ],
    ),
    message(
        STATE,
        88,
        "EstimatedState",
        &[
            ("lat", 20, F64),
            ("lon", 28, F64),
            ("height", 36, F32),
            ("x", 40, F32),
            ("y", 44, F32),
            ("z", 48, F32),
            ("phi", 52, F32),
            ("theta", 56, F32),
            ("psi", 60, F32),
            ("vx", 76, F32),
            ("vy", 80, F32),
            ("vz", 84, F32),
        ],
    ),
];

/// The framing of packets: version and mark, number, size, time, addresses, fields, checksum.
#[derive(Debug)]
struct Packets;

impl Framing for Packets {
    const MAX: usize = HEADER + u16::MAX as usize + CHECKSUM;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| VERSIONS.contains(b))
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        if bytes.get(1).is_some_and(|second| *second != MARK) {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(header) = bytes.first_chunk::<HEADER>() else { return Judgement::Incomplete };
        let end = HEADER + usize::from(u16::from_le_bytes([header[4], header[5]]));
        match bytes.get(..end).zip(bytes.get(end..end + CHECKSUM)) {
            None => Judgement::Incomplete,
            Some((checked, sum)) if crc16_ibm(checked).to_le_bytes() == *sum => {
                Judgement::Frame(end + CHECKSUM)
            }
            Some(_) => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// The reader of IMC.
#[derive(Debug)]
pub struct Imc<R> {
    frames: Frames<R, Packets>,
    topics: Topics,
    /// The system of the first packet: a log has packets of other vehicles, too.
    system: Option<u16>,
}

impl<R: Read> Imc<R> {
    /// The packets of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let topics = Topics::new(KINDS, options);
        Self { frames: Frames::new(reader, Packets), topics, system: None }
    }
}

/// Leaves out what the validity of a fix or of a velocity refuses, and turns the place of an estimate to degrees.
fn judge(id: u32, values: &mut [f64]) {
    let bits = values.first().map_or(0, |bits| *bits as u16);
    match (id, values) {
        (GPS, values @ [_, _, ..]) => {
            let fix = bits & POSITION != 0 && values[1] <= MEASURED;
            values[0] = f64::from(u8::from(fix));
            let absent = OPTIONAL.iter().filter(|(_, bit)| bits & bit == 0);
            absent
                .for_each(|(k, _)| values.iter_mut().skip(*k).take(1).for_each(|v| *v = f64::NAN));
        }
        (GROUND | WATER, [_, axes @ ..]) => {
            let absent = axes.iter_mut().enumerate().filter(|(k, _)| bits & (1 << k) == 0);
            absent.for_each(|(_, v)| *v = f64::NAN);
        }
        (STATE, [lat, lon, ..]) => [*lat, *lon] = [lat.to_degrees(), lon.to_degrees()],
        _ => {}
    }
}

impl<R: Read + Send> Decoder for Imc<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, packet) = (frame.offset, frame.bytes);
            let two = |k: usize| u16::from_le_bytes([packet[k], packet[k + 1]]);
            let (id, size, entity) = (u32::from(two(2)), u32::from(two(4)), u32::from(packet[16]));
            if *self.system.get_or_insert(two(14)) != two(14) {
                continue;
            }
            let Some((topic, kind)) = self.topics.of_instance(id << 16 | size, entity) else {
                continue;
            };
            kind.read(packet, values);
            judge(id, values);
            // seconds since 1970, whose microseconds a double has
            let seconds = F64.read::<true>(&packet[6..]);
            let known = (1.0..9e9).contains(&seconds);
            let stamp = || Stamp::Date((seconds * 1e6).round() as i64 * 1000);
            let stamp = if known { stamp() } else { Stamp::Missing };
            return Ok(Some(Record { offset, topic, stamp }));
        }
    }

    fn topics(&self) -> &[Topic] {
        self.topics.found()
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}
