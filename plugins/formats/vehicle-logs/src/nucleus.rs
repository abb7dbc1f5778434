//! Nortek Nucleus: inertial unit, attitude, bottom and water track of one instrument.
//!
//! The framing is the one of AD2CP with the family 0x20. A record begins with its version, the
//! offset of its data, flags, and seconds and microseconds of its time.

use crate::packed::{Packed, Topics};
use crate::record::{Decoder, Options, Record, Topic};
use navfuse_frames::Number::{F32, F64, U32};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// First byte of a record, size of its header in bytes, and the family.
const MARK: u8 = 0xa5;
const HEADER: usize = 10;
const FAMILY: u8 = 0x20;
/// Largest size of the data in bytes.
const DATA: usize = 8192;
/// Start of the checksums.
const START: u16 = 0xb58c;
/// Bits of the status by which all three velocities are valid.
const VALID: u32 = 0b111 << 9;
/// Numbers of the records with a velocity, and of those whose data begin where the record says.
const TRACKS: [u32; 2] = [0xb4, 0xbe];

/// The velocities of a track, from the beginning of the record.
const TRACK: &[(&str, usize, navfuse_frames::Number)] = &[
    ("status", 12, U32),
    ("sound_speed", 24, F32),
    ("pressure", 32, F32),
    ("distance_beam_1", 48, F32),
    ("distance_beam_2", 52, F32),
    ("distance_beam_3", 56, F32),
    ("velocity_x", 96, F32),
    ("velocity_y", 100, F32),
    ("velocity_z", 104, F32),
    ("fom_x", 108, F32),
    ("fom_y", 112, F32),
    ("fom_z", 116, F32),
];

/// The records; those without a track from the offset of their data on.
const KINDS: &[Packed] = &[
    Packed {
        id: 0x82,
        name: "NUCLEUS-IMU",
        places: &[
            ("accel_x", 0, F32),
            ("accel_y", 4, F32),
            ("accel_z", 8, F32),
            ("gyro_x", 12, F32),
            ("gyro_y", 16, F32),
            ("gyro_z", 20, F32),
        ],
    },
    Packed {
        id: 0xd2,
        name: "NUCLEUS-AHRS",
        places: &[
            ("roll", 0, F32),
            ("pitch", 4, F32),
            ("heading", 8, F32),
            ("declination", 64, F32),
            ("depth", 68, F32),
        ],
    },
    Packed {
        id: 0xdc,
        name: "NUCLEUS-INS",
        places: &[
            ("roll", 0, F32),
            ("pitch", 4, F32),
            ("heading", 8, F32),
            ("depth", 68, F32),
            ("status", 76, U32),
            ("latitude", 96, F64),
            ("longitude", 104, F64),
            ("velocity_n", 132, F32),
            ("velocity_e", 136, F32),
            ("velocity_d", 140, F32),
        ],
    },
    Packed { id: TRACKS[0], name: "NUCLEUS-BOTTOM-TRACK", places: TRACK },
    Packed { id: TRACKS[1], name: "NUCLEUS-WATER-TRACK", places: TRACK },
];

/// The framing of records.
#[derive(Debug)]
struct Records;

impl Framing for Records {
    const MAX: usize = HEADER + DATA;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK)
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let Some(header) = bytes.first_chunk::<HEADER>() else { return Judgement::Incomplete };
        let two = |k: usize| u16::from_le_bytes([header[k], header[k + 1]]);
        let size = usize::from(two(4));
        if usize::from(header[1]) != HEADER || header[3] != FAMILY || size > DATA {
            return Judgement::Rejected(Fault::Form);
        }
        if sum(&header[..8]) != two(8) {
            return Judgement::Rejected(Fault::Checksum);
        }
        match bytes.get(HEADER..HEADER + size) {
            None => Judgement::Incomplete,
            Some(data) if sum(data) == two(6) => Judgement::Frame(HEADER + size),
            Some(_) => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// The sum of words of two bytes.
fn sum(bytes: &[u8]) -> u16 {
    let (words, rest) = bytes.as_chunks::<2>();
    let words = words.iter().map(|word| u16::from_le_bytes(*word));
    // a last byte alone is the upper one of its word
    let last = rest.first().map(|byte| u16::from(*byte) << 8);
    words.chain(last).fold(START, u16::wrapping_add)
}

/// The reader of Nucleus records.
#[derive(Debug)]
pub struct Nucleus<R> {
    frames: Frames<R, Records>,
    topics: Topics,
}

impl<R: Read> Nucleus<R> {
    /// The records of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        Self { frames: Frames::new(reader, Records), topics: Topics::new(KINDS, options) }
    }
}

/// The time of a record.
fn stamp(data: &[u8]) -> Stamp {
    let four = |k: usize| Some(i64::from(u32::from_le_bytes(*data.get(k..)?.first_chunk()?)));
    let nanos = || Some(four(4)? * 1_000_000_000 + four(8)? * 1000);
    nanos().map_or(Stamp::Missing, Stamp::Date)
}

impl<R: Read + Send> Decoder for Nucleus<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, id) = (frame.offset, u32::from(frame.bytes[2]));
            let data = &frame.bytes[HEADER..];
            let Some((topic, kind)) = self.topics.of(id) else { continue };
            let track = TRACKS.contains(&id);
            let from = if track { 0 } else { usize::from(*data.get(1).unwrap_or(&0)) };
            kind.read(data.get(from..).unwrap_or_default(), values);
            if track {
                // one number for the validity of the vector
                values[0] = f64::from(u8::from(values[0] as u32 & VALID == VALID));
            }
            return Ok(Some(Record { offset, topic, stamp: stamp(data) }));
        }
    }

    fn topics(&self) -> &[Topic] {
        self.topics.found()
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}
