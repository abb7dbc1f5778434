//! PSINS `.imu`: text with the counts of an inertial unit, after lines with their scale and interval.
//!
//! Comments begin with `%`, the first one names the format. Three lines of numbers follow: attitude
//! and velocity; latitude, longitude, height, first time in s, interval in ms and gravity; the scales
//! of a count, seconds of arc and 1e-6 g s. Then each line has six counts, along axes right, forward,
//! up.

use crate::record::{Decoder, Record, Topic};
use crate::text::number;
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// Beginning of the first line.
const MARK: &[u8] = b"% PSINS-format";
/// Radians of a second of arc.
const ARC_SECOND: f64 = std::f64::consts::PI / (180.0 * 3600.0);
/// Numbers of a line.
const WIDTH: usize = 6;
const FIELDS: [&str; WIDTH] = ["dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"];

/// The framing of lines, once the first one named the format.
#[derive(Debug, Default)]
struct Lines {
    begun: bool,
}

/// The numbers of a line, if it has six and nothing else.
fn numbers(line: &[u8]) -> Option<[f64; WIDTH]> {
    let mut cells = line.split(u8::is_ascii_whitespace).filter(|cell| !cell.is_empty());
    let mut values = [0.0; WIDTH];
    for value in &mut values {
        *value = number(cells.next()?);
    }
    (cells.next().is_none() && values.iter().all(|v| v.is_finite())).then_some(values)
}

impl Framing for Lines {
    const MAX: usize = 512;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        let begins = |b: &u8| if self.begun { !self.separates(*b) } else { *b == MARK[0] };
        bytes.iter().position(begins)
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let Some(end) = bytes.iter().take(Self::MAX).position(|b| *b == b'\n') else {
            let text = bytes.iter().all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace());
            return match text && bytes.len() < Self::MAX {
                true => Judgement::Incomplete,
                false => Judgement::Rejected(Fault::Form),
            };
        };
        let line = &bytes[..end];
        let fits = match self.begun {
            false => line.starts_with(MARK),
            true => line.first() == Some(&b'%') || numbers(line).is_some(),
        };
        if fits { Judgement::Frame(end + 1) } else { Judgement::Rejected(Fault::Form) }
    }

    fn separates(&self, byte: u8) -> bool {
        matches!(byte, b'\r' | b'\n')
    }
}

/// The reader of PSINS logs.
#[derive(Debug)]
pub struct Psins<R> {
    frames: Frames<R, Lines>,
    topics: [Topic; 1],
    /// The lines of numbers before the counts, and the number of lines of counts so far.
    before: Vec<[f64; WIDTH]>,
    count: u64,
}

impl<R: Read> Psins<R> {
    /// The increments of `reader`.
    pub fn new(reader: R) -> Self {
        let fields = FIELDS.map(str::to_owned).to_vec();
        let topics = [Topic { name: "PSINS".to_owned(), instance: 0, fields }];
        let frames = Frames::new(reader, Lines::default());
        Self { frames, topics, before: Vec::new(), count: 0 }
    }
}

/// Increments forward, right, down, rad and m/s, of counts along right, forward, up.
fn increments(counts: [f64; WIDTH], scales: [f64; WIDTH], gravity: f64) -> [f64; WIDTH] {
    let turned = |at: usize, unit: f64| {
        let [right, forward, up] = [0, 1, 2].map(|k| counts[at + k] * scales[at + k] * unit);
        [forward, right, -up]
    };
    let ([x, y, z], [u, v, w]) = (turned(0, ARC_SECOND), turned(3, 1e-6 * gravity));
    [x, y, z, u, v, w]
}

impl<R: Read + Send> Decoder for Psins<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, row) = (frame.offset, numbers(frame.bytes));
            self.frames.framing().begun = true;
            let Some(row) = row else { continue };
            let [_, [.., first, interval, gravity], scales] = *self.before.as_slice() else {
                self.before.push(row);
                continue;
            };
            values.clear();
            values.extend(increments(row, scales, gravity));
            self.count += 1;
            // each line has the increments of the interval before its time
            let seconds = first + 1e-3 * interval * self.count as f64;
            let known = interval > 0.0 && seconds.abs() < 9e9;
            let stamp =
                if known { Stamp::Date((seconds * 1e9).round() as i64) } else { Stamp::Missing };
            return Ok(Some(Record { offset, topic: 0, stamp }));
        }
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_before_the_first_line_are_passed_without_being_judged() {
        let lines = Lines::default();
        assert_eq!(lines.find(b"{\"gyro\": [0.1, 0.2]} % PSINS"), Some(21));
        assert_eq!(lines.find(b"{\"gyro\": [0.1, 0.2]}"), None);
    }
}
