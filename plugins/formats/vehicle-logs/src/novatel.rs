//! ASCII logs of NovAtel receivers: `#RAWIMUSXA,...;...*crc` and the short form with `%`.

use crate::record::{Decoder, Options, Record, Topic};
use crate::text::{gps, number};
use navfuse_frames::{Count, Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// Metres of a foot.
const FOOT: f64 = 0.3048;
/// Radians of a degree.
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Radians of a second of arc.
const ARC_SECOND: f64 = DEGREE / 3600.0;
/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.806_65;

/// The framing of logs: mark, text, `*` and eight hexadecimal digits of a CRC.
#[derive(Debug)]
struct Logs;

impl Framing for Logs {
    const MAX: usize = 4096;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| matches!(b, b'#' | b'%'))
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let ends = |b: &u8| matches!(b, b'*' | b'#' | b'%') || !(b' '..=b'~').contains(b);
        let Some(length) = bytes[1..].iter().position(ends) else { return Judgement::Incomplete };
        let end = 1 + length;
        if bytes[end] != b'*' {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(digits) = bytes.get(end + 1..end + 9) else { return Judgement::Incomplete };
        let written =
            std::str::from_utf8(digits).ok().and_then(|d| u32::from_str_radix(d, 16).ok());
        match written {
            None => Judgement::Rejected(Fault::Form),
            Some(crc) if crc == checksum(&bytes[1..end]) => Judgement::Frame(end + 9),
            Some(_) => Judgement::Rejected(Fault::Checksum),
        }
    }

    fn separates(&self, byte: u8) -> bool {
        matches!(byte, b'\r' | b'\n')
    }
}

/// The CRC-32 of NovAtel: the polynomial 0xedb88320, reflected, start 0, not inverted.
fn checksum(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let (mut table, mut k) = ([0; 256], 0);
        while k < 256 {
            let (mut crc, mut bit) = (k as u32, 0);
            while bit < 8 {
                crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
                bit += 1;
            }
            table[k] = crc;
            k += 1;
        }
        table
    };
    bytes.iter().fold(0, |crc, b| (crc >> 8) ^ TABLE[usize::from((crc as u8) ^ b)])
}

/// A log that is decoded, without the `A` of its name, and its fields.
struct Kind {
    name: &'static str,
    fields: &'static [&'static str],
}

const RAW: [&str; 6] = ["dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"];
const SOLUTION: &[&str] =
    &["lat", "lon", "height", "vel_n", "vel_e", "vel_u", "roll", "pitch", "azimuth"];
const POSITION: &[&str] =
    &["computed", "lat", "lon", "height", "undulation", "sigma_n", "sigma_e", "sigma_u"];
/// The logs. Those with the same content have the same topic, whatever their form.
const KINDS: [Kind; 8] = [
    Kind { name: "RAWIMUSX", fields: &RAW },
    Kind { name: "RAWIMUX", fields: &RAW },
    Kind { name: "RAWIMUS", fields: &RAW },
    Kind { name: "RAWIMU", fields: &RAW },
    Kind { name: "INSPVAX", fields: SOLUTION },
    Kind { name: "INSPVAS", fields: SOLUTION },
    Kind { name: "INSPVA", fields: SOLUTION },
    Kind { name: "BESTPOS", fields: POSITION },
];

/// Radians and metres per second of one count of an inertial unit, by its number in RAWIMUSX.
/// Units of Epson give rates, which their rate of samples turns into increments.
fn scale(kind: u32) -> Option<[f64; 2]> {
    let two = |power: i32| 2_f64.powi(power);
    let epson = |rate: f64, gyro: f64, accel: f64| {
        [gyro * two(-16) * DEGREE / rate, accel * two(-16) * GRAVITY * 1e-3 / rate]
    };
    Some(match kind {
        8 => [two(-19), two(-14)],
        1 | 5 | 11 | 20 | 27 | 28 => [two(-33), two(-27) * FOOT],
        4 | 12 => [two(-33), two(-26) * FOOT],
        13 => [0.1 * two(-8) * ARC_SECOND, 0.05 * two(-15)],
        16 | 33 => [0.1 / (3600.0 * 256.0), 0.05 * two(-15)],
        26 | 52 => [1e-9, 2e-8],
        31 => [720.0 * two(-31) * DEGREE, 200.0 * two(-31)],
        32 | 56 => [two(-21) * DEGREE, two(-22)],
        41 => epson(125.0, 0.008, 0.2),
        62 => epson(200.0, 0.008, 0.2),
        61 => epson(200.0, 0.015_151_5, 0.4),
        58 | 68 | 69 => [two(-33), two(-29)],
        _ => return None,
    })
}

