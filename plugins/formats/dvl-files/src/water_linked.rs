//! Water Linked A50 and A125: JSON as their network gives it, and the sentences of their serial
//! port.
//!
//! The axes are forward, right and down, and the velocity is that of the vehicle.

use crate::ping::{Coordinates, Decoder, Ping, Stamp, TrackedVelocity};
use crate::text::{fields, number, value};
use navfuse_frames::{Check, Damage, Fault, Frames, Framing, Judgement, Sentences};
use serde::Deserialize;
use std::io::{Read, Result};

/// Nanoseconds of a millisecond.
const MILLISECOND: f64 = 1e6;
/// Nanoseconds of a microsecond.
const MICROSECOND: i64 = 1000;

/// Largest depth of braces and brackets in a report: that of the covariance, and some more.
const DEPTH: usize = 6;

/// The framing of JSON objects: from a brace to the one that closes it.
#[derive(Debug)]
pub struct Objects;

impl Framing for Objects {
    const MAX: usize = 32 * 1024;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == b'{')
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        match extent(bytes) {
            Some(Ok(size)) if serde_json::from_slice::<Report>(&bytes[..size]).is_ok() => {
                Judgement::Frame(size)
            }
            Some(_) => Judgement::Rejected(Fault::Form),
            None => Judgement::Incomplete,
        }
    }

    fn separates(&self, byte: u8) -> bool {
        // several objects may be the lines of a file, or the elements of an array
        byte.is_ascii_whitespace() || matches!(byte, b',' | b'[' | b']')
    }
}

/// Bytes that cannot be part of a report.
struct NoReport;

/// Finds the size of an object by its braces; `None` while its end is missing. The limit of the
/// depth keeps the effort linear in the size of the file, whatever it contains.
fn extent(bytes: &[u8]) -> Option<std::result::Result<usize, NoReport>> {
    let (mut depth, mut string, mut escaped) = (0_usize, false, false);
    for (k, byte) in bytes.iter().enumerate() {
        match byte {
            // a line break within a string means that its end is lost
            0..=0x1f if string => return Some(Err(NoReport)),
            _ if escaped => escaped = false,
            b'\\' if string => escaped = true,
            b'"' => string = !string,
            _ if string => {}
            b'{' | b'[' if depth == DEPTH => return Some(Err(NoReport)),
            b'{' | b'[' => depth += 1,
            b'}' | b']' if depth == 1 => return Some(Ok(k + 1)),
            b'}' | b']' => depth -= 1,
            _ => {}
        }
    }
    None
}

/// The fields of an object that this reader needs. An object without a type is none of the
/// instrument's.
#[derive(Debug, Deserialize)]
struct Report {
    #[serde(rename = "type")]
    kind: String,
    time: Option<f64>,
    vx: Option<f64>,
    vy: Option<f64>,
    vz: Option<f64>,
    fom: Option<f64>,
    altitude: Option<f64>,
    velocity_valid: Option<bool>,
    time_of_validity: Option<i64>,
    transducers: Option<Vec<Transducer>>,
}

#[derive(Debug, Deserialize)]
struct Transducer {
    id: Option<usize>,
    distance: Option<f64>,
}

/// The reader of JSON.
#[derive(Debug)]
pub struct Json<R> {
    frames: Frames<R, Objects>,
    /// The bytes of the report before.
    before: Vec<u8>,
}

impl<R: Read> Json<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        Self { frames: Frames::new(reader, Objects), before: Vec::new() }
    }
}

impl<R: Read + Send> Decoder for Json<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        while let Some(frame) = self.frames.next()? {
            let Ok(report) = serde_json::from_slice::<Report>(frame.bytes) else { continue };
            if report.kind != "velocity" {
                continue;
            }
            if frame.bytes == self.before {
                // a report that was logged twice
                self.frames.reject_last();
                continue;
            }
            self.before.clear();
            self.before.extend_from_slice(frame.bytes);
            let velocity = [report.vx, report.vy, report.vz];
            let mut range = [None; 4];
            for transducer in report.transducers.iter().flatten() {
                if let Some(slot) = transducer.id.and_then(|id| range.get_mut(id)) {
                    *slot = transducer.distance.filter(|d| *d > 0.0);
                }
            }
            let valid = report.velocity_valid == Some(true);
            let stamp = match report.time_of_validity.filter(|t| *t > 0) {
                Some(micros) => micros.checked_mul(MICROSECOND).map_or(Stamp::Missing, Stamp::Date),
                None => elapsed(report.time),
            };
            let mut ping = ping(frame.offset, stamp, velocity, valid, report.altitude, report.fom);
            if let Some(track) = &mut ping.bottom {
                track.range = range;
            }
            return Ok(Some(ping));
        }
        Ok(None)
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}

