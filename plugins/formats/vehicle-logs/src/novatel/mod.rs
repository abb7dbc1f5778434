//! Logs of NovAtel receivers: in text, `#RAWIMUSXA,...;...*crc` and the short form with `%`, and binary
//! with a long or a short header.

mod framing;

use crate::record::{Decoder, Options, Record, Topic};
use crate::text::{gps, number};
use framing::{BINARY, Header, Logs, is_checked};
use navfuse_frames::Number::{self, F32, F64, I32, U8, U16, U32};
use navfuse_frames::{Count, Damage, Frames, Stamp};
use std::io::{Read, Result};

/// Metres of a foot.
const FOOT: f64 = 0.3048;
/// Radians of a degree.
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Radians of a second of arc.
const ARC_SECOND: f64 = DEGREE / 3600.0;
/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.806_65;

/// A number of a log: its place among the fields of the text, and its offset in the binary form.
type Place = (usize, usize, Number);

/// What is done with the numbers of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    /// Counts of an inertial unit, in the order z, -y, x of axes right, forward, up, accelerations
    /// first; with the place of its number.
    Counts(Option<Place>),
    /// A solution whose height is above the geoid, with the place of the undulation.
    AboveGeoid(Place),
    /// The first field is the status of the solution, which is computed or not.
    Status,
    /// Nothing.
    Plain,
}

/// A log that is decoded, without the `A` of its name.
struct Kind {
    name: &'static str,
    /// Its number in binary logs, and the number of a log with the same content.
    ids: [u32; 2],
    fields: &'static [&'static str],
    /// Week and seconds of the measurement itself, which have more digits than the header.
    time: Option<[Place; 2]>,
    places: &'static [Place],
    content: Content,
}

const RAW: [&str; 6] = ["dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"];
const SOLUTION: &[&str] =
    &["lat", "lon", "height", "vel_n", "vel_e", "vel_u", "roll", "pitch", "azimuth"];
const POSITION: &[&str] =
    &["computed", "lat", "lon", "height", "undulation", "sigma_n", "sigma_e", "sigma_u"];
const VELOCITY: &[&str] = &["computed", "speed", "course", "vel_u"];
/// Week and seconds of INSPVA and RAWIMU, and of RAWIMUX.
const WEEK: Option<[Place; 2]> = Some([(0, 0, U32), (1, 4, F64)]);
const WEEK_X: Option<[Place; 2]> = Some([(2, 2, U16), (3, 4, F64)]);
const COUNTS: &[Place] =
    &[(3, 16, I32), (4, 20, I32), (5, 24, I32), (6, 28, I32), (7, 32, I32), (8, 36, I32)];
const COUNTS_X: &[Place] =
    &[(5, 16, I32), (6, 20, I32), (7, 24, I32), (8, 28, I32), (9, 32, I32), (10, 36, I32)];
const PVA: &[Place] = &[
    (2, 12, F64),
    (3, 20, F64),
    (4, 28, F64),
    (5, 36, F64),
    (6, 44, F64),
    (7, 52, F64),
    (8, 60, F64),
    (9, 68, F64),
    (10, 76, F64),
];
const PVA_X: &[Place] = &[
    (2, 8, F64),
    (3, 16, F64),
    (4, 24, F64),
    (6, 36, F64),
    (7, 44, F64),
    (8, 52, F64),
    (9, 60, F64),
    (10, 68, F64),
    (11, 76, F64),
];
const fn raw(name: &'static str, id: u32, extended: bool) -> Kind {
    let (time, places) = if extended { (WEEK_X, COUNTS_X) } else { (WEEK, COUNTS) };
    let unit = if extended { Some((1, 1, U8)) } else { None };
    Kind { name, ids: [id; 2], fields: &RAW, time, places, content: Content::Counts(unit) }
}

/// The logs. Those with the same content have the same topic, whatever their form.
const KINDS: [Kind; 13] = [
    raw("RAWIMUSX", 1462, true),
    raw("RAWIMUX", 1461, true),
    raw("RAWIMUS", 325, false),
    raw("RAWIMU", 268, false),
    Kind {
        name: "INSPVAX",
        ids: [1465; 2],
        fields: SOLUTION,
        time: None,
        places: PVA_X,
        content: Content::AboveGeoid((5, 32, F32)),
    },
    solution("INSPVAS", 508),
    solution("INSPVA", 507),
    // BESTGNSSPOS is BESTPOS without the inertial unit
    Kind {
        name: "BESTPOS",
        ids: [42, 1429],
        fields: POSITION,
        time: None,
        places: &[
            (0, 0, U32),
            (2, 8, F64),
            (3, 16, F64),
            (4, 24, F64),
            (5, 32, F32),
            (7, 40, F32),
            (8, 44, F32),
            (9, 48, F32),
        ],
        content: Content::Status,
    },
    Kind {
        name: "BESTVEL",
        ids: [99, 1430],
        fields: VELOCITY,
        time: None,
        places: &[(0, 0, U32), (4, 16, F64), (5, 24, F64), (6, 32, F64)],
        content: Content::Status,
    },
    corrected("CORRIMUDATA", 812),
    corrected("CORRIMUDATAS", 813),
    corrected("CORRIMUS", 2264),
    corrected("IMURATECORRIMUS", 1362),
];

const fn solution(name: &'static str, id: u32) -> Kind {
    Kind { name, ids: [id; 2], fields: SOLUTION, time: WEEK, places: PVA, content: Content::Plain }
}

