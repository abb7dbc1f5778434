//! MicroStrain MIP: packets with a descriptor set, whose fields have descriptors of their own. The sets
//! of the inertial unit, of receivers and of the unit's own filter are read.
//!
//! Times are GPS time where the begin of the log has a valid one, else they count since the unit was
//! switched on. Those of a unit that is connected are GPS time.

use crate::checksum::fletcher;
use crate::record::{Decoder, Options, Record, Topic};
use crate::text::gps;
use navfuse_frames::Number::{self, F32, F64, U8, U16, U64};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Chain, Cursor, Error, Read, Result};

/// First bytes of a packet.
const MARK: [u8; 2] = [0x75, 0x65];
/// Size in bytes of marks, descriptor set and length, and of the checksum.
const HEADER: usize = 4;
const CHECK: usize = 2;
/// Bytes at the beginning of a log in which a valid GPS time is looked for.
const BEGINNING: u64 = 1024 * 1024;
/// Descriptor sets: the inertial unit, the receiver of older units, those of newer ones, the filter.
const INERTIAL: u8 = 0x80;
const RECEIVER: u8 = 0x81;
const RECEIVERS: std::ops::RangeInclusive<u8> = 0x91..=0x95;
const FILTER: u8 = 0x82;
/// The fields of any set with GPS time, and with nanoseconds since the unit was switched on.
const GPS_TIME: u8 = 0xd3;
const REFERENCE_TIME: u8 = 0xd5;
/// The type of a fix.
const FIX: u8 = 0x0b;

