//! u-blox UBX: navigation (`NAV-PVT`) and the measurements of the inertial unit of an automotive
//! receiver (`ESF-MEAS`).
//!
//! `NAV-PVT` has date and time. `ESF-MEAS` has milliseconds of the sensors' own clock: the first one
//! after a `NAV-PVT` fixes the offset between both.

use crate::checksum::fletcher;
use crate::packed::{Packed, Topics};
use crate::record::{Decoder, Options, Record, Topic};
use navfuse_core::units::calendar::Calendar;
use navfuse_frames::Number::{I32, U8, U16, U32};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// First bytes of a message.
const MARK: [u8; 2] = [0xb5, 0x62];
/// Size in bytes of mark, class, number and length, and of the checksum.
const HEADER: usize = 6;
const CHECK: usize = 2;
/// Largest payload in bytes.
const PAYLOAD: usize = 4096;
/// Class and number of the messages.
const NAV_PVT: u32 = 0x0107;
const ESF_MEAS: u32 = 0x1002;
/// Kinds of fix with a position: three-dimensional, and with dead reckoning.
const FIXED: [u8; 2] = [3, 4];
/// Change of the clock of the sensors, ns, beyond which it was set or started again.
const STEP: i64 = 5_000_000_000;

const KINDS: &[Packed] = &[
    Packed {
        id: NAV_PVT,
        name: "NAV-PVT",
        places: &[
            ("fixType", 20, U8),
            ("lon", 24, I32),
            ("lat", 28, I32),
            ("height", 32, I32),
            ("hMSL", 36, I32),
            ("hAcc", 40, U32),
            ("vAcc", 44, U32),
            ("velN", 48, I32),
            ("velE", 52, I32),
            ("velD", 56, I32),
            ("gSpeed", 60, I32),
            ("headMot", 64, I32),
            ("sAcc", 68, U32),
            ("numSV", 23, U8),
            ("pDOP", 76, U16),
            // the carrier phase in the upper two bits: none, real, integer
            ("carrier", 21, U8),
        ],
    },
    // the place of each of them is its type
    Packed {
        id: ESF_MEAS,
        name: "ESF-MEAS",
        places: &[
            ("gyro_x", 14, I32),
            ("gyro_y", 13, I32),
            ("gyro_z", 5, I32),
            ("accel_x", 16, I32),
            ("accel_y", 17, I32),
            ("accel_z", 18, I32),
            ("speed", 11, I32),
        ],
    },
];

/// The framing of messages: mark, class, number, length, payload and a checksum of Fletcher.
#[derive(Debug)]
struct Messages;

impl Framing for Messages {
    const MAX: usize = HEADER + PAYLOAD + CHECK;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK[0])
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let &[_, second, _, _, low, high, ..] = bytes else {
            return match bytes.get(1) {
                Some(second) if *second != MARK[1] => Judgement::Rejected(Fault::Form),
                _ => Judgement::Incomplete,
            };
        };
        let size = HEADER + usize::from(u16::from_le_bytes([low, high]));
        if second != MARK[1] || size > HEADER + PAYLOAD {
            return Judgement::Rejected(Fault::Form);
        }
        match bytes.get(2..size + CHECK) {
            None => Judgement::Incomplete,
            Some(checked) => match fletcher(&checked[..size - 2]) == checked[size - 2..] {
                true => Judgement::Frame(size + CHECK),
                false => Judgement::Rejected(Fault::Checksum),
            },
        }
    }
}

/// The reader of UBX.
#[derive(Debug)]
pub struct Ublox<R> {
    frames: Frames<R, Messages>,
    topics: Topics,
    /// The newest time of a `NAV-PVT`, and the offset of the sensors' clock from it.
    now: Option<i64>,
    offset: Option<i64>,
}

impl<R: Read> Ublox<R> {
    /// The messages of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let topics = Topics::new(KINDS, options);
        Self { frames: Frames::new(reader, Messages), topics, now: None, offset: None }
    }
}

/// Date and time of a `NAV-PVT`, if the receiver knows both.
fn date(payload: &[u8]) -> Option<i64> {
    let byte = |k: usize| payload.get(k).copied();
    let year = u16::from_le_bytes([byte(4)?, byte(5)?]);
    let nanos = i32::from_le_bytes(*payload.get(16..)?.first_chunk()?);
    let [month, day, hour, minute, second] = [byte(6)?, byte(7)?, byte(8)?, byte(9)?, byte(10)?];
    let known = byte(11)? & 3 == 3;
    let calendar = Calendar { year: year.into(), month, day, hour, minute, second, nanos: 0 };
    calendar.unix_nanos().filter(|_| known)?.checked_add(nanos.into())
}

/// The measurements of an `ESF-MEAS`: a type and 24 bits with a sign in each word.
fn measurements(payload: &[u8], kind: &Packed, values: &mut Vec<f64>) {
    values.clear();
    values.resize(kind.places.len(), f64::NAN);
    let count = payload.get(5).map_or(0, |b| usize::from(b >> 3));
    let words = payload.get(8..).unwrap_or_default().as_chunks::<4>().0;
    for word in words.iter().take(count) {
        let word = u32::from_le_bytes(*word);
        let place = (word >> 24 & 0x3f) as usize;
        if let Some(k) = kind.places.iter().position(|(_, at, _)| *at == place) {
            // the sign of 24 bits
            values[k] = f64::from((word << 8) as i32 >> 8);
        }
    }
}

impl<R: Read + Send> Decoder for Ublox<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, bytes) = (frame.offset, frame.bytes);
            let payload = &bytes[HEADER..bytes.len() - CHECK];
            let id = u32::from(bytes[2]) << 8 | u32::from(bytes[3]);
            let date = (id == NAV_PVT).then(|| date(payload)).flatten();
            self.now = date.or(self.now);
            let Some((topic, kind)) = self.topics.of(id) else { continue };
            let stamp = if id == ESF_MEAS {
                measurements(payload, kind, values);
                let millis = payload.first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
                let own = i64::from(millis) * 1_000_000;
                let fresh = self.now.map(|now| now - own);
                let kept = self.offset.zip(fresh).filter(|(old, new)| (new - old).abs() < STEP);
                self.offset = kept.map(|(old, _)| old).or(fresh);
                self.offset.map(|offset| own + offset)
            } else {
                kind.read(payload, values);
                let ok = payload.get(21).is_some_and(|flags| flags & 1 == 1);
                if !ok || !FIXED.contains(&payload[20]) {
                    values[0] = 0.0;
                }
                if let Some(carrier) = values.last_mut() {
                    *carrier = f64::from(*carrier as u8 >> 6);
                }
                date
            };
            let stamp = stamp.map_or(Stamp::Missing, Stamp::Date);
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
