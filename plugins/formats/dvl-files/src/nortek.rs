//! Nortek NMEA: bottom track (`$PNORBT...`) and water track (`$PNORWT...`).
//!
//! `$PNORBT`, `$PNORBT0` and `$PNORBT1` have one beam in each sentence; the sentences of one time
//! are one ping. `$PNORBT6` to `$PNORBT9` have the axes. The even ones and those with an odd number
//! differ only in the names of the fields. `$PNORBT3` and `$PNORBT4` have a speed and a direction,
//! which are no velocity along the instrument's axes.

use crate::ping::{Coordinates, Decoder, Ping, Stamp, TrackedVelocity};
use crate::text::{fields, number, two_digits, value};
use navfuse_core::units::calendar::{Calendar, SECOND, decimal_seconds, with_century};
use navfuse_frames::validity::{is_trusted, is_velocity};
use navfuse_frames::{Damage, Frames, Sentences};
use std::io::{Read, Result};

/// The reader of Nortek's NMEA sentences.
#[derive(Debug)]
pub struct NortekNmea<R> {
    frames: Frames<R, Sentences>,
    /// A ping of single beams that may not be complete.
    beams: Option<Ping>,
    /// A ping that waits until that of the beams is given.
    waiting: Option<Ping>,
}

impl<R: Read> NortekNmea<R> {
    /// The pings of `reader`.
    pub fn new(reader: R) -> Self {
        Self { frames: Frames::new(reader, Sentences::NMEA), beams: None, waiting: None }
    }
}

impl<R: Read + Send> Decoder for NortekNmea<R> {
    fn next(&mut self) -> Result<Option<Ping>> {
        if let Some(ping) = self.waiting.take() {
            return Ok(Some(ping));
        }
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(self.beams.take()) };
            match Sentence::read(frame.offset, Sentences::NMEA.content(frame.bytes)) {
                Sentence::Damaged => self.frames.reject_last(),
                Sentence::Other => {}
                Sentence::Beam(index, ping) => {
                    let joined = self.beams.as_mut().is_some_and(|p| joins(p, index, &ping));
                    if !joined && let Some(before) = self.beams.replace(ping) {
                        return Ok(Some(before));
                    }
                }
                Sentence::Axes(ping) => {
                    return Ok(Some(match self.beams.take() {
                        Some(before) => {
                            self.waiting = Some(ping);
                            before
                        }
                        None => ping,
                    }));
                }
            }
        }
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}

/// The content of an intact sentence.
enum Sentence {
    /// The velocity along the beam of this index.
    Beam(usize, Ping),
    /// The velocity along the axes.
    Axes(Ping),
    /// A sentence that this reader does not need.
    Other,
    /// The fields do not follow the format.
    Damaged,
}

impl Sentence {
    fn read(offset: u64, content: &[u8]) -> Self {
        let mut fields = fields(content);
        let whole = |ping: Option<Ping>| match ping {
            Some(ping) => Self::Axes(Ping { offset, ..ping }),
            None => Self::Damaged,
        };
        match fields.next().unwrap_or_default() {
            "PNORBT" | "PNORBT0" | "PNORBT1" => match beam(&mut fields, offset) {
                Some((index, ping)) => Self::Beam(index, ping),
                None => Self::Damaged,
            },
            "PNORBT6" | "PNORBT7" | "PNORBT8" | "PNORBT9" => whole(axes(&mut fields, false)),
            "PNORWT6" | "PNORWT7" | "PNORWT8" | "PNORWT9" => whole(axes(&mut fields, true)),
            _ => Self::Other,
        }
    }
}

/// Adds a beam to a ping of the same time that lacks it; `false` if there is no such ping.
fn joins(ping: &mut Ping, number: usize, other: &Ping) -> bool {
    let (Some(track), Some(new)) = (&mut ping.bottom, &other.bottom) else { return false };
    let fresh = track.range[number].is_none() && track.recorded[number].is_none();
    if ping.stamp != other.stamp || !fresh {
        return false;
    }
    track.recorded[number] = new.recorded[number];
    track.range[number] = new.range[number];
    track.beams = Some(track.recorded);
    let merits = [track.figure_of_merit, new.figure_of_merit];
    track.figure_of_merit = merits.into_iter().flatten().reduce(f64::max);
    true
}

/// Reads a sentence of one beam; returns the index of the beam too.
fn beam<'a>(fields: &mut impl Iterator<Item = &'a str>, offset: u64) -> Option<(usize, Ping)> {
    let beam: usize = value(fields)?;
    let index = beam.checked_sub(1).filter(|k| *k < 4)?;
    let (date, time) = (fields.next()?, fields.next()?);
    let (_trigger, _output) = (number(fields)?, number(fields)?);
    let (velocity, merit, distance) = (number(fields)?, number(fields)?, number(fields)?);
    let mut track =
        TrackedVelocity { coordinates: Coordinates::Beam, ..TrackedVelocity::default() };
    track.recorded[index] = Some(velocity).filter(|v| is_velocity(*v) && is_trusted(merit));
    track.range[index] = Some(distance).filter(|d| *d > 0.0);
    track.beams = Some(track.recorded);
    track.figure_of_merit = Some(merit).filter(|_| track.recorded[index].is_some());
    let stamp = date_and_time(date, time).map_or(Stamp::Missing, Stamp::Date);
    Some((index, Ping { offset, stamp, bottom: Some(track), ..Ping::default() }))
}

/// Reads MMDDYY and hhmmss.ssss.
fn date_and_time(date: &str, time: &str) -> Option<i64> {
    let (second, nanos) = decimal_seconds(time.get(4..)?.as_bytes())?;
    Calendar {
        year: with_century(two_digits(date, 4)?),
        month: two_digits(date, 0)?,
        day: two_digits(date, 2)?,
        hour: two_digits(time, 0)?,
        minute: two_digits(time, 2)?,
        second,
        nanos,
    }
    .unix_nanos()
}

/// Reads a sentence of the three axes.
fn axes<'a>(fields: &mut impl Iterator<Item = &'a str>, water: bool) -> Option<Ping> {
    let seconds = fields.next()?;
    let (_trigger, _output) = (number(fields)?, number(fields)?);
    let mut axis = || number(fields);
    let velocity = [axis()?, axis()?, axis()?];
    let merit = number(fields)?;
    let [x, y, z] = velocity.map(|v| Some(v).filter(|v| is_velocity(*v) && is_trusted(merit)));
    let mut range = [None; 4];
    for distance in &mut range {
        *distance = Some(number(fields)?).filter(|d| *d > 0.0);
    }
    let track = TrackedVelocity {
        coordinates: Coordinates::Instrument,
        recorded: [x, y, z, None],
        axes: x.zip(y).zip(z).map(|((x, y), z)| [x, y, z]),
        range,
        figure_of_merit: Some(merit),
        ..TrackedVelocity::default()
    };
    let mut ping = Ping { stamp: unix_time(seconds), ..Ping::default() };
    if water {
        ping.water = Some(track)
    } else {
        ping.bottom = Some(track)
    }
    Some(ping)
}

/// Reads seconds since 1970 with decimals; zero is no time.
fn unix_time(text: &str) -> Stamp {
    let (whole, decimals) = text.split_once('.').unwrap_or((text, "0"));
    let nanos = || {
        let whole: i64 = whole.parse().ok()?;
        let (_, nanos) = decimal_seconds(format!("0.{decimals}").as_bytes())?;
        whole.checked_mul(SECOND)?.checked_add(i64::from(nanos)).filter(|n| *n > 0)
    };
    nanos().map_or(Stamp::Missing, Stamp::Date)
}
