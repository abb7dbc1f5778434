//! ASCII messages of VectorNav units: VNYMR and VNIMU. They have no time.

use crate::record::{Decoder, Options, Record, Topic};
use crate::text::number;
use navfuse_frames::{Damage, Frames, Sentences, Stamp};
use std::io::{Read, Result};

/// The messages and their fields.
const KINDS: [(&str, &[&str]); 2] = [
    (
        "VNYMR",
        &[
            "yaw", "pitch", "roll", "mag_x", "mag_y", "mag_z", "accel_x", "accel_y", "accel_z",
            "gyro_x", "gyro_y", "gyro_z",
        ],
    ),
    (
        "VNIMU",
        &[
            "mag_x",
            "mag_y",
            "mag_z",
            "accel_x",
            "accel_y",
            "accel_z",
            "gyro_x",
            "gyro_y",
            "gyro_z",
            "temperature",
            "pressure",
        ],
    ),
];

/// The reader of ASCII messages.
#[derive(Debug)]
pub struct Vectornav<R> {
    frames: Frames<R, Sentences>,
    options: Options,
    topics: Vec<Topic>,
}

impl<R: Read> Vectornav<R> {
    /// The messages of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        Self { frames: Frames::new(reader, Sentences::NMEA), options, topics: Vec::new() }
    }
}

impl<R: Read + Send> Decoder for Vectornav<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let mut fields = Sentences::NMEA.content(frame.bytes).split(|b| *b == b',');
            let name = fields.next().unwrap_or_default();
            let Some((name, names)) = KINDS.iter().find(|(n, _)| n.as_bytes() == name) else {
                continue;
            };
            if !self.options.selects(name) {
                continue;
            }
            values.clear();
            values.extend(fields.by_ref().take(names.len()).map(number));
            if values.len() < names.len() || fields.next().is_some() {
                self.frames.reject_last();
                continue;
            }
            let offset = frame.offset;
            let topic = match self.topics.iter().position(|t| t.name == *name) {
                Some(known) => known,
                None => {
                    let fields = names.iter().map(|f| (*f).to_owned()).collect();
                    self.topics.push(Topic { name: (*name).to_owned(), instance: 0, fields });
                    self.topics.len() - 1
                }
            };
            let stamp = self.options.interval.map_or(Stamp::Missing, Stamp::Elapsed);
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
