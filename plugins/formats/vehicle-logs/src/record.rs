//! Records of a log: messages with named numbers.

use crate::lcm::LcmTypes;
use navfuse_frames::{Damage, Stamp};
use std::io::Result;

/// A kind of message in a log, with the names of its numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Name of the message, such as `sensor_combined`.
    pub name: String,
    /// Number of the instance, where several devices write the same message: the instance of ULog,
    /// the system of MAVLink, otherwise zero.
    pub instance: u32,
    /// Names of the fields, such as `gyro_rad[0]`.
    pub fields: Vec<String>,
}

/// A message of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Offset of its first byte in the file.
    pub offset: u64,
    /// Index of its topic in [`Decoder::topics`].
    pub topic: usize,
    /// Its time.
    pub stamp: Stamp,
}

/// Reads the messages of a log in constant memory.
///
/// ```
/// use navfuse_vehicle_logs::{Decoder, Format, Options};
/// let file = &b"noise$VNYMR,+090.0,-001.0,+002.0,+1,+2,+3,+00.1,-00.2,-09.8,+0.5,-0.25,+0.125*4C\r\n"[..];
/// let mut log: Box<dyn Decoder> = Format::Vectornav.decoder(file, &Options::default());
/// let mut values = Vec::new();
/// while let Some(record) = log.next(&mut values)? {
///     let topic = &log.topics()[record.topic];
///     assert_eq!((topic.name.as_str(), topic.fields[0].as_str()), ("VNYMR", "yaw"));
///     assert_eq!(values[8], -9.8);
/// }
/// assert_eq!(log.damage().bytes(), 5);
/// # Ok::<(), std::io::Error>(())
/// ```
pub trait Decoder: Send {
    /// The next message of a selected topic, whose fields replace `values`; `None` at the end.
    ///
    /// # Errors
    /// When the file cannot be read.
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>>;

    /// The selected topics so far. A log may add topics while it is read.
    fn topics(&self) -> &[Topic];

    /// The bytes that belong to no intact message.
    fn damage(&self) -> &Damage;

    /// Events that the log reports, such as messages that its writer dropped.
    fn events(&self) -> Option<String> {
        None
    }
}

/// Options of a [`Decoder`].
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Names of the selected topics. Empty: all.
    pub topics: Vec<String>,
    /// Uses the time at which a message was received instead of the time in the message (MAVLink).
    pub received: bool,
    /// GPS week of the first message, for formats with seconds of the week alone.
    pub week: Option<u16>,
    /// Number of the inertial unit as NovAtel counts them, for raw measurements without it.
    pub unit: Option<u32>,
    /// Nanoseconds between two messages, for formats without any time.
    pub interval: Option<i64>,
    /// Uses logs of NovAtel in text whatever their checksum.
    pub unchecked: bool,
    /// Types of the messages of LCM, which its logs do not describe.
    pub definitions: LcmTypes,
}

impl Options {
    /// Returns `true` if a topic is selected.
    pub fn selects(&self, name: &str) -> bool {
        self.topics.is_empty() || self.topics.iter().any(|topic| topic == name)
    }
}
