//! Nortek AD2CP: records with a header and two checksums. Bottom track is in the records of
//! profilers (0x17) and of velocity logs (0x1B), water track of the latter in 0x1D.
//!
//! Nortek's X axis is the instrument's forward axis, Y points right and Z in the direction in which
//! the instrument looks. The velocities of these records are those of the vehicle.

use crate::bytes::{f32_at, i16_at, i32_at, u8_at, u16_at, u32_at};
use crate::ping::{Attitude, Coordinates, Decoder, Ping, Stamp, TrackedVelocity};
use navfuse_core::units::calendar::Calendar;
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement};
use std::io::{Read, Result};

/// First byte of a header.
const MARK: u8 = 0xa5;
/// Start value of the checksums.
const SEED: u16 = 0xb58c;
/// Largest content in bytes: raw echoes are the longest.
const LARGEST: usize = 1 << 20;
/// Record of the bottom track of a profiler.
const PROFILER_BOTTOM: u8 = 0x17;
/// Record of the bottom track of a velocity log.
const LOG_BOTTOM: u8 = 0x1b;
/// Record of the water track of a velocity log.
const LOG_WATER: u8 = 0x1d;
/// Velocity in m/s, and those below, that marks a bad one.
const BAD: f64 = -32.0;

/// The framing of records: mark, sizes, checksums of header and content.
#[derive(Debug)]
pub struct Records;

/// The header of a record.
struct Header {
    size: usize,
    id: u8,
    content: usize,
    checksum: u16,
}

impl Header {
    /// Reads a header; `None` while bytes are missing.
    fn read(bytes: &[u8]) -> Option<std::result::Result<Self, Fault>> {
        let size = usize::from(u8_at(bytes, 1)?);
        let id = u8_at(bytes, 2)?;
        // a long header has a length of four bytes
        let wide = match size {
            10 => false,
            12 => true,
            _ => return Some(Err(Fault::Form)),
        };
        let header = bytes.get(..size)?;
        if checksum(&header[..size - 2]) != u16_at(header, size - 2)? {
            return Some(Err(Fault::Checksum));
        }
        let content = if wide { u32_at(header, 4)? } else { u32::from(u16_at(header, 4)?) };
        let content = usize::try_from(content).unwrap_or(usize::MAX);
        if content > LARGEST {
            return Some(Err(Fault::Form));
        }
        Some(Ok(Self { size, id, content, checksum: u16_at(header, size - 4)? }))
    }
}

/// The sum of the words of two bytes, the checksum of AD2CP.
fn checksum(bytes: &[u8]) -> u16 {
    let pairs = bytes.chunks_exact(2);
    let last = pairs.remainder().first().map_or(0, |b| u16::from(*b) << 8);
    let add = |sum: u16, pair: &[u8]| sum.wrapping_add(u16::from_le_bytes([pair[0], pair[1]]));
    pairs.fold(SEED, add).wrapping_add(last)
}

impl Framing for Records {
    const MAX: usize = LARGEST + 12;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK)
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let header = match Header::read(bytes) {
            None => return Judgement::Incomplete,
            Some(Err(fault)) => return Judgement::Rejected(fault),
            Some(Ok(header)) => header,
        };
        let end = header.size + header.content;
        match bytes.get(header.size..end) {
            None => Judgement::Incomplete,
            Some(content) if checksum(content) == header.checksum => Judgement::Frame(end),
            Some(_) => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// The reader of AD2CP.
#[derive(Debug)]
pub struct Ad2cp<R>(Frames<R, Records>);

impl<R: Read> Ad2cp<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        Self(Frames::new(reader, Records))
    }
}

impl<R: Read + Send> Decoder for Ad2cp<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        while let Some(frame) = self.0.next()? {
            let Some(Ok(header)) = Header::read(frame.bytes) else { continue };
            let content = &frame.bytes[header.size..];
            let ping = match header.id {
                PROFILER_BOTTOM => profiler(content),
                LOG_BOTTOM | LOG_WATER => log(content, header.id == LOG_WATER),
                _ => continue,
            };
            match ping {
                Some(ping) => return Ok(Some(Ping { offset: frame.offset, ..ping })),
                None => self.0.reject_last(),
            }
        }
        Ok(None)
    }

    fn damage(&self) -> &Damage {
        self.0.damage()
    }
}

/// The date at an offset: years since 1900, months from zero, units of 100 us.
fn stamp(content: &[u8], at: usize) -> Stamp {
    let field = |k| u8_at(content, at + k);
    let calendar = || {
        let (year, month) = (1900 + i32::from(field(0)?), field(1)?.checked_add(1)?);
        let (day, hour, minute, second) = (field(2)?, field(3)?, field(4)?, field(5)?);
        let nanos = u32::from(u16_at(content, at + 6)?).checked_mul(100_000)?;
        Calendar { year, month, day, hour, minute, second, nanos }.unix_nanos()
    };
    calendar().map_or(Stamp::Missing, Stamp::Date)
}

