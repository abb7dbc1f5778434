//! Binary messages of VectorNav units: `0xFA`, the groups of outputs, the outputs of each group, their
//! values, and a CRC.
//!
//! A user chooses the outputs, so one message may have an inertial unit, a receiver and the unit's own
//! solution: the reader gives a record for each. Times count since the unit was switched on, where a
//! message has this time, else they are GPS time.

use crate::checksum::crc16;
use crate::record::{Decoder, Options, Record, Topic};
use crate::text::gps_nanos;
use navfuse_frames::Number::{self, F32, F64, U8, U16, U64};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{self, Read};

/// First byte of a message.
const MARK: u8 = 0xfa;
/// Size in bytes of the CRC, and largest size of a message.
const CHECK: usize = 2;
const LARGEST: usize = 2048;
/// Number of groups, and of the outputs of one.
const GROUPS: usize = 7;
const OUTPUTS: usize = 15;
/// A group bit of further groups, and an output bit of further outputs, of which nothing is known.
const FURTHER: u8 = 0x80;
const MORE: u16 = 0x8000;
/// Sizes in bytes of the outputs of a receiver; a list of satellites has two bytes and eight for each.
const RECEIVER: [u8; OUTPUTS] = [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 2];
const SATELLITES: usize = 14;
const SATELLITE: usize = 8;
/// Sizes in bytes of the outputs: common, time, inertial unit, receiver, attitude, solution, second
/// receiver. Zero for one that does not exist.
const SIZES: [[u8; OUTPUTS]; GROUPS] = [
    [8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8],
    [8, 8, 8, 2, 8, 8, 8, 4, 4, 1, 0, 0, 0, 0, 0],
    [2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40, 0, 0],
    RECEIVER,
    [2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12, 0, 0],
    [2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64, 0, 0],
    RECEIVER,
];
/// Groups.
const COMMON: usize = 0;
const TIME: usize = 1;
const INERTIAL: usize = 2;
const FIRST: usize = 3;
const ATTITUDE: usize = 4;
const SOLUTION: usize = 5;
const SECOND: usize = 6;
/// Longest age of a fix, ns.
const OLDEST: i64 = 2_000_000_000;

/// Where a number stands: its group, its output, its offset and type, and the factor of its unit.
type Place = (usize, usize, usize, Number, f64);

const fn vector(group: usize, output: usize, offset: usize, factor: f64) -> [Place; 3] {
    [
        (group, output, offset, F32, factor),
        (group, output, offset + 4, F32, factor),
        (group, output, offset + 8, F32, factor),
    ]
}

/// Three numbers with alternatives, of which the first that a message has is used.
type Vectors = &'static [[Place; 3]];

/// A kind of record: a name, and its numbers three by three. A message without the first three has
/// none.
struct Kind {
    name: &'static str,
    fields: &'static [[&'static str; 3]],
    vectors: &'static [Vectors],
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

const fn receiver(name: &'static str, group: usize) -> Kind {
    const FIELDS: [[&str; 3]; 5] = [
        ["lat", "lon", "height"],
        ["fix_type", "satellites", "tow"],
        ["vel_n", "vel_e", "vel_d"],
        ["n_acc", "e_acc", "v_acc"],
        ["s_acc", "t_acc", "pdop"],
    ];
    const fn places(group: usize) -> [[Place; 3]; 5] {
        [
            [(group, 5, 0, F64, 1.0), (group, 5, 8, F64, 1.0), (group, 5, 16, F64, 1.0)],
            [(group, 4, 0, U8, 1.0), (group, 3, 0, U8, 1.0), (group, 1, 0, U64, 1e-9)],
            vector(group, 7, 0, 1.0),
            vector(group, 9, 0, 1.0),
            [(group, 10, 0, F32, 1.0), (group, 11, 0, F32, 1.0), (group, 13, 4, F32, 1.0)],
        ]
    }
    const ONE: [[Place; 3]; 5] = places(FIRST);
    const TWO: [[Place; 3]; 5] = places(SECOND);
    const VECTORS_1: [Vectors; 5] = [&[ONE[0]], &[ONE[1]], &[ONE[2]], &[ONE[3]], &[ONE[4]]];
    const VECTORS_2: [Vectors; 5] = [&[TWO[0]], &[TWO[1]], &[TWO[2]], &[TWO[3]], &[TWO[4]]];
    Kind { name, fields: &FIELDS, vectors: if group == FIRST { &VECTORS_1 } else { &VECTORS_2 } }
}

