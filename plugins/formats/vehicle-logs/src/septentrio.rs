//! Septentrio SBF: position and velocity (`PVTGeodetic`), attitude (`AttEuler`) and the external
//! inertial unit (`ExtSensorMeas`).

use crate::checksum::crc16;
use crate::packed::{Packed, Topics};
use crate::record::{Decoder, Options, Record, Topic};
use crate::text::gps;
use navfuse_frames::Number::{F32, F64, U8, U16};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// First bytes of a block.
const MARK: [u8; 2] = *b"$@";
/// Size in bytes of mark, checksum, number and length.
const HEADER: usize = 8;
/// Largest size of a block in bytes.
const BLOCK: usize = 8192;
/// A number that a receiver does not know, and those below.
const UNKNOWN: f64 = -1e10;
/// The block of the external sensors, with the offset of its first part.
const SENSORS: u32 = 4050;
const FIRST: usize = 16;
/// Values of the week and the milliseconds that stand for no time.
const NO_WEEK: u16 = 0xffff;

/// The blocks, from their first byte on; of the sensors the place is three times the type of a part.
const KINDS: &[Packed] = &[
    Packed {
        id: 4007,
        name: "PVTGeodetic",
        places: &[
            ("Mode", 14, U8),
            ("Error", 15, U8),
            ("Latitude", 16, F64),
            ("Longitude", 24, F64),
            ("Height", 32, F64),
            ("Vn", 44, F32),
            ("Ve", 48, F32),
            ("Vu", 52, F32),
            ("HAccuracy", 90, U16),
            ("VAccuracy", 92, U16),
        ],
    },
    Packed {
        id: 5938,
        name: "AttEuler",
        places: &[("Heading", 20, F32), ("Pitch", 24, F32), ("Roll", 28, F32)],
    },
    Packed {
        id: SENSORS,
        name: "ExtSensorMeas",
        places: &[
            ("accel_x", 0, F64),
            ("accel_y", 1, F64),
            ("accel_z", 2, F64),
            ("gyro_x", 3, F64),
            ("gyro_y", 4, F64),
            ("gyro_z", 5, F64),
        ],
    },
];

/// The framing of blocks: mark, checksum, number, length, content.
#[derive(Debug)]
struct Blocks;

impl Framing for Blocks {
    const MAX: usize = BLOCK;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK[0])
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        if bytes.get(1).is_some_and(|second| *second != MARK[1]) {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(header) = bytes.first_chunk::<HEADER>() else { return Judgement::Incomplete };
        let two = |k: usize| u16::from_le_bytes([header[k], header[k + 1]]);
        let size = usize::from(two(6));
        if !(HEADER..=BLOCK).contains(&size) || !size.is_multiple_of(4) {
            return Judgement::Rejected(Fault::Form);
        }
        match bytes.get(4..size) {
            None => Judgement::Incomplete,
            Some(checked) if crc16(checked) == two(2) => Judgement::Frame(size),
            Some(_) => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// The reader of SBF.
#[derive(Debug)]
pub struct Septentrio<R> {
    frames: Frames<R, Blocks>,
    topics: Topics,
}

impl<R: Read> Septentrio<R> {
    /// The blocks of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        Self { frames: Frames::new(reader, Blocks), topics: Topics::new(KINDS, options) }
    }
}

/// The time of a block: milliseconds of the week, and the week.
fn stamp(block: &[u8]) -> Stamp {
    let millis = block.get(8..).and_then(|b| b.first_chunk()).map(|b| u32::from_le_bytes(*b));
    let week = block.get(12..).and_then(|b| b.first_chunk()).map(|b| u16::from_le_bytes(*b));
    match millis.zip(week) {
        Some((millis, week)) if week != NO_WEEK => gps(week, f64::from(millis) * 1e-3),
        _ => Stamp::Missing,
    }
}

/// The parts of the block of external sensors: three numbers for each type.
fn sensors(block: &[u8], values: &mut Vec<f64>) {
    values.clear();
    values.resize(6, f64::NAN);
    let [count, size] = [14, 15].map(|k| usize::from(block.get(k).copied().unwrap_or(0)));
    for part in block.get(FIRST..).unwrap_or_default().chunks(size.max(28)).take(count) {
        let kind = usize::from(part.get(2).copied().unwrap_or(u8::MAX));
        for k in 0..3 {
            if let Some(value) = values.get_mut(3 * kind + k).filter(|_| kind < 2) {
                *value = F64.read::<true>(part.get(4 + 8 * k..).unwrap_or_default());
            }
        }
    }
}

impl<R: Read + Send> Decoder for Septentrio<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, block) = (frame.offset, frame.bytes);
            // the upper three bits are the revision
            let id = u32::from(u16::from_le_bytes([block[4], block[5]]) & 0x1fff);
            let Some((topic, kind)) = self.topics.of(id) else { continue };
            if id == SENSORS {
                sensors(block, values);
            } else {
                kind.read(block, values);
            }
            values.iter_mut().filter(|v| **v < UNKNOWN).for_each(|v| *v = f64::NAN);
            if kind.name == "PVTGeodetic" {
                // the lower four bits are the mode, which an error makes zero
                values[0] = if values[1] == 0.0 { f64::from(values[0] as u8 & 0xf) } else { 0.0 };
            }
            return Ok(Some(Record { offset, topic, stamp: stamp(block) }));
        }
    }

    fn topics(&self) -> &[Topic] {
        self.topics.found()
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}