/// The name of a number, its field, its offset in the data of the field and its type.
type Place = (&'static str, u8, usize, Number);

/// A kind of record.
struct Kind {
    name: &'static str,
    places: &'static [Place],
    /// Field of the GPS time, beside the one of any set.
    time: u8,
    /// Bits of the flags by which week and seconds of this field are valid.
    valid: u16,
}

const RATES: Kind = Kind {
    name: "MIP-IMU",
    places: &[
        ("gyro_x", 0x05, 0, F32),
        ("gyro_y", 0x05, 4, F32),
        ("gyro_z", 0x05, 8, F32),
        ("accel_x", 0x04, 0, F32),
        ("accel_y", 0x04, 4, F32),
        ("accel_z", 0x04, 8, F32),
        ("pressure", 0x17, 0, F32),
    ],
    time: 0x12,
    valid: 1 << 2,
};
const DELTAS: Kind = Kind {
    name: "MIP-DELTA",
    places: &[
        ("dtheta_x", 0x07, 0, F32),
        ("dtheta_y", 0x07, 4, F32),
        ("dtheta_z", 0x07, 8, F32),
        ("dvel_x", 0x08, 0, F32),
        ("dvel_y", 0x08, 4, F32),
        ("dvel_z", 0x08, 8, F32),
    ],
    time: 0x12,
    valid: 1 << 2,
};
const FIXES: Kind = Kind {
    name: "MIP-GNSS",
    places: &[
        ("status", FIX, 0, U8),
        ("type", FIX, 0, U8),
        ("lat", 0x03, 0, F64),
        ("lon", 0x03, 8, F64),
        ("height", 0x03, 16, F64),
        ("h_acc", 0x03, 32, F32),
        ("v_acc", 0x03, 36, F32),
        ("vel_n", 0x05, 0, F32),
        ("vel_e", 0x05, 4, F32),
        ("vel_d", 0x05, 8, F32),
        ("s_acc", 0x05, 24, F32),
    ],
    time: 0x09,
    valid: 0b11,
};
const ESTIMATES: Kind = Kind {
    name: "MIP-FILTER",
    places: &[
        ("lat", 0x01, 0, F64),
        ("lon", 0x01, 8, F64),
        ("height", 0x01, 16, F64),
        ("vel_n", 0x02, 0, F32),
        ("vel_e", 0x02, 4, F32),
        ("vel_d", 0x02, 8, F32),
        ("roll", 0x05, 0, F32),
        ("pitch", 0x05, 4, F32),
        ("yaw", 0x05, 8, F32),
    ],
    time: 0x11,
    valid: 1,
};

/// The flags of a field: its offset, and the numbers that need each bit.
type Flags = (u8, usize, &'static [(u16, &'static [&'static str])]);

/// The flags of the fields of a receiver and of the filter.
const RECEIVED: [Flags; 2] = [
    (0x03, 40, &[(1, &["lat", "lon"]), (2, &["height"]), (8, &["h_acc"]), (16, &["v_acc"])]),
    (0x05, 32, &[(1, &["vel_n", "vel_e", "vel_d"]), (16, &["s_acc"])]),
];
const ESTIMATED: [Flags; 3] = [
    (0x01, 24, &[(1, &["lat", "lon", "height"])]),
    (0x02, 12, &[(1, &["vel_n", "vel_e", "vel_d"])]),
    (0x05, 12, &[(1, &["roll", "pitch", "yaw"])]),
];

/// The framing of packets: marks, descriptor set, length, fields and the sums of Fletcher.
#[derive(Debug)]
struct Packets;

impl Framing for Packets {
    const MAX: usize = HEADER + 255 + CHECK;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK[0])
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        if bytes.get(1).is_some_and(|second| *second != MARK[1]) {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(&[.., set, length]) = bytes.first_chunk::<HEADER>() else {
            return Judgement::Incomplete;
        };
        let end = HEADER + usize::from(length);
        if set == 0 || length == 0 {
            return Judgement::Rejected(Fault::Form);
        }
        match bytes.get(end..).and_then(|tail| tail.first_chunk::<CHECK>()) {
            None => Judgement::Incomplete,
            Some(sums) if fletcher(&bytes[..end]) == *sums => Judgement::Frame(end + CHECK),
            Some(_) => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// The data of the fields of a packet, by their descriptors.
fn fields(packet: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = packet.get(HEADER..packet.len().saturating_sub(CHECK)).unwrap_or_default();
    std::iter::from_fn(move || {
        let [length, descriptor, ..] = *rest else { return None };
        let data = rest.get(2..usize::from(length))?;
        rest = &rest[usize::from(length)..];
        Some((descriptor, data))
    })
}

/// The data of a field of a packet.
fn field(packet: &[u8], descriptor: u8) -> Option<&[u8]> {
    fields(packet).find(|(known, _)| *known == descriptor).map(|(_, data)| data)
}

fn number(data: &[u8], offset: usize, kind: Number) -> f64 {
    kind.read::<false>(data.get(offset..).unwrap_or_default())
}

/// The kind of a packet, and the number of its receiver.
fn kind(packet: &[u8]) -> Option<(&'static Kind, u32)> {
    let set = packet[2];
    Some(match set {
        INERTIAL if field(packet, 0x05).is_some() => (&RATES, 0),
        INERTIAL => (&DELTAS, 0),
        RECEIVER => (&FIXES, 0),
        FILTER => (&ESTIMATES, 0),
        _ if RECEIVERS.contains(&set) => (&FIXES, u32::from(set - RECEIVERS.start())),
        _ => return None,
    })
}

/// GPS time of a packet: seconds, week, and whether it is valid.
fn gps_time(packet: &[u8], kind: &Kind) -> Option<([f64; 2], bool)> {
    let own = field(packet, kind.time).map(|data| (data, kind.valid));
    let shared = || field(packet, GPS_TIME).map(|data| (data, 0b11));
    let (data, valid) = own.or_else(shared)?;
    let flags = number(data, 10, U16) as u16;
    let (seconds, week) = (number(data, 0, F64), number(data, 8, U16));
    Some(([seconds, week], flags & valid == valid && week >= 1.0))
}

/// The reader of packets.
pub struct Mip<R> {
    frames: Frames<Chain<Cursor<Vec<u8>>, R>, Packets>,
    options: Options,
    topics: Vec<Topic>,
    /// Set if the log has GPS time.
    dated: bool,
    /// The error with which the beginning of the log ended.
    failed: Option<Error>,
}

impl<R: Read> Mip<R> {
    /// The packets of `reader`.
    pub fn new(mut reader: R, options: Options) -> Self {
        let mut beginning = Vec::new();
        let failed = reader.by_ref().take(BEGINNING).read_to_end(&mut beginning).err();
        let dated = is_dated(&beginning);
        Self { failed, ..Self::with(beginning, reader, options, dated) }
    }

    /// The packets of a unit that is connected, by GPS time: none has a time before this is valid.
    pub fn connected(reader: R, options: Options) -> Self {
        Self::with(Vec::new(), reader, options, true)
    }

    fn with(beginning: Vec<u8>, reader: R, options: Options, dated: bool) -> Self {
        let frames = Frames::new(Cursor::new(beginning).chain(reader), Packets);
        Self { frames, options, topics: Vec::new(), dated, failed: None }
    }

    fn topic(&mut self, kind: &Kind, instance: u32) -> usize {
        let same = |t: &Topic| t.name == kind.name && t.instance == instance;
        if let Some(known) = self.topics.iter().position(same) {
            return known;
        }
        let fields = kind.places.iter().map(|(name, ..)| (*name).to_owned()).collect();
        self.topics.push(Topic { name: kind.name.to_owned(), instance, fields });
        self.topics.len() - 1
    }
}

/// Tests whether a packet has a valid GPS time.
fn is_dated(beginning: &[u8]) -> bool {
    let mut frames = Frames::new(beginning, Packets);
    while let Ok(Some(frame)) = frames.next() {
        let time = kind(frame.bytes).and_then(|(kind, _)| gps_time(frame.bytes, kind));
        if time.is_some_and(|(_, valid)| valid) {
            return true;
        }
    }
    false
}

/// The time of a packet: GPS time in a log that has it, else the time since the start.
fn stamp(packet: &[u8], kind: &Kind, dated: bool) -> Stamp {
    let time = gps_time(packet, kind);
    if dated {
        let valid = time.filter(|(_, valid)| *valid);
        return valid.map_or(Stamp::Missing, |([seconds, week], _)| gps(week as u16, seconds));
    }
    let counted = field(packet, REFERENCE_TIME).map(|data| number(data, 0, U64));
    let nanos = counted.or_else(|| time.map(|([seconds, _], _)| seconds * 1e9));
    match nanos {
        Some(nanos) if (0.0..9e18).contains(&nanos) => Stamp::Date(nanos.round() as i64),
        _ => Stamp::Missing,
    }
}

/// Removes the numbers whose flag is not set, and makes the type of a fix a status.
fn judge(packet: &[u8], kind: &Kind, values: &mut [f64]) {
    let all: &[Flags] = match kind.name {
        "MIP-GNSS" => &RECEIVED,
        "MIP-FILTER" => &ESTIMATED,
        _ => return,
    };
    let place = |name: &str| kind.places.iter().position(|(known, ..)| *known == name);
    for (descriptor, offset, bits) in all {
        let Some(data) = field(packet, *descriptor) else { continue };
        let flags = number(data, *offset, U16) as u16;
        for (_, names) in bits.iter().filter(|(bit, _)| flags & bit == 0) {
            for k in names.iter().filter_map(|name| place(name)) {
                values[k] = f64::NAN;
            }
        }
    }
    if kind.name == "MIP-GNSS" {
        // three-dimensional, RTK float, RTK fixed and differential; without a type the flags decide
        let fixed = values[0].is_nan() || [0.0, 5.0, 6.0, 7.0].contains(&values[0]);
        values[0] = f64::from(u8::from(fixed));
    }
}

impl<R: Read + Send> Decoder for Mip<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        let dated = self.dated;
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, packet) = (frame.offset, frame.bytes);
            let Some((kind, instance)) = kind(packet) else { continue };
            if !self.options.selects(kind.name) {
                continue;
            }
            values.clear();
            // the numbers of one field follow each other, and no field has the descriptor zero
            let mut last: (u8, Option<&[u8]>) = (0, None);
            values.extend(kind.places.iter().map(|(_, descriptor, at, number_type)| {
                if last.0 != *descriptor {
                    last = (*descriptor, field(packet, *descriptor));
                }
                last.1.map_or(f64::NAN, |data| number(data, *at, *number_type))
            }));
            judge(packet, kind, values);
            let stamp = stamp(packet, kind, dated);
            let topic = self.topic(kind, instance);
            return Ok(Some(Record { offset, topic, stamp }));
        }
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}
