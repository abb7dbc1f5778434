//! Teledyne PD0: ensembles of binary data types, each found by its offset in the header.

use crate::bytes::{i16_at, sum, u8_at, u16_at};
use crate::ping::{Attitude, Decoder, Ping, Stamp, TrackedVelocity};
use crate::teledyne::{Convention, Janus, Mounting, coordinates, velocities};
use navfuse_core::units::calendar::{Calendar, with_century};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement};
use std::io::{Read, Result};

/// First byte of an ensemble.
const MARK: u8 = 0x7f;
/// Second byte: an ensemble, or a block of another source in the same frame.
const SOURCES: [u8; 2] = [0x7f, 0x79];
/// A number without a measurement, and a full turn in hundredths of a degree.
const ABSENT: u16 = 0xffff;
const FULL: u16 = 36_000;
/// Identifier of the fixed leader.
const FIXED_LEADER: u16 = 0x0000;
/// Identifier of the variable leader.
const VARIABLE_LEADER: u16 = 0x0080;
/// Identifier of bottom track.
const BOTTOM_TRACK: u16 = 0x0600;

/// The framing of ensembles: mark, length, offsets of the data types, sum of all bytes.
#[derive(Debug)]
pub struct Ensembles;

impl Framing for Ensembles {
    const MAX: usize = 65_535 + 2;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        let marks = |pair: &[u8]| pair[0] == MARK && SOURCES.contains(&pair[1]);
        bytes
            .windows(2)
            .position(marks)
            .or_else(|| bytes.ends_with(&[MARK]).then(|| bytes.len() - 1))
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let Some((length, count)) = u16_at(bytes, 2).map(usize::from).zip(u8_at(bytes, 5)) else {
            return Judgement::Incomplete;
        };
        let header = 6 + 2 * usize::from(count);
        if count == 0 || length < header + 2 {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(offsets) = bytes.get(6..header) else { return Judgement::Incomplete };
        let outside = |o: &[u8]| usize::from(u16::from_le_bytes([o[0], o[1]])) + 2 > length;
        if offsets.chunks_exact(2).any(outside) {
            return Judgement::Rejected(Fault::Form);
        }
        match (bytes.get(..length), u16_at(bytes, length)) {
            (Some(content), Some(written)) if sum(content) == written => {
                Judgement::Frame(length + 2)
            }
            (Some(_), Some(_)) => Judgement::Rejected(Fault::Checksum),
            _ => Judgement::Incomplete,
        }
    }
}

/// The reader of PD0.
#[derive(Debug)]
pub struct Pd0<R>(Frames<R, Ensembles>);

impl<R: Read> Pd0<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        Self(Frames::new(reader, Ensembles))
    }
}

impl<R: Read + Send> Decoder for Pd0<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        while let Some(frame) = self.0.next()? {
            if frame.bytes[1] == MARK {
                return Ok(Some(ensemble(frame.offset, frame.bytes)));
            }
        }
        Ok(None)
    }

    fn damage(&self) -> &Damage {
        self.0.damage()
    }
}

/// Decodes an intact ensemble. A data type that is absent or too short leaves its part out.
fn ensemble(offset: u64, bytes: &[u8]) -> Ping {
    let (mut fixed, mut variable, mut bottom) = (None, None, None);
    for at in offsets(bytes) {
        match u16_at(bytes, at) {
            Some(FIXED_LEADER) => fixed = Some(data_type(bytes, at)),
            Some(VARIABLE_LEADER) => variable = Some(data_type(bytes, at)),
            Some(BOTTOM_TRACK) => bottom = Some(data_type(bytes, at)),
            _ => {}
        }
    }
    let mut ping = Ping { offset, ..Ping::default() };
    if let Some(data) = variable {
        ping.stamp = stamp(data);
        ping.sound_speed = u16_at(data, 14).filter(|c| *c > 0).map(f64::from);
        ping.depth = u16_at(data, 16).filter(|d| *d != ABSENT).map(|d| f64::from(d) * 0.1);
        ping.attitude = attitude(data);
    }
    if let Some((fixed, data)) = fixed.zip(bottom) {
        let convention = convention(fixed, ping.attitude);
        ping.bottom = bottom_track(&convention, data);
        ping.water = water_track(&convention, data);
    }
    ping
}

/// The offsets of the data types.
fn offsets(bytes: &[u8]) -> impl Iterator<Item = usize> + '_ {
    let count = usize::from(bytes[5]);
    (0..count).filter_map(|k| u16_at(bytes, 6 + 2 * k)).map(usize::from)
}

