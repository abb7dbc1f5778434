//! Teledyne PD4 and PD5: one binary record of fixed size for each ensemble.

use crate::bytes::{i16_at, sum, u8_at, u16_at};
use crate::ping::{Attitude, Decoder, Ping, Stamp, TrackedVelocity};
use crate::teledyne::{Convention, Mounting, coordinates, velocities};
use navfuse_core::units::calendar::time_of_day;
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement};
use std::io::{Read, Result};

/// First byte of a record.
const MARK: u8 = 0x7d;
/// Sizes in bytes of PD4 and PD5 without their checksums; the second byte is the index.
const SIZES: [u16; 2] = [45, 86];

/// The framing of the records: mark, structure, length, sum of all bytes.
#[derive(Debug)]
pub struct Records;

impl Framing for Records {
    const MAX: usize = 88;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK)
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let Some(structure) = u8_at(bytes, 1) else { return Judgement::Incomplete };
        let Some(size) = SIZES.get(usize::from(structure)) else {
            return Judgement::Rejected(Fault::Form);
        };
        match u16_at(bytes, 2) {
            Some(written) if written != *size => return Judgement::Rejected(Fault::Form),
            None => return Judgement::Incomplete,
            Some(_) => {}
        }
        let size = usize::from(*size);
        match (bytes.get(..size), u16_at(bytes, size)) {
            (Some(content), Some(written)) if sum(content) == written => Judgement::Frame(size + 2),
            (Some(_), Some(_)) => Judgement::Rejected(Fault::Checksum),
            _ => Judgement::Incomplete,
        }
    }
}

/// The reader of PD4 and PD5.
#[derive(Debug)]
pub struct Pd4<R>(Frames<R, Records>);

impl<R: Read> Pd4<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        Self(Frames::new(reader, Records))
    }
}

impl<R: Read + Send> Decoder for Pd4<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        Ok(self.0.next()?.map(|frame| record(frame.offset, frame.bytes)))
    }

    fn damage(&self) -> &Damage {
        self.0.damage()
    }
}

/// Decodes an intact record.
fn record(offset: u64, bytes: &[u8]) -> Ping {
    let system = bytes[4];
    // PD5 alone has depth and attitude
    let long = bytes[1] == 1;
    let hundredths = |x: f64| (x * 0.01).to_radians();
    let angle = |at| i16_at(bytes, at).map(|a| hundredths(f64::from(a)));
    let attitude = || {
        let heading = hundredths(f64::from(u16_at(bytes, 52)?));
        Some(Attitude { heading, pitch: angle(48)?, roll: angle(50)? })
    };
    let attitude = if long { attitude() } else { None };
    let convention = Convention {
        coordinates: coordinates(system >> 6),
        janus: None,
        mounting: Mounting { alignment: 0.0, tilts: system & 0x20 != 0, up: false },
        attitude,
        sign: 1.0,
    };
    let words = |at: usize| [0, 2, 4, 6].map(|k| i16_at(bytes, at + k));
    let ranges = [13, 15, 17, 19].map(|at| u16_at(bytes, at));
    let range = ranges.map(|r| r.filter(|r| *r > 0).map(|r| f64::from(r) * 0.01));
    let [hour, minute, second, hundredth] = [35, 36, 37, 38].map(|at| bytes[at]);
    let stamp = time_of_day(hour, minute, second, u32::from(hundredth) * 10_000_000)
        .map_or(Stamp::Missing, Stamp::TimeOfDay);
    Ping {
        offset,
        stamp,
        bottom: Some(TrackedVelocity { range, ..convention.track(velocities(words(5))) }),
        water: Some(convention.track(velocities(words(22)))),
        depth: u16_at(bytes, 46).filter(|_| long).map(|d| f64::from(d) * 0.1),
        attitude,
        sound_speed: u16_at(bytes, 41).filter(|c| *c > 0).map(f64::from),
    }
}
