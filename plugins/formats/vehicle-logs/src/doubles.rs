//! Records of numbers in double precision, little-endian, without marks or checksums: SBET and the
//! binary form of KF-GINS. A record is intact if all its numbers are plausible.

use crate::record::{Decoder, Options, Record, Topic};
use crate::text::of_week;
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::io::{Cursor, Read, Result};
use std::ops::RangeInclusive;

/// Seconds of a week.
const WEEK: f64 = 604_800.0;
/// Magnitude below which a number other than zero is not a measurement.
const SMALLEST: f64 = 1e-30;

/// Share of a file's bytes that must be records, and of its intervals that must be usual.
const NEARLY_ALL: f64 = 0.95;
/// Intervals, s, at which units record.
const INTERVALS: RangeInclusive<f64> = 1e-5..=2.0;
/// Magnitudes of the specific force, m/s^2, about which a vehicle moves.
const FORCES: RangeInclusive<f64> = 8.0..=12.0;
/// Least number of records by which a file without a mark is recognised.
const FEWEST: usize = 8;

/// A kind of record: the names of its numbers and the largest magnitude of each.
#[derive(Debug)]
pub struct Kind {
    name: &'static str,
    numbers: &'static [(&'static str, f64)],
}

/// The trajectory of Applanix. Velocities are along the axes of the wander frame.
pub const SBET: Kind = Kind {
    name: "SBET",
    numbers: &[
        ("time", WEEK + 1.0),
        ("lat", FRAC_PI_2),
        ("lon", TAU),
        ("height", 1e6),
        ("vel_x", 1e4),
        ("vel_y", 1e4),
        ("vel_z", 1e4),
        ("roll", TAU),
        ("pitch", TAU),
        ("platform_heading", TAU),
        ("wander", TAU),
        ("accel_x", 1e4),
        ("accel_y", 1e4),
        ("accel_z", 1e4),
        ("rate_x", 1e3),
        ("rate_y", 1e3),
        ("rate_z", 1e3),
    ],
};

/// Increments of an inertial unit.
pub const KF_GINS: Kind = Kind {
    name: "IMU",
    numbers: &[
        ("time", WEEK + 1.0),
        ("dtheta_x", 10.0),
        ("dtheta_y", 10.0),
        ("dtheta_z", 10.0),
        ("dvel_x", 1e3),
        ("dvel_y", 1e3),
        ("dvel_z", 1e3),
    ],
};

impl Kind {
    /// Tests whether bytes without a mark are a recording: nearly all of them are records, their
    /// times increase evenly, a trajectory leaves 0 N 0 E, and increments of the velocity hold
    /// gravity.
    pub fn is_recording(&'static self, bytes: &[u8]) -> bool {
        let mut frames = Frames::new(Cursor::new(bytes), self);
        let mut rows: Vec<Vec<f64>> = Vec::new();
        while let Ok(Some(frame)) = frames.next() {
            rows.push(numbers(frame.bytes).collect());
        }
        let size = 8 * self.numbers.len();
        let nearly_all = |part: usize, all: usize| part as f64 >= NEARLY_ALL * all as f64;
        if rows.len() < FEWEST || !nearly_all(rows.len() * size, bytes.len() - bytes.len() % size) {
            return false;
        }
        // the seconds of the week begin again
        let step = |r: &[Vec<f64>]| (r[1][0] - r[0][0]).rem_euclid(WEEK);
        let steps: Vec<f64> = rows.windows(2).map(step).collect();
        let usual = median(steps.clone());
        let even = steps.iter().filter(|step| (0.5 * usual..=1.5 * usual).contains(*step)).count();
        let force = |row: &Vec<f64>| row[4..7].iter().map(|v| v * v).sum::<f64>().sqrt() / usual;
        let sound = match self.numbers[1].0 {
            "lat" => rows.iter().all(|row| row[1] != 0.0 && row[2] != 0.0),
            _ => FORCES.contains(&median(rows.iter().map(force).collect())),
        };
        INTERVALS.contains(&usual) && nearly_all(even, steps.len()) && sound
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

impl Framing for &'static Kind {
    const MAX: usize = 17 * 8;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        // no mark: a record may begin at any byte
        (!bytes.is_empty()).then_some(0)
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let size = 8 * self.numbers.len();
        let Some(record) = bytes.get(..size) else { return Judgement::Incomplete };
        let plausible = |(value, (_, most)): (f64, &(&str, f64))| {
            value == 0.0 || (SMALLEST..=*most).contains(&value.abs())
        };
        let mut values = numbers(record);
        match values.by_ref().next() {
            Some(time) if (0.0..=WEEK).contains(&time) => {}
            _ => return Judgement::Rejected(Fault::Form),
        }
        match values.zip(&self.numbers[1..]).all(plausible) {
            true => Judgement::Frame(size),
            false => Judgement::Rejected(Fault::Form),
        }
    }
}

fn numbers(bytes: &[u8]) -> impl Iterator<Item = f64> + '_ {
    let (chunks, _) = bytes.as_chunks::<8>();
    chunks.iter().map(|b| f64::from_le_bytes(*b))
}

/// The reader of such records.
#[derive(Debug)]
pub struct Doubles<R> {
    frames: Frames<R, &'static Kind>,
    options: Options,
    topics: [Topic; 1],
    /// Time of the record before, and the weeks since the first.
    last: f64,
    weeks: i64,
}

impl<R: Read> Doubles<R> {
    /// The records of `reader`.
    pub fn new(reader: R, kind: &'static Kind, options: Options) -> Self {
        let fields = kind.numbers.iter().map(|(name, _)| (*name).to_owned()).collect();
        let topics = [Topic { name: kind.name.to_owned(), instance: 0, fields }];
        Self { frames: Frames::new(reader, kind), options, topics, last: 0.0, weeks: 0 }
    }
}

impl<R: Read + Send> Decoder for Doubles<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        let Some(frame) = self.frames.next()? else { return Ok(None) };
        values.clear();
        values.extend(numbers(frame.bytes));
        // the week passed, or passed back, if the time changes by over half of it
        let change = values[0] - self.last;
        if self.last > 0.0 && change.abs() > 0.5 * WEEK {
            self.weeks -= change.signum() as i64;
        }
        self.last = values[0];
        let stamp = of_week(self.options.week, self.weeks, values[0]);
        Ok(Some(Record { offset: frame.offset, topic: 0, stamp }))
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}
