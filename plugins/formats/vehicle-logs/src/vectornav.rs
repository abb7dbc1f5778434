//! ASCII messages of VectorNav units: VNYMR and VNIMU, which have no time, VNGPS and VNINS.
//!
//! Each message of the inertial unit is an interval after the one before; a fix and a solution have the
//! time of the newest one. Their own time of GPS gives the interval.

use crate::record::{Decoder, Options, Record, Topic};
use crate::text::number;
use navfuse_frames::{Damage, Frames, Sentences, Stamp};
use std::io::{Read, Result};

/// The messages and their fields.
const KINDS: [(&str, &[&str]); 4] = [
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
    (
        "VNGPS",
        &[
            "tow",
            "week",
            "fix",
            "satellites",
            "lat",
            "lon",
            "alt",
            "vel_n",
            "vel_e",
            "vel_d",
            "n_acc",
            "e_acc",
            "v_acc",
            "s_acc",
            "t_acc",
        ],
    ),
    (
        "VNINS",
        &[
            "tow",
            "week",
            "ins_status",
            "yaw",
            "pitch",
            "roll",
            "lat",
            "lon",
            "alt",
            "vel_n",
            "vel_e",
            "vel_d",
            "att_acc",
            "pos_acc",
            "vel_acc",
        ],
    ),
];
/// The messages of the inertial unit.
const INERTIAL: [&str; 2] = ["VNYMR", "VNIMU"];

/// The reader of ASCII messages.
#[derive(Debug)]
pub struct Vectornav<R> {
    frames: Frames<R, Sentences>,
    options: Options,
    topics: Vec<Topic>,
    /// The first message of the inertial unit, and how many of it followed.
    counted: Option<(&'static str, i64)>,
}

impl<R: Read> Vectornav<R> {
    /// The messages of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let frames = Frames::new(reader, Sentences::NMEA);
        Self { frames, options, topics: Vec::new(), counted: None }
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
            values.clear();
            values.extend(fields.by_ref().take(names.len()).map(number));
            if values.len() < names.len() || fields.next().is_some() {
                self.frames.reject_last();
                continue;
            }
            match &mut self.counted {
                Some((counted, count)) => *count += i64::from(counted == name),
                None if INERTIAL.contains(name) => self.counted = Some((name, 0)),
                None => {}
            }
            if !self.options.selects(name) {
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
            let time = self.options.interval.zip(self.counted);
            let time = time.and_then(|(interval, (_, count))| interval.checked_mul(count));
            let stamp = time.map_or(Stamp::Missing, Stamp::Date);
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