/// The track of velocities of the vehicle.
fn track(coordinates: Coordinates, recorded: [Option<f64>; 4]) -> TrackedVelocity {
    let [x, y, z, second] = recorded;
    let mut track = TrackedVelocity { coordinates, recorded, ..TrackedVelocity::default() };
    match coordinates {
        Coordinates::Beam => track.beams = Some(recorded),
        Coordinates::Instrument => {
            // each pair of beams gives a vertical velocity
            let down = z.zip(second).map(|(a, b)| 0.5 * (a + b)).or(z).or(second);
            track.axes = x.zip(y).zip(down).map(|((x, y), z)| [x, y, z]);
            track.error_velocity = z.zip(second).map(|(a, b)| a - b);
        }
        Coordinates::Ship | Coordinates::Earth => {}
    }
    track
}

/// Decodes the bottom track of a profiler.
fn profiler(content: &[u8]) -> Option<Ping> {
    let (start, config) = (usize::from(u8_at(content, 1)?), u16_at(content, 2)?);
    let layout = u16_at(content, 30)?;
    let beams = usize::from(layout >> 12).min(4);
    let coordinates = match layout >> 10 & 3 {
        0 => Coordinates::Earth,
        1 => Coordinates::Instrument,
        2 => Coordinates::Beam,
        _ => return None,
    };
    let scale = 10_f64.powi(i32::from(i8::from_le_bytes([u8_at(content, 60)?])));
    let has = |bit: u16| config >> bit & 1 != 0;
    let count = usize::from(layout >> 12);
    // the fields that the configuration selects follow each other
    let mut at = start;
    let mut block = |selected: bool, width: usize| {
        let from = at;
        at += if selected { width * count } else { 0 };
        selected.then_some(from)
    };
    let (velocity, range, merit) = (block(has(5), 4), block(has(8), 4), block(has(9), 2));
    let mut found = ([None; 4], [None; 4], [None; 4]);
    for k in 0..beams {
        found.0[k] = velocity.and_then(|v| i32_at(content, v + 4 * k));
        found.1[k] = range.and_then(|r| i32_at(content, r + 4 * k)).filter(|r| *r > 0);
        found.2[k] = merit.and_then(|m| u16_at(content, m + 2 * k));
    }
    let (raw, range, merit) = found;
    // a beam without an echo of the bottom has the largest figure of merit and no distance
    let valid = |k: usize| merit[k] != Some(u16::MAX) && (range[k].is_some() || !has(8));
    let recorded: [Option<f64>; 4] =
        std::array::from_fn(|k| Some(f64::from(raw[k]?) * scale).filter(|v| valid(k) && *v > BAD));
    let hundredths = |x: f64| (x * 0.01).to_radians();
    let angle = |at| Some(hundredths(f64::from(i16_at(content, at)?)));
    Some(Ping {
        stamp: stamp(content, 8),
        bottom: Some(TrackedVelocity {
            range: range.map(|r| r.map(|r| f64::from(r) * 1e-3)),
            ..track(coordinates, recorded)
        }),
        depth: None,
        attitude: Some(Attitude {
            heading: hundredths(f64::from(u16_at(content, 24)?)),
            pitch: angle(26)?,
            roll: angle(28)?,
        }),
        sound_speed: u16_at(content, 16).map(|c| f64::from(c) * 0.1),
        ..Ping::default()
    })
}

/// Decodes bottom or water track of a velocity log, which has beams and axes.
fn log(content: &[u8], water: bool) -> Option<Ping> {
    let status = u32_at(content, 20)?;
    let valid = |bit: usize| status >> bit & 1 != 0;
    let four = |at: usize| [0, 1, 2, 3].map(|k| f32_at(content, at + 4 * k));
    let checked = |at: usize, bit: usize| {
        let values = four(at);
        std::array::from_fn(|k| values[k].filter(|v| valid(bit + k) && *v > BAD))
    };
    content.get(..164)?;
    let (beams, axes) = (checked(36, 0), checked(132, 12));
    let range = checked(52, 4).map(|r: Option<f64>| r.filter(|r| *r > 0.0));
    let merit: [Option<f64>; 4] = checked(148, 16);
    let worst = merit.iter().flatten().copied().reduce(f64::max);
    let track = TrackedVelocity {
        beams: Some(beams),
        range,
        figure_of_merit: worst,
        ..track(Coordinates::Instrument, axes)
    };
    let mut ping = Ping {
        stamp: stamp(content, 6),
        sound_speed: f32_at(content, 24).filter(|c| *c > 0.0),
        ..Ping::default()
    };
    if water {
        ping.water = Some(track)
    } else {
        ping.bottom = Some(track)
    }
    Some(ping)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_date_with_more_than_a_second_of_fraction_is_missing() {
        let date = |low, high| stamp(&[126, 0, 1, 0, 0, 0, low, high], 0);
        assert!(matches!(date(0x0f, 0x27), Stamp::Date(_)), "9999 units of 100 us");
        assert!(matches!(date(0xff, 0xff), Stamp::Missing), "65535 units");
    }
}