/// The stamp of a report that counts milliseconds since the one before.
fn elapsed(milliseconds: Option<f64>) -> Stamp {
    // a day between reports is a damaged number
    let plausible = milliseconds.filter(|ms| (0.0..86.4e6).contains(ms));
    plausible.map_or(Stamp::Missing, |ms| Stamp::Elapsed((ms * MILLISECOND).round() as i64))
}

fn ping(
    offset: u64,
    stamp: Stamp,
    velocity: [Option<f64>; 3],
    valid: bool,
    altitude: Option<f64>,
    merit: Option<f64>,
) -> Ping {
    let [x, y, z] = velocity.map(|v| v.filter(|_| valid));
    let track = TrackedVelocity {
        coordinates: Coordinates::Instrument,
        recorded: [x, y, z, None],
        axes: x.zip(y).zip(z).map(|((x, y), z)| [x, y, z]),
        // without the bottom it reports -1
        altitude: altitude.filter(|a| valid && *a > 0.0),
        figure_of_merit: merit,
        ..TrackedVelocity::default()
    };
    Ping { offset, stamp, bottom: Some(track), ..Ping::default() }
}

/// The framing of the serial sentences.
const SENTENCES: Sentences =
    Sentences { marks: b"w", check: Check::Crc8, marks_are_reserved: false };

/// The reader of the serial sentences.
#[derive(Debug)]
pub struct Serial<R>(Frames<R, Sentences>);

impl<R: Read> Serial<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        Self(Frames::new(reader, SENTENCES))
    }
}

impl<R: Read + Send> Decoder for Serial<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        while let Some(frame) = self.0.next()? {
            match sentence(frame.offset, SENTENCES.content(frame.bytes)) {
                Ok(Some(ping)) => return Ok(Some(ping)),
                Ok(None) => {}
                Err(Damaged) => self.0.reject_last(),
            }
        }
        Ok(None)
    }

    fn damage(&self) -> &Damage {
        self.0.damage()
    }
}

/// A sentence with an intact checksum whose fields do not follow the format.
struct Damaged;

/// Reads a sentence; `None` for one that has no velocity.
fn sentence(offset: u64, content: &[u8]) -> std::result::Result<Option<Ping>, Damaged> {
    let mut fields = fields(content);
    match fields.next().unwrap_or_default() {
        "rz" => velocity(&mut fields, offset).ok_or(Damaged).map(Some),
        "rx" => old_velocity(&mut fields, offset).ok_or(Damaged).map(Some),
        _ => Ok(None),
    }
}

fn validity(field: &str) -> Option<bool> {
    match field {
        "y" => Some(true),
        "n" => Some(false),
        _ => None,
    }
}

/// Reads `wrz,vx,vy,vz,valid,altitude,fom,covariance,time of validity,...`.
fn velocity<'a>(fields: &mut impl Iterator<Item = &'a str>, offset: u64) -> Option<Ping> {
    let mut axis = || number(fields);
    let velocity = [Some(axis()?), Some(axis()?), Some(axis()?)];
    let valid = validity(fields.next()?)?;
    let (altitude, merit) = (number(fields)?, number(fields)?);
    let _covariance = fields.next()?;
    let micros: i64 = value(fields)?;
    let stamp = Some(micros).filter(|t| *t > 0).and_then(|t| t.checked_mul(MICROSECOND));
    let stamp = stamp.map_or(Stamp::Missing, Stamp::Date);
    Some(ping(offset, stamp, velocity, valid, Some(altitude), Some(merit)))
}

/// Reads `wrx,time,vx,vy,vz,fom,altitude,valid,status`.
fn old_velocity<'a>(fields: &mut impl Iterator<Item = &'a str>, offset: u64) -> Option<Ping> {
    let stamp = elapsed(number(fields));
    let mut axis = || number(fields);
    let velocity = [Some(axis()?), Some(axis()?), Some(axis()?)];
    let (merit, altitude) = (number(fields)?, number(fields)?);
    let valid = validity(fields.next()?)?;
    Some(ping(offset, stamp, velocity, valid, Some(altitude), Some(merit)))
}