/// The reader of ASCII logs.
#[derive(Debug)]
pub struct Novatel<R> {
    frames: Frames<R, Logs>,
    options: Options,
    topics: Vec<Topic>,
    /// Number of the inertial unit in the last log that has it.
    unit: Option<u32>,
    /// Raw measurements of a unit whose scale is not known.
    unscaled: Count,
}

impl<R: Read> Novatel<R> {
    /// The logs of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let (frames, topics) = (Frames::new(reader, Logs), Vec::new());
        Self { frames, options, topics, unit: None, unscaled: Count::default() }
    }

    fn topic(&mut self, kind: &Kind) -> usize {
        if let Some(known) = self.topics.iter().position(|t| t.name == kind.name) {
            return known;
        }
        let fields = kind.fields.iter().map(|f| (*f).to_owned()).collect();
        self.topics.push(Topic { name: kind.name.to_owned(), instance: 0, fields });
        self.topics.len() - 1
    }
}

/// The fields of a log after its header.
struct Body<'a>(Vec<&'a [u8]>);

impl Body<'_> {
    fn number(&self, k: usize) -> f64 {
        self.0.get(k).map_or(f64::NAN, |field| number(field))
    }

    fn numbers<const N: usize>(&self, places: [usize; N]) -> [f64; N] {
        places.map(|k| self.number(k))
    }

    /// Increments forward, right, down from counts of a unit with axes right, forward, up. The log
    /// has them in the order z, -y, x, accelerations first.
    fn increments(&self, first: usize, [gyro, accel]: [f64; 2]) -> [f64; 6] {
        let turned = |at: usize, scale: f64| {
            let [z, minus_y, x] = self.numbers([at, at + 1, at + 2]);
            [-minus_y * scale, x * scale, -z * scale]
        };
        let ([x, y, z], [u, v, w]) = (turned(first + 3, gyro), turned(first, accel));
        [x, y, z, u, v, w]
    }
}

impl<R: Read + Send> Decoder for Novatel<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let offset = frame.offset;
            let content = &frame.bytes[1..frame.bytes.len() - 9];
            let mut halves = content.splitn(2, |b| *b == b';');
            let header: Vec<&[u8]> =
                halves.next().unwrap_or_default().split(|b| *b == b',').collect();
            let body = Body(halves.next().unwrap_or_default().split(|b| *b == b',').collect());
            let name = header[0].strip_suffix(b"A").unwrap_or(header[0]);
            // BESTGNSSPOS is BESTPOS without the inertial unit
            let name: &[u8] = if name == b"BESTGNSSPOS" { b"BESTPOS" } else { name };
            let Some(kind) = KINDS.iter().find(|k| k.name.as_bytes() == name) else { continue };
            if !self.options.selects(kind.name) {
                continue;
            }
            // week and seconds: in the header, in its long or in its short form; the time of a
            // measurement itself has more digits
            let field = |k: usize| header.get(k).map_or(f64::NAN, |f| number(f));
            let (week, seconds) = match (kind.name, frame.bytes[0]) {
                ("RAWIMUX" | "RAWIMUSX", _) => (body.number(2), body.number(3)),
                ("RAWIMU" | "RAWIMUS", _) => (body.number(0), body.number(1)),
                (_, b'#') => (field(5), field(6)),
                _ => (field(1), field(2)),
            };
            let known = (1.0..=65_535.0).contains(&week);
            let stamp = if known { gps(week as u16, seconds) } else { Stamp::Missing };
            values.clear();
            match kind.name {
                "RAWIMU" | "RAWIMUS" | "RAWIMUX" | "RAWIMUSX" => {
                    let extended = kind.name.ends_with('X');
                    if extended {
                        self.unit = Some(body.number(1) as u32);
                    }
                    let Some(scale) = self.unit.or(self.options.unit).and_then(scale) else {
                        self.unscaled.add(offset);
                        continue;
                    };
                    values.extend(body.increments(if extended { 5 } else { 3 }, scale));
                }
                "INSPVAX" => {
                    values.extend(body.numbers([2, 3, 4, 6, 7, 8, 9, 10, 11]));
                    // the height is above the geoid here
                    values[2] += body.number(5);
                }
                "INSPVA" | "INSPVAS" => {
                    values.extend(body.numbers([2, 3, 4, 5, 6, 7, 8, 9, 10]));
                }
                _ => {
                    let computed = body.0.first().is_some_and(|s| *s == b"SOL_COMPUTED");
                    values.push(f64::from(u8::from(computed)));
                    values.extend(body.numbers([2, 3, 4, 5, 7, 8, 9]));
                }
            }
            let topic = self.topic(kind);
            return Ok(Some(Record { offset, topic, stamp }));
        }
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }

    fn events(&self) -> Option<String> {
        let text = "not used, of an inertial unit whose scale is not known (record RAWIMUSXA, or set \
                    `unit`),";
        self.unscaled.describe("log", text)
    }
}
