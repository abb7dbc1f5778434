//! SBG ECom: the binary logs of SBG's inertial units, of which the class 0 has the measurements.
//!
//! Each log has the microseconds since the unit was switched on, in 32 bits that begin anew after
//! 71.6 minutes: the reader counts on.

use crate::checksum::crc16_reflected;
use crate::packed::{Packed, Place, Topics};
use crate::record::{Decoder, Options, Record, Topic};
use navfuse_frames::Number::{F32, F64, I32, U8, U16, U32};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// First bytes of a log, and its last one.
const MARK: [u8; 2] = [0xff, 0x5a];
const END: u8 = 0x33;
/// Size in bytes of mark, number, class and length, and of checksum and end.
const HEADER: usize = 6;
const TAIL: usize = 3;
/// Largest payload in bytes.
const PAYLOAD: usize = 4086;
/// Numbers of the logs.
const IMU_DATA: u32 = 3;
const IMU_SHORT: u32 = 44;
const DEPTH: u32 = 47;
/// Logs that begin with the time since the unit was switched on.
const TIMED: [u32; 14] = [1, 2, IMU_DATA, 6, 7, 8, 13, 14, 16, 17, 19, 29, 30, IMU_SHORT];
/// Counts of an `IMU_SHORT` in a metre per second squared, and in a radian per second in the usual and
/// in the large range of the gyros, which a bit of the status tells.
const ACCEL: f64 = 1_048_576.0;
const GYRO: f64 = 67_108_864.0;
const LARGE: f64 = 12_304_174.0;
const LARGE_RANGE: u32 = 1 << 10;

/// What makes a log valid, by its status.
#[derive(Clone, Copy, Debug)]
enum Valid {
    /// Bits that must be set, and bits that must not.
    Bits(u32, u32),
    /// The lower six bits are zero for a solution, and the six bits above are its type.
    Computed,
}

/// Communication, self test, and the tests of each axis.
const HEALTHY: Valid = Valid::Bits(0xff, 0);

const fn log(id: u32, name: &'static str, places: &'static [Place]) -> Packed {
    Packed { id, name, places }
}

const POSITION: &[Place] = &[
    ("status", 4, U32),
    ("lat", 12, F64),
    ("lon", 20, F64),
    ("altitude", 28, F64),
    ("undulation", 36, F32),
    ("lat_acc", 40, F32),
    ("lon_acc", 44, F32),
    ("alt_acc", 48, F32),
    ("satellites", 52, U8),
];
const VELOCITY: &[Place] = &[
    ("status", 4, U32),
    ("vel_n", 12, F32),
    ("vel_e", 16, F32),
    ("vel_d", 20, F32),
    ("acc_n", 24, F32),
    ("acc_e", 28, F32),
    ("acc_d", 32, F32),
];
const TRACK: &[Place] =
    &[("status", 4, U16), ("vel_x", 6, F32), ("vel_y", 10, F32), ("vel_z", 14, F32)];

/// The logs, whose first number is their status.
const KINDS: &[Packed] = &[
    log(
        IMU_SHORT,
        "IMU_SHORT",
        &[
            ("status", 4, U16),
            ("accel_x", 6, I32),
            ("accel_y", 10, I32),
            ("accel_z", 14, I32),
            ("gyro_x", 18, I32),
            ("gyro_y", 22, I32),
            ("gyro_z", 26, I32),
        ],
    ),
    log(
        IMU_DATA,
        "IMU_DATA",
        &[
            ("status", 4, U16),
            ("accel_x", 6, F32),
            ("accel_y", 10, F32),
            ("accel_z", 14, F32),
            ("gyro_x", 18, F32),
            ("gyro_y", 22, F32),
            ("gyro_z", 26, F32),
        ],
    ),
    log(
        6,
        "EKF_EULER",
        &[("status", 28, U32), ("roll", 4, F32), ("pitch", 8, F32), ("yaw", 12, F32)],
    ),
    log(
        8,
        "EKF_NAV",
        &[
            ("status", 68, U32),
            ("vel_n", 4, F32),
            ("vel_e", 8, F32),
            ("vel_d", 12, F32),
            ("lat", 28, F64),
            ("lon", 36, F64),
            ("altitude", 44, F64),
            ("undulation", 52, F32),
        ],
    ),
    log(14, "GPS1_POS", POSITION),
    log(13, "GPS1_VEL", VELOCITY),
    log(17, "GPS2_POS", POSITION),
    log(16, "GPS2_VEL", VELOCITY),
    log(15, "GPS1_HDT", &[("status", 4, U16), ("heading", 10, F32), ("accuracy", 14, F32)]),
    log(29, "DVL_BOTTOM_TRACK", TRACK),
    log(30, "DVL_WATER_TRACK", TRACK),
    log(DEPTH, "DEPTH", &[("status", 4, U16), ("pressure", 6, F32), ("altitude", 10, F32)]),
    log(19, "ODO_VEL", &[("status", 4, U16), ("speed", 6, F32)]),
];