/// The kinds of records. Measurements of the inertial unit without the corrections of its own filter come
/// first: the corrections change while it runs.
const KINDS: [Kind; 6] = [
    Kind {
        name: "VN-DELTA",
        fields: &[["dtheta_x", "dtheta_y", "dtheta_z"], ["dvel_x", "dvel_y", "dvel_z"]],
        vectors: &[
            &[vector(COMMON, 11, 4, DEGREE), vector(INERTIAL, 6, 4, DEGREE)],
            &[vector(COMMON, 11, 16, 1.0), vector(INERTIAL, 7, 0, 1.0)],
        ],
    },
    Kind {
        name: "VN-IMU",
        fields: &[["gyro_x", "gyro_y", "gyro_z"], ["accel_x", "accel_y", "accel_z"]],
        vectors: &[
            &[
                vector(COMMON, 9, 12, 1.0),
                vector(INERTIAL, 3, 0, 1.0),
                vector(COMMON, 5, 0, 1.0),
                vector(INERTIAL, 10, 0, 1.0),
            ],
            &[
                vector(COMMON, 9, 0, 1.0),
                vector(INERTIAL, 2, 0, 1.0),
                vector(COMMON, 8, 0, 1.0),
                vector(INERTIAL, 9, 0, 1.0),
            ],
        ],
    },
    receiver("VN-GPS", FIRST),
    receiver("VN-GPS2", SECOND),
    Kind {
        name: "VN-INS",
        fields: &[
            ["lat", "lon", "height"],
            ["ins_status", "pos_acc", "vel_acc"],
            ["vel_n", "vel_e", "vel_d"],
            ["yaw", "pitch", "roll"],
        ],
        vectors: &[
            &[
                [
                    (SOLUTION, 1, 0, F64, 1.0),
                    (SOLUTION, 1, 8, F64, 1.0),
                    (SOLUTION, 1, 16, F64, 1.0),
                ],
                [(COMMON, 6, 0, F64, 1.0), (COMMON, 6, 8, F64, 1.0), (COMMON, 6, 16, F64, 1.0)],
            ],
            &[
                [
                    (SOLUTION, 0, 0, U16, 1.0),
                    (SOLUTION, 9, 0, F32, 1.0),
                    (SOLUTION, 10, 0, F32, 1.0),
                ],
                [
                    (COMMON, 12, 0, U16, 1.0),
                    (SOLUTION, 9, 0, F32, 1.0),
                    (SOLUTION, 10, 0, F32, 1.0),
                ],
            ],
            &[vector(SOLUTION, 4, 0, 1.0), vector(COMMON, 7, 0, 1.0)],
            &[vector(ATTITUDE, 1, 0, 1.0), vector(COMMON, 3, 0, 1.0)],
        ],
    },
    Kind {
        name: "VN-ATTITUDE",
        fields: &[["yaw", "pitch", "roll"]],
        vectors: &[&[vector(ATTITUDE, 1, 0, 1.0), vector(COMMON, 3, 0, 1.0)]],
    },
];
/// Indices of the first and the last receiver among the kinds, and of the solution.
const RECEIVERS: std::ops::RangeInclusive<usize> = 2..=3;
const INS: usize = 4;

/// Offsets of the outputs in a message; zero for one that it has not.
type Offsets = [[u16; OUTPUTS]; GROUPS];

/// The size of a message and the offsets of its outputs.
struct Plan {
    size: usize,
    offsets: Offsets,
}

/// The layout that the header of a message describes; `None` where it goes on beyond these bytes.
///
/// # Errors
/// When the header names groups or outputs that are not known.
fn layout(bytes: &[u8]) -> Result<Option<Plan>, Fault> {
    let Some(groups) = bytes.get(1) else { return Ok(None) };
    if *groups == 0 || groups & FURTHER != 0 {
        return Err(Fault::Form);
    }
    let chosen = (0..GROUPS).filter(|k| groups >> k & 1 == 1);
    let mut at = 2 + 2 * chosen.clone().count();
    let mut offsets = [[0; OUTPUTS]; GROUPS];
    for (k, group) in chosen.enumerate() {
        let Some(field) = bytes.get(2 + 2 * k..).and_then(|b| b.first_chunk()) else {
            return Ok(None);
        };
        let field = u16::from_le_bytes(*field);
        if field & MORE != 0 {
            return Err(Fault::Form);
        }
        let mut rest = field;
        while rest != 0 {
            let output = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let size = usize::from(SIZES[group][output]);
            if size == 0 || at + size + CHECK > LARGEST {
                return Err(Fault::Form);
            }
            offsets[group][output] = at as u16;
            at += size;
            let receiver = group == FIRST || group == SECOND;
            if receiver && output == SATELLITES {
                let Some(count) = bytes.get(at - size) else { return Ok(None) };
                at += SATELLITE * usize::from(*count);
            }
        }
    }
    match at + CHECK <= LARGEST {
        true => Ok(Some(Plan { size: at + CHECK, offsets })),
        false => Err(Fault::Form),
    }
}

/// The framing of messages: the CRC over all after the mark, with the CRC itself, is zero.
#[derive(Debug)]
struct Messages;

