//! Teledyne PD6: sentences without a checksum, several for each ensemble.
//!
//! `:SA` begins an ensemble, `:TS` has its time and depth, `:WI` and `:BI` the velocities of the
//! vehicle along the instrument's axes. The same velocities along other axes (`:WS`, `:BE`, ...)
//! are not needed.

use crate::ping::{Attitude, Coordinates, Decoder, Ping, Stamp, TrackedVelocity};
use crate::teledyne::{Convention, Mounting};
use crate::text::{fields, number, two_digits};
use navfuse_core::units::calendar::{Calendar, with_century};
use navfuse_frames::{Check, Damage, Frames, Sentences};
use std::io::{Read, Result};

/// Velocity in mm/s that marks a bad one.
const BAD: f64 = -32_768.0;
/// The framing of the sentences.
const SENTENCES: Sentences =
    Sentences { marks: b":", check: Check::None, marks_are_reserved: true };
/// Names of the sentences that PD6 has.
const NAMES: [&[u8]; 11] =
    [b"SA", b"TS", b"WI", b"WS", b"WE", b"WD", b"BI", b"BS", b"BE", b"BD", b"HM"];

/// The reader of PD6.
#[derive(Debug)]
pub struct Pd6<R> {
    frames: Frames<R, Sentences>,
    /// The ensemble that is read.
    ping: Option<Ping>,
}

impl<R: Read> Pd6<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        Self { frames: Frames::new(reader, SENTENCES), ping: None }
    }
}

impl<R: Read + Send> Decoder for Pd6<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(self.ping.take()) };
            let content = SENTENCES.content(frame.bytes);
            let (name, rest) = content.split_at(content.len().min(2));
            // a sentence that the ensemble has already begins the next one, whose :SA was lost
            let begins = name == b"SA" || self.ping.as_ref().is_some_and(|p| has(p, name));
            let known = NAMES.contains(&name) && rest.first() == Some(&b',');
            let mut ping = match self.ping {
                Some(ping) if !begins => ping,
                _ => Ping { offset: frame.offset, ..Ping::default() },
            };
            let intact = known && sentence(&mut ping, name, &rest[1..]).is_some();
            if !intact {
                self.frames.reject_last();
                if !begins {
                    continue;
                }
            }
            let before = self.ping.replace(ping);
            if begins && before.is_some() {
                return Ok(before);
            }
        }
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}

/// Tests whether an ensemble has the content of a sentence.
fn has(ping: &Ping, name: &[u8]) -> bool {
    match name {
        b"TS" => ping.sound_speed.is_some(),
        b"BI" => ping.bottom.is_some(),
        b"WI" => ping.water.is_some(),
        _ => false,
    }
}

/// Adds a sentence to its ensemble; `None` if its fields do not follow the format.
fn sentence(ping: &mut Ping, name: &[u8], content: &[u8]) -> Option<()> {
    let mut fields = fields(content);
    match name {
        b"SA" => {
            let mut angle = || number(&mut fields).map(f64::to_radians);
            let (pitch, roll, heading) = (angle()?, angle()?, angle()?);
            ping.attitude = Some(Attitude { heading, pitch, roll });
        }
        b"TS" => {
            let stamp = fields.next().filter(|s| s.len() == 14)?;
            let [year, month, day, hour, minute, second, hundredth] =
                [0, 2, 4, 6, 8, 10, 12].map(|at| two_digits(stamp, at));
            let calendar = Calendar {
                year: with_century(year?),
                month: month?,
                day: day?,
                hour: hour?,
                minute: minute?,
                second: second?,
                nanos: u32::from(hundredth?) * 10_000_000,
            };
            let (_salinity, _temperature) = (number(&mut fields)?, number(&mut fields)?);
            let (depth, sound) = (number(&mut fields)?, number(&mut fields)?);
            ping.stamp = calendar.unix_nanos().map_or(Stamp::Missing, Stamp::Date);
            (ping.depth, ping.sound_speed) = (Some(depth), Some(sound));
        }
        b"BI" | b"WI" => {
            let mut velocity = || number(&mut fields);
            let mm = [velocity()?, velocity()?, velocity()?, velocity()?];
            let good = match fields.next()? {
                "A" => true,
                "V" => false,
                _ => return None,
            };
            let recorded = mm.map(|v| (good && v != BAD).then_some(v * 1e-3));
            let convention = Convention {
                coordinates: Coordinates::Instrument,
                janus: None,
                mounting: Mounting::default(),
                attitude: None,
                sign: 1.0,
            };
            let track: TrackedVelocity = convention.track(recorded);
            if name == b"BI" { ping.bottom = Some(track) } else { ping.water = Some(track) }
        }
        _ => {}
    }
    Some(())
}
