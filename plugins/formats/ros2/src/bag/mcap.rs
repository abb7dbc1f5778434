//! MCAP, read from front to back: messages in chunks and outside, with damaged parts skipped.

use super::faults::Faults;
use super::topics::{Found, Place, Topic, Topics};
use navfuse_frames::Window;
use navfuse_frames::mcap::{self, Chunks, Fields, MESSAGE_HEAD, Records, op};
use std::collections::BTreeMap;
use std::io::Result;

/// Largest size in bytes of a definition, and largest number of them.
const LONGEST_DEFINITION: usize = 1 << 17;
const MOST_DEFINITIONS: usize = 2048;

/// An MCAP file.
pub struct Mcap {
    records: Records,
    schemas: BTreeMap<u16, (String, String, String)>,
    channels: BTreeMap<u16, usize>,
}

impl Mcap {
    /// A file that begins with [`mcap::MAGIC`], at an offset of its bag.
    pub fn new(window: Window, base: u64) -> Self {
        let records = Records::new(window, base, Chunks::Unpacked);
        Self { records, schemas: BTreeMap::new(), channels: BTreeMap::new() }
    }

    /// The bytes of a message that [`Self::advance`] found.
    pub fn data(&self, place: &mcap::Place) -> &[u8] {
        self.records.content(place)
    }

    /// Finds the next message; `None` at the end of the file.
    pub fn advance(&mut self, topics: &mut Topics, faults: &mut Faults) -> Result<Option<Found>> {
        while let Some(record) = self.records.next(&mut faults.lost)? {
            let found = match record.opcode {
                op::MESSAGE => self.message(record, faults),
                op::SCHEMA => {
                    self.schema(&record.place);
                    None
                }
                op::CHANNEL if self.channel(&record.place, topics).is_none() => {
                    faults.records.add(record.offset);
                    None
                }
                _ => None,
            };
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// The message in a record.
    fn message(&self, record: mcap::Found, faults: &mut Faults) -> Option<Found> {
        let mcap::Found { offset, place, .. } = record;
        let mut fields = Fields(self.records.content(&place));
        let times = (fields.u16(), fields.u32(), fields.u64(), fields.u64());
        let (Some(channel), Some(_), Some(log), Some(_)) = times else {
            faults.records.add(offset);
            return None;
        };
        let Some(topic) = self.channels.get(&channel) else {
            faults.strangers.add(offset);
            return None;
        };
        let received = i64::try_from(log).unwrap_or(i64::MAX);
        let place = Place::Record(place.after(MESSAGE_HEAD));
        Some(Found { topic: *topic, received, offset, place })
    }

    /// Takes a definition.
    fn schema(&mut self, place: &mcap::Place) {
        let mut fields = Fields(self.records.content(place));
        if let (Some(id), Some(name), Some(encoding), Some(text)) =
            (fields.u16(), fields.text(), fields.text(), fields.text())
            && text.len() <= LONGEST_DEFINITION
            && self.schemas.len() < MOST_DEFINITIONS
        {
            self.schemas.insert(id, (name, encoding, text));
        }
    }

    /// Takes a channel; `None` if its topic is one too many.
    fn channel(&mut self, place: &mcap::Place, topics: &mut Topics) -> Option<()> {
        let mut fields = Fields(self.records.content(place));
        let (Some(id), Some(schema), Some(name), Some(encoding)) =
            (fields.u16(), fields.u16(), fields.text(), fields.text())
        else {
            return Some(());
        };
        let (kind, form, text) = self.schemas.get(&schema).cloned().unwrap_or_default();
        let definition = (form == "ros2msg").then_some(text);
        let topic = topics.add(Topic { name, kind, encoding, definition })?;
        self.channels.insert(id, topic);
        Some(())
    }
}