/// The bytes of a data type: up to the next one, or to the checksum.
fn data_type(bytes: &[u8], at: usize) -> &[u8] {
    let end = offsets(bytes).filter(|o| *o > at).min().unwrap_or(bytes.len() - 2);
    bytes.get(at..end).unwrap_or_default()
}

/// The stamp of the clock with century where the leader has one, otherwise of the old clock.
fn stamp(data: &[u8]) -> Stamp {
    let calendar = |year: i32, at: usize| {
        let field = |k| u8_at(data, at + k);
        let nanos = u32::from(field(5)?) * 10_000_000;
        let (month, day) = (field(0)?, field(1)?);
        let (hour, minute, second) = (field(2)?, field(3)?, field(4)?);
        Calendar { year, month, day, hour, minute, second, nanos }.unix_nanos()
    };
    let century = u8_at(data, 57).filter(|c| (19..=21).contains(c)).map(i32::from);
    let year = century.zip(u8_at(data, 58)).map(|(c, year)| c * 100 + i32::from(year));
    let exact = year.and_then(|year| calendar(year, 59));
    let two_digits = || calendar(with_century(u8_at(data, 4)?), 5);
    exact.or_else(two_digits).map_or(Stamp::Missing, Stamp::Date)
}

fn attitude(data: &[u8]) -> Option<Attitude> {
    let hundredths = |x: f64| (x * 0.01).to_radians();
    let (heading, pitch, roll) = (u16_at(data, 18)?, i16_at(data, 20)?, i16_at(data, 22)?);
    let known = heading <= FULL && ![pitch, roll].contains(&i16::MIN);
    known.then(|| Attitude {
        heading: hundredths(f64::from(heading)),
        pitch: hundredths(f64::from(pitch)),
        roll: hundredths(f64::from(roll)),
    })
}

fn convention(fixed: &[u8], attitude: Option<Attitude>) -> Convention {
    let system = [u8_at(fixed, 4).unwrap_or_default(), u8_at(fixed, 5).unwrap_or_default()];
    let transformation = u8_at(fixed, 25).unwrap_or_default();
    let alignment = f64::from(i16_at(fixed, 26).unwrap_or_default()) * 0.01;
    let nominal = match system[1] & 3 {
        0 => Some(15.0),
        1 => Some(20.0),
        2 => Some(30.0),
        _ => None,
    };
    // later firmware has a byte for angles that the two bits cannot name
    let exact = u8_at(fixed, 58).filter(|a| (5..=60).contains(a)).map(f64::from);
    let convex = system[0] & 0x08 != 0;
    let degrees = exact.or(nominal);
    Convention {
        coordinates: coordinates(transformation >> 3),
        janus: degrees.map(|degrees| Janus { slant: degrees.to_radians(), convex }),
        mounting: Mounting {
            alignment: alignment.to_radians(),
            tilts: transformation & 0x04 != 0,
            up: system[0] & 0x80 != 0,
        },
        attitude,
        // PD0 gives the velocity of the bottom and of the water
        sign: -1.0,
    }
}

/// Four numbers of two bytes.
fn words(data: &[u8], at: usize) -> [Option<i16>; 4] {
    [0, 2, 4, 6].map(|k| i16_at(data, at + k))
}

/// Four bytes as shares of a full scale.
fn shares(data: &[u8], at: usize, full: f64) -> [Option<f64>; 4] {
    [0, 1, 2, 3].map(|k| u8_at(data, at + k).map(|b| f64::from(b) / full))
}

fn bottom_track(convention: &Convention, data: &[u8]) -> Option<TrackedVelocity> {
    data.get(..44)?;
    let recorded = velocities(words(data, 24));
    let range = [0, 1, 2, 3].map(|k| {
        let low = u32::from(u16_at(data, 16 + 2 * k)?);
        // the high byte came with later firmware
        let high = if data.len() >= 81 { u32::from(u8_at(data, 77 + k)?) } else { 0 };
        Some(high << 16 | low).filter(|r| *r > 0).map(|r| f64::from(r) * 0.01)
    });
    let correlation = shares(data, 32, 255.0);
    let percent_good = shares(data, 40, 100.0);
    Some(TrackedVelocity { range, correlation, percent_good, ..convention.track(recorded) })
}

/// The track of the water-mass layer. An instrument that does not ping it has no good pings there.
fn water_track(convention: &Convention, data: &[u8]) -> Option<TrackedVelocity> {
    data.get(66..70)?.iter().any(|percent| *percent > 0).then_some(())?;
    let recorded = velocities(words(data, 50));
    let correlation = shares(data, 58, 255.0);
    let percent_good = shares(data, 66, 100.0);
    Some(TrackedVelocity { correlation, percent_good, ..convention.track(recorded) })
}