impl Framing for Messages {
    const MAX: usize = LARGEST;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK)
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let size = match layout(bytes) {
            Ok(Some(plan)) => plan.size,
            Ok(None) => return Judgement::Incomplete,
            Err(fault) => return Judgement::Rejected(fault),
        };
        match bytes.get(1..size) {
            None => Judgement::Incomplete,
            Some(checked) if crc16(checked) == 0 => Judgement::Frame(size),
            Some(_) => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// The reader of binary messages.
pub struct VectornavBinary<R> {
    frames: Frames<R, Messages>,
    options: Options,
    topics: Vec<Topic>,
    /// The newest message with its offset in the file and its layout, and the kinds that are still to be
    /// looked for.
    message: (u64, Vec<u8>),
    offsets: Offsets,
    next: usize,
    /// The newest fix of each receiver, which a message may repeat.
    fixes: [Vec<u64>; 2],
}

impl<R: Read> VectornavBinary<R> {
    /// The messages of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let (topics, message) = (Vec::new(), (0, Vec::new()));
        let (frames, fixes) = (Frames::new(reader, Messages), Default::default());
        let offsets = [[0; OUTPUTS]; GROUPS];
        Self { frames, options, topics, message, offsets, next: KINDS.len(), fixes }
    }

    fn topic(&mut self, kind: &Kind) -> usize {
        if let Some(known) = self.topics.iter().position(|t| t.name == kind.name) {
            return known;
        }
        let fields = kind.fields.iter().flatten().map(|f| (*f).to_owned()).collect();
        self.topics.push(Topic { name: kind.name.to_owned(), instance: 0, fields });
        self.topics.len() - 1
    }

    /// Tests whether a fix is the one before; the newest fix is remembered.
    fn repeats(&mut self, kind: usize, values: &[f64]) -> bool {
        if !RECEIVERS.contains(&kind) {
            return false;
        }
        let fix = values.iter().map(|v| v.to_bits());
        let known = &mut self.fixes[kind - RECEIVERS.start()];
        let same = known.iter().copied().eq(fix.clone());
        known.clear();
        known.extend(fix);
        same
    }
}

/// A message with its layout.
struct Message<'a> {
    bytes: &'a [u8],
    offsets: &'a Offsets,
}

impl Message<'_> {
    fn number(&self, (group, output, offset, kind, factor): Place) -> f64 {
        match usize::from(self.offsets[group][output]) {
            0 => f64::NAN,
            at => {
                let bytes = self.bytes.get(at + offset..).unwrap_or_default();
                kind.read::<true>(bytes) * factor
            }
        }
    }

    /// Nanoseconds of an output of 64 bits; `None` for zero, which is no time.
    fn nanos(&self, outputs: &[(usize, usize)]) -> Option<i64> {
        outputs.iter().find_map(|(group, output)| {
            let at = usize::from(self.offsets[*group][*output]);
            let bytes = self.bytes.get(at..).filter(|_| at > 0)?;
            i64::try_from(u64::from_le_bytes(*bytes.first_chunk()?)).ok().filter(|t| *t > 0)
        })
    }

    /// The numbers of a kind; `false` where the message has not its first three.
    fn read(&self, kind: &Kind, values: &mut Vec<f64>) -> bool {
        values.clear();
        for vectors in kind.vectors {
            let has = |places: &&[Place; 3]| self.offsets[places[0].0][places[0].1] > 0;
            let places = vectors.iter().find(has);
            values.extend((0..3).map(|k| places.map_or(f64::NAN, |p| self.number(p[k]))));
        }
        !values[0].is_nan()
    }

    /// The time of the message, and how old the fix of a receiver is.
    fn stamp(&self, kind: usize) -> Stamp {
        let started = self.nanos(&[(COMMON, 0), (TIME, 0)]);
        let gps = self.nanos(&[(COMMON, 1), (TIME, 1)]);
        let Some(time) = started.or_else(|| gps.map(gps_nanos)) else { return Stamp::Missing };
        if !RECEIVERS.contains(&kind) {
            return Stamp::Date(time);
        }
        let group = if kind == *RECEIVERS.start() { FIRST } else { SECOND };
        let week = self.number((group, 2, 0, U16, 1.0));
        let fix = self.nanos(&[(group, 1)]).filter(|_| week > 0.0);
        let weeks = (week as i64).checked_mul(navfuse_core::units::calendar::WEEK);
        let fix = fix.zip(weeks).and_then(|(tow, weeks)| tow.checked_add(weeks));
        let age = gps.zip(fix).map(|(now, fix)| now - fix).filter(|age| (0..OLDEST).contains(age));
        Stamp::Date(time - age.unwrap_or(0))
    }
}

impl<R: Read + Send> Decoder for VectornavBinary<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> io::Result<Option<Record>> {
        loop {
            if self.next == KINDS.len() {
                let Some(frame) = self.frames.next()? else { return Ok(None) };
                self.message.0 = frame.offset;
                self.message.1.clear();
                self.message.1.extend_from_slice(frame.bytes);
                let Ok(Some(plan)) = layout(frame.bytes) else { continue };
                (self.offsets, self.next) = (plan.offsets, 0);
            }
            let (index, kind) = (self.next, &KINDS[self.next]);
            self.next += 1;
            if !self.options.selects(kind.name) {
                continue;
            }
            let message = Message { bytes: &self.message.1, offsets: &self.offsets };
            if !message.read(kind, values) {
                continue;
            }
            if index == INS {
                // the lower two bits are the mode, which tracks from 2 on
                values[3] = f64::from(values[3] as u32 & 3);
            }
            let stamp = message.stamp(index);
            if self.repeats(index, values) {
                continue;
            }
            let (offset, topic) = (self.message.0, self.topic(kind));
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