/// What makes a log of a number valid.
fn valid(id: u32) -> Valid {
    match id {
        IMU_DATA | IMU_SHORT => HEALTHY,
        // roll and pitch; velocity and position
        6 => Valid::Bits(1 << 4, 0),
        8 => Valid::Bits(1 << 6 | 1 << 7, 0),
        13..=17 => Valid::Computed,
        // an altitude, whose time is no delay
        DEPTH => Valid::Bits(1 << 2, 1),
        _ => Valid::Bits(1, 0),
    }
}

impl Valid {
    /// The type of a solution, 1 for another valid log, 0 for an invalid one.
    fn of(self, status: u32) -> f64 {
        let valid = match self {
            Self::Bits(set, clear) => u32::from(status & set == set && status & clear == 0),
            Self::Computed if status & 0x3f == 0 => status >> 6 & 0x3f,
            Self::Computed => 0,
        };
        f64::from(valid)
    }
}

/// The framing of logs: marks, number, class, length, payload, checksum and a last byte.
#[derive(Debug)]
struct Logs;

impl Framing for Logs {
    const MAX: usize = HEADER + PAYLOAD + TAIL;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK[0])
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        if bytes.get(1).is_some_and(|second| *second != MARK[1]) {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(header) = bytes.first_chunk::<HEADER>() else { return Judgement::Incomplete };
        let end = HEADER + usize::from(u16::from_le_bytes([header[4], header[5]]));
        if end > HEADER + PAYLOAD {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(&[low, high, last]) = bytes.get(end..).and_then(|tail| tail.first_chunk()) else {
            return Judgement::Incomplete;
        };
        if last != END {
            return Judgement::Rejected(Fault::Form);
        }
        match crc16_reflected(&bytes[2..end]) == u16::from_le_bytes([low, high]) {
            true => Judgement::Frame(end + TAIL),
            false => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// The reader of SBG ECom.
#[derive(Debug)]
pub struct Sbg<R> {
    frames: Frames<R, Logs>,
    topics: Topics,
    /// The newest time, us, without the bits that a log lacks, and all of it.
    now: Option<(u32, i64)>,
}

impl<R: Read> Sbg<R> {
    /// The logs of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let topics = Topics::new(KINDS, options);
        Self { frames: Frames::new(reader, Logs), topics, now: None }
    }
}

/// The whole time, us, of the lower 32 bits: the one that is nearest to the newest time.
fn counted(now: &mut Option<(u32, i64)>, micros: u32) -> i64 {
    let whole = match *now {
        Some((before, whole)) => whole + i64::from(micros.wrapping_sub(before) as i32),
        None => i64::from(micros),
    };
    *now = Some((micros, whole));
    whole
}

/// The metres per second squared and radians per second of an `IMU_SHORT`.
fn scale(values: &mut [f64], status: u32) {
    let gyro = if status & LARGE_RANGE == 0 { GYRO } else { LARGE };
    let units = [1.0, ACCEL, ACCEL, ACCEL, gyro, gyro, gyro];
    values.iter_mut().zip(units).for_each(|(value, unit)| *value /= unit);
}

impl<R: Read + Send> Decoder for Sbg<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, bytes) = (frame.offset, frame.bytes);
            let payload = &bytes[HEADER..bytes.len() - TAIL];
            let id = u32::from(bytes[2]);
            if bytes[3] != 0 {
                continue;
            }
            let micros = payload.first_chunk().map(|b| u32::from_le_bytes(*b));
            let micros = match micros {
                Some(micros) if TIMED.contains(&id) => Some(counted(&mut self.now, micros)),
                // it may have a delay instead, and its order is not that of the others
                Some(micros) => Some(counted(&mut self.now.clone(), micros)),
                None => None,
            };
            let Some((topic, kind)) = self.topics.of(id) else { continue };
            kind.read(payload, values);
            let Some(status) = values.first_mut().filter(|status| !status.is_nan()) else {
                continue;
            };
            let bits = *status as u32;
            *status = valid(id).of(bits);
            if id == IMU_SHORT {
                scale(values, bits);
            }
            let stamp = micros.and_then(|us| us.checked_mul(1000));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_goes_on_after_its_32_bits() {
        let mut now = None;
        let times = [4_294_967_000, 4_294_967_290, 4, 2, 10_000].map(|t| counted(&mut now, t));
        // 2^32 = 4 294 967 296
        assert_eq!(
            times,
            [4_294_967_000, 4_294_967_290, 4_294_967_300, 4_294_967_298, 4_294_977_296]
        );
    }

    #[test]
    fn the_range_of_the_gyros_follows_the_status() {
        // the numbers of SBG's own description: 1 m/s^2 and 1 rad/s
        for (status, count) in [(0, 67_108_864.0), (1 << 10, 12_304_174.0)] {
            let mut values = [1.0, 1_048_576.0, 0.0, 0.0, count, 0.0, 0.0];
            scale(&mut values, status);
            assert_eq!(values, [1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        }
    }
}
