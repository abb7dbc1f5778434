//! The definitions of the topics, and chunks of messages.

use crate::format::{bytes, record, text, texts, u16};
use crate::schema::Schema;
use mcap::records::op;
use std::collections::BTreeMap;

/// Length in bytes of the records at which a chunk is complete, before compression.
///
/// Longer chunks cost memory, and a run that is killed loses what is not written; shorter ones
/// compress worse. `docs/src/explanation/performance.md` has the measurements.
pub const LENGTH: usize = 1 << 19;

/// Length in bytes of what stands before the content of a message.
const HEAD: usize = 31;

/// A topic.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    /// The channel's id.
    pub channel: u16,
    /// Number of messages written.
    pub sequence: u32,
}

/// A topic as it is announced, in the order of the channels.
#[derive(Clone, Debug)]
pub struct Definition {
    /// Name of the topic.
    pub topic: String,
    /// Type of its messages, which are in CDR.
    pub schema: Schema,
    /// What is known about the topic, by name.
    pub metadata: BTreeMap<String, String>,
}

/// The schemas and channels of a file, as records.
#[derive(Debug, Default)]
pub struct Definitions {
    /// The schemas, in the order of their ids, which begin at 1: 0 is no schema.
    pub schemas: Vec<u8>,
    names: Vec<&'static str>,
    /// The channels, in the order of their ids.
    pub channels: Vec<u8>,
    /// The channels, in the same order.
    pub listed: Vec<Definition>,
}

impl Definitions {
    /// Number of schemas and of channels.
    pub fn counts(&self) -> [u16; 2] {
        [self.names.len() as u16, self.listed.len() as u16]
    }

    /// Adds a topic.
    pub fn topic(&mut self, name: &str, schema: &Schema) -> Topic {
        self.described(name, schema, &BTreeMap::new())
    }

    /// Adds a topic with metadata.
    pub fn described(
        &mut self,
        name: &str,
        schema: &Schema,
        metadata: &BTreeMap<String, String>,
    ) -> Topic {
        let id = self.schema(schema);
        let channel = self.listed.len() as u16;
        record(&mut self.channels, op::CHANNEL, |out| {
            u16(out, channel);
            u16(out, id);
            text(out, name);
            text(out, "cdr");
            texts(out, metadata);
        });
        let (topic, schema, metadata) = (name.to_owned(), *schema, metadata.clone());
        self.listed.push(Definition { topic, schema, metadata });
        Topic { channel, sequence: 0 }
    }

    fn schema(&mut self, schema: &Schema) -> u16 {
        if let Some(known) = self.names.iter().position(|name| *name == schema.name) {
            return known as u16 + 1;
        }
        self.names.push(schema.name);
        let id = self.names.len() as u16;
        record(&mut self.schemas, op::SCHEMA, |out| {
            u16(out, id);
            text(out, schema.name);
            text(out, "ros2msg");
            bytes(out, schema.text.as_bytes());
        });
        id
    }
}

/// Messages that are compressed and written together.
#[derive(Debug, Default)]
pub struct Chunk {
    /// The records, one after the other.
    pub records: Vec<u8>,
    /// The least and the greatest time.
    pub span: Option<[u64; 2]>,
    /// Time and offset of each message, 16 bytes each, by channel.
    pub index: Vec<Vec<u8>>,
}

impl Chunk {
    /// Appends a message.
    pub fn message(&mut self, topic: &Topic, time: u64, encode: impl FnOnce(&mut Vec<u8>)) {
        let channel = usize::from(topic.channel);
        if self.index.len() <= channel {
            self.index.resize(channel + 1, Vec::new());
        }
        let start = self.records.len();
        let entry = [time, start as u64].map(u64::to_le_bytes);
        self.index[channel].extend_from_slice(entry.as_flattened());
        self.span = Some(self.span.map_or([time; 2], |[a, b]| [a.min(time), b.max(time)]));
        // opcode, length, channel, number and times at once: a log has some thousand messages a second
        let mut head = [0; HEAD];
        head[0] = op::MESSAGE;
        head[9..11].copy_from_slice(&topic.channel.to_le_bytes());
        head[11..15].copy_from_slice(&topic.sequence.to_le_bytes());
        // logged when it is published
        head[15..].copy_from_slice([time.to_le_bytes(); 2].as_flattened());
        self.records.extend_from_slice(&head);
        encode(&mut self.records);
        let length = (self.records.len() - start - 9) as u64;
        self.records[start + 1..start + 9].copy_from_slice(&length.to_le_bytes());
    }

    /// Removes the content and keeps the memory.
    pub fn clear(&mut self) {
        self.records.clear();
        self.span = None;
        self.index.iter_mut().for_each(Vec::clear);
    }
}
