//! The topics of a bag, and the place of a message in it.

use crate::definition::{Definitions, short_name};
use crate::error::DefinitionError;
use navfuse_frames::mcap;

/// Largest number of topics.
const MOST_TOPICS: usize = 4096;

/// A topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, such as `/imu/data`.
    pub name: String,
    /// The type of its messages, such as `sensor_msgs/msg/Imu`.
    pub kind: String,
    /// Encoding of its messages: `cdr`, or `ros1` in a bag of ROS 1.
    pub encoding: String,
    /// Definition of the type in `ros2msg` form, where the bag has it.
    pub definition: Option<String>,
}

impl Topic {
    /// The type without the `msg` in its middle: `sensor_msgs/Imu`.
    pub fn short_kind(&self) -> String {
        short_name(&self.kind)
    }

    /// The definitions for its messages, with the built-in ones for those that the bag has not.
    pub(crate) fn definitions(&self) -> Result<Definitions, DefinitionError> {
        match &self.definition {
            Some(text) => Definitions::parse(&self.kind, text),
            None => Ok(Definitions::default()),
        }
    }
}

/// The topics that were seen so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topics {
    pub all: Vec<Topic>,
}

impl Topics {
    /// The index of a topic, which is added if it is new; `None` if there are too many.
    pub fn add(&mut self, topic: Topic) -> Option<usize> {
        if let Some(index) = self.all.iter().position(|known| *known == topic) {
            return Some(index);
        }
        (self.all.len() < MOST_TOPICS).then(|| self.all.push(topic))?;
        Some(self.all.len() - 1)
    }
}

/// The place of the bytes of a message.
#[derive(Clone, Debug)]
pub(crate) enum Place {
    Record(mcap::Place),
    /// Column of a row.
    Row(usize),
    /// Bytes of a chunk.
    Bytes(std::ops::Range<usize>),
}

/// A message that was found.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub topic: usize,
    pub received: i64,
    pub offset: u64,
    pub place: Place,
}