/// Rates and accelerations without the Earth's rate and without gravity, of which nothing is read.
const fn corrected(name: &'static str, id: u32) -> Kind {
    let (fields, places): (&[&str], &[Place]) = (&[], &[]);
    Kind { name, ids: [id; 2], fields, time: None, places, content: Content::Plain }
}

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

/// The reader of logs in text and in binary form.
#[derive(Debug)]
pub struct Novatel<R> {
    frames: Frames<R, Logs>,
    options: Options,
    topics: Vec<Topic>,
    /// Number of the inertial unit in the last log that has it.
    unit: Option<u32>,
    /// Raw measurements of a unit whose scale is not known.
    unscaled: Count,
    /// Logs in text that are used with a wrong checksum.
    wrong: Count,
}

impl<R: Read> Novatel<R> {
    /// The logs of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let logs = Logs { unchecked: options.unchecked };
        let (frames, topics) = (Frames::new(reader, logs), Vec::new());
        let (unscaled, wrong) = (Count::default(), Count::default());
        Self { frames, options, topics, unit: None, unscaled, wrong }
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

/// The content of a log after its header.
enum Body<'a> {
    Text(Vec<&'a [u8]>),
    Binary(&'a [u8]),
}

impl Body<'_> {
    fn number(&self, (field, offset, kind): Place) -> f64 {
        match self {
            Self::Text(fields) => fields.get(field).map_or(f64::NAN, |field| number(field)),
            Self::Binary(bytes) => kind.read::<true>(bytes.get(offset..).unwrap_or_default()),
        }
    }

    /// 1 for a solution that is computed, else 0.
    fn status(&self, place: Place) -> f64 {
        let computed = match self {
            Self::Text(fields) => fields.get(place.0).is_some_and(|s| *s == b"SOL_COMPUTED"),
            Self::Binary(_) => self.number(place) == 0.0,
        };
        f64::from(u8::from(computed))
    }
}

/// The kind of a log, week and seconds in its header, and its content; `None` for another kind.
fn parts(frame: &[u8]) -> Option<(&'static Kind, [f64; 2], Body<'_>)> {
    if frame[0] == BINARY {
        let header = Header::read(frame)?;
        let kind = KINDS.iter().find(|kind| kind.ids.contains(&header.id))?;
        let [week, millis] = header.time;
        return Some((kind, [week, 1e-3 * millis], Body::Binary(frame.get(header.size..)?)));
    }
    let content = frame.get(1..frame.len().checked_sub(9)?)?;
    let mut halves = content.splitn(2, |b| *b == b';');
    let header: Vec<&[u8]> = halves.next()?.split(|b| *b == b',').collect();
    let name = header[0].strip_suffix(b"A").unwrap_or(header[0]);
    let name: &[u8] = match name {
        b"BESTGNSSPOS" => b"BESTPOS",
        b"BESTGNSSVEL" => b"BESTVEL",
        name => name,
    };
    let kind = KINDS.iter().find(|kind| kind.name.as_bytes() == name)?;
    // in the long or in the short form of the header
    let places = if frame[0] == b'#' { [5, 6] } else { [1, 2] };
    let time = places.map(|k| header.get(k).map_or(f64::NAN, |field| number(field)));
    let fields = halves.next().unwrap_or_default().split(|b| *b == b',').collect();
    Some((kind, time, Body::Text(fields)))
}

/// Increments forward, right, down from counts z, -y, x of axes right, forward, up.
fn increments(values: &mut [f64], [gyro, accel]: [f64; 2]) {
    let turned = |[z, minus_y, x]: [f64; 3], scale: f64| [-minus_y * scale, x * scale, -z * scale];
    if let [a, b, c, d, e, f] = *values {
        let (rates, forces) = (turned([d, e, f], gyro), turned([a, b, c], accel));
        values[..3].copy_from_slice(&rates);
        values[3..].copy_from_slice(&forces);
    }
}

impl<R: Read + Send> Decoder for Novatel<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let offset = frame.offset;
            let Some((kind, time, body)) = parts(frame.bytes) else { continue };
            if !self.options.selects(kind.name) {
                continue;
            }
            if self.options.unchecked && frame.bytes[0] != BINARY && !is_checked(frame.bytes) {
                self.wrong.add(offset);
            }
            let [week, seconds] = kind.time.map_or(time, |time| time.map(|p| body.number(p)));
            let known = (1.0..=65_535.0).contains(&week);
            let stamp = if known { gps(week as u16, seconds) } else { Stamp::Missing };
            values.clear();
            values.extend(kind.places.iter().map(|place| body.number(*place)));
            match kind.content {
                Content::Counts(unit) => {
                    self.unit = unit.map(|place| body.number(place) as u32).or(self.unit);
                    let Some(scale) = self.unit.or(self.options.unit).and_then(scale) else {
                        self.unscaled.add(offset);
                        continue;
                    };
                    increments(values, scale);
                }
                Content::AboveGeoid(undulation) => values[2] += body.number(undulation),
                Content::Status => values[0] = body.status(kind.places[0]),
                Content::Plain => {}
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
        let wrong = self.wrong.describe("log", "used without their right checksum,");
        let texts = [self.unscaled.describe("log", text), wrong];
        let texts: Vec<String> = texts.into_iter().flatten().collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    }
}
