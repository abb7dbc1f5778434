//! Water Linked A50 and A125: JSON as their network gives it, and the sentences of their serial
//! port.
//!
//! The axes are forward, right and down, and the velocity is that of the vehicle.

use crate::ping::{Coordinates, Decoder, Ping, Stamp, TrackedVelocity};
use crate::text::{fields, number, value};
use navfuse_frames::{Check, Count, Damage, Fault, Frames, Framing, Judgement, Sentences};
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
            Some(Ok(size)) if Report::read(&bytes[..size]).is_some() => Judgement::Frame(size),
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

/// The fields of an object that this reader needs. An object without a type is a velocity of the
/// format `json_v1`, or none of the instrument's.
#[derive(Debug, Deserialize)]
struct Report {
    #[serde(rename = "type")]
    kind: Option<String>,
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

impl Report {
    /// Reads an object; `None` for one that is none of the instrument's.
    fn read(object: &[u8]) -> Option<Self> {
        let report: Self = serde_json::from_slice(object).ok()?;
        let velocity = report.velocity_valid.is_some() && report.transducers.is_some();
        // other programs call their records velocities, too
        let own = report.track().is_none() || report.velocity_valid.is_some();
        ((report.kind.is_some() && own) || velocity).then_some(report)
    }

    /// The track of its velocity; `None` for a report without one.
    fn track(&self) -> Option<Track> {
        match self.kind.as_deref() {
            None | Some("velocity") => Some(Track::Bottom),
            Some("velocity_water") => Some(Track::Water),
            Some(_) => None,
        }
    }
}

/// What a velocity is relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Track {
    Bottom,
    Water,
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
    /// Reports that were logged twice.
    repeated: Count,
}

impl<R: Read> Json<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        let frames = Frames::new(reader, Objects);
        Self { frames, before: Vec::new(), repeated: Count::default() }
    }
}

impl<R: Read + Send> Decoder for Json<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        while let Some(frame) = self.frames.next()? {
            let Some(report) = Report::read(frame.bytes) else { continue };
            let Some(track) = report.track() else { continue };
            if frame.bytes == self.before {
                self.repeated.add(frame.offset);
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
            let velocity = velocity.map(|v| v.filter(|_| valid));
            let tracked =
                TrackedVelocity { range, ..tracked(velocity, report.altitude, report.fom) };
            return Ok(Some(ping(frame.offset, stamp, track, tracked)));
        }
        Ok(None)
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }

    fn events(&self) -> Option<String> {
        self.repeated.describe("report", "left out, equal to the one before,")
    }
}

/// The stamp of a report that counts milliseconds since the one before.
fn elapsed(milliseconds: Option<f64>) -> Stamp {
    // a day between reports is a damaged number
    let plausible = milliseconds.filter(|ms| (0.0..86.4e6).contains(ms));
    plausible.map_or(Stamp::Missing, |ms| Stamp::Elapsed((ms * MILLISECOND).round() as i64))
}

/// The velocity, where it is valid.
fn tracked(
    velocity: [Option<f64>; 3],
    altitude: Option<f64>,
    merit: Option<f64>,
) -> TrackedVelocity {
    let [x, y, z] = velocity;
    TrackedVelocity {
        coordinates: Coordinates::Instrument,
        recorded: [x, y, z, None],
        axes: x.zip(y).zip(z).map(|((x, y), z)| [x, y, z]),
        // without the bottom it reports -1
        altitude: altitude.filter(|a| x.is_some() && *a > 0.0),
        figure_of_merit: merit,
        ..TrackedVelocity::default()
    }
}

fn ping(offset: u64, stamp: Stamp, track: Track, velocity: TrackedVelocity) -> Ping {
    let [bottom, water] = [Track::Bottom, Track::Water].map(|t| (t == track).then_some(velocity));
    Ping { offset, stamp, bottom, water, ..Ping::default() }
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
    let ping = match fields.next().unwrap_or_default() {
        "rz" => velocity(&mut fields, offset),
        "rs" => water_velocity(&mut fields, offset),
        "rx" => old_velocity(&mut fields, offset),
        _ => return Ok(None),
    };
    ping.ok_or(Damaged).map(Some)
}

/// The three velocities, before their validity.
type Axes = [f64; 3];

fn axes<'a>(fields: &mut impl Iterator<Item = &'a str>) -> Option<Axes> {
    Some([number(fields)?, number(fields)?, number(fields)?])
}

/// The velocities where the field `y` or `n` declares them valid.
fn valid(axes: Axes, field: &str) -> Option<[Option<f64>; 3]> {
    match field {
        "y" => Some(axes.map(Some)),
        "n" => Some([None; 3]),
        _ => None,
    }
}

/// Reads the covariance and the time of validity, which follow each other.
fn validity<'a>(fields: &mut impl Iterator<Item = &'a str>) -> Option<Stamp> {
    let _covariance = fields.next()?;
    let micros: i64 = value(fields)?;
    let nanos = Some(micros).filter(|t| *t > 0).and_then(|t| t.checked_mul(MICROSECOND));
    Some(nanos.map_or(Stamp::Missing, Stamp::Date))
}

/// Reads `wrz,vx,vy,vz,valid,altitude,fom,covariance,time of validity,...`.
fn velocity<'a>(fields: &mut impl Iterator<Item = &'a str>, offset: u64) -> Option<Ping> {
    let velocity = valid(axes(fields)?, fields.next()?)?;
    let (altitude, merit) = (number(fields)?, number(fields)?);
    let track = tracked(velocity, Some(altitude), Some(merit));
    Some(ping(offset, validity(fields)?, Track::Bottom, track))
}

/// Reads `wrs,vx,vy,vz,valid,fom,covariance,time of validity,...`.
fn water_velocity<'a>(fields: &mut impl Iterator<Item = &'a str>, offset: u64) -> Option<Ping> {
    let velocity = valid(axes(fields)?, fields.next()?)?;
    let track = tracked(velocity, None, Some(number(fields)?));
    Some(ping(offset, validity(fields)?, Track::Water, track))
}

/// Reads `wrx,time,vx,vy,vz,fom,altitude,valid,status`.
fn old_velocity<'a>(fields: &mut impl Iterator<Item = &'a str>, offset: u64) -> Option<Ping> {
    let stamp = elapsed(number(fields));
    let axes = axes(fields)?;
    let (merit, altitude) = (number(fields)?, number(fields)?);
    let track = tracked(valid(axes, fields.next()?)?, Some(altitude), Some(merit));
    Some(ping(offset, stamp, Track::Bottom, track))
}
