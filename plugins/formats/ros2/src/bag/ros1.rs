//! Bags of ROS 1 (`#ROSBAG V2.0`), read from front to back: messages in chunks and outside.
//!
//! A record is a header, whose fields are `name=value`, and data; each of them, and each field, has its
//! size before it. A message is packed without padding: the size before its data gives way to the
//! mark of this encoding.

use super::faults::Faults;
use super::topics::{Found, Place, Topic, Topics};
use crate::cdr::PACKED;
use navfuse_frames::Window;
use navfuse_frames::mcap::LONGEST;
use std::collections::BTreeMap;
use std::io::{Read, Result};
use std::ops::Range;

/// First bytes of a file.
pub const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Largest size in bytes of a header, and largest number of connections.
const HEADER: usize = 1 << 17;
const MOST_CONNECTIONS: usize = 4096;
/// Kinds of records.
const MESSAGE: &[u8] = &[2];
const CHUNK: &[u8] = &[5];
const CONNECTION: &[u8] = &[7];

/// The number at a place.
fn size(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*bytes)).ok()
}

/// The places of header and data of the record at a place; `None` if it is cut off.
fn record(bytes: &[u8], at: usize) -> Option<[Range<usize>; 2]> {
    let part = |at: usize| {
        let end = size(bytes, at)?.checked_add(at + 4)?;
        bytes.get(at + 4..end).map(|_| at + 4..end)
    };
    let header = part(at)?;
    let data = part(header.end)?;
    Some([header, data])
}

/// The value of a field of a header.
fn field<'a>(header: &'a [u8], name: &str) -> Option<&'a [u8]> {
    let mut at = 0;
    while let Some(length) = size(header, at) {
        let field = header.get(at + 4..)?.get(..length)?;
        let value = field.strip_prefix(name.as_bytes()).and_then(|v| v.strip_prefix(b"="));
        if value.is_some() {
            return value;
        }
        at += 4 + length;
    }
    None
}

fn number(header: &[u8], name: &str) -> Option<u32> {
    field(header, name)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}

fn text(header: &[u8], name: &str) -> Option<String> {
    field(header, name).map(|value| String::from_utf8_lossy(value).into_owned())
}

/// A bag of ROS 1.
pub struct Ros1 {
    window: Window,
    base: u64,
    /// The records that are being read, the place of the next one, and the offset of them all.
    chunk: Vec<u8>,
    at: usize,
    offset: u64,
    /// The topic of each connection.
    connections: BTreeMap<u32, usize>,
    /// Set once a chunk was packed in a way that is not read.
    packed: bool,
}

impl Ros1 {
    /// A file that begins with [`MAGIC`], at an offset of its bag.
    pub fn new(mut window: Window, base: u64) -> Self {
        window.skip(MAGIC.len());
        let (chunk, connections) = (Vec::new(), BTreeMap::new());
        Self { window, base, chunk, at: 0, offset: base, connections, packed: false }
    }

    /// The bytes of a message that [`Self::advance`] found.
    pub fn data(&self, place: &Range<usize>) -> &[u8] {
        self.chunk.get(place.clone()).unwrap_or_default()
    }

    /// Finds the next message; `None` at the end of the file.
    pub fn advance(&mut self, topics: &mut Topics, faults: &mut Faults) -> Result<Option<Found>> {
        loop {
            while let Some([header, data]) = record(&self.chunk, self.at) {
                self.at = data.end;
                match field(&self.chunk[header.clone()], "op") {
                    Some(MESSAGE) => {
                        if let Some(found) = self.message(&header, &data, faults) {
                            return Ok(Some(found));
                        }
                    }
                    Some(CONNECTION) => {
                        self.connection(&header, &data, topics);
                    }
                    _ => faults.records.add(self.offset),
                }
            }
            if self.at < self.chunk.len() {
                faults.records.add(self.offset);
            }
            if !self.next_chunk(faults)? {
                return Ok(None);
            }
        }
    }

    fn message(
        &mut self,
        header: &Range<usize>,
        data: &Range<usize>,
        faults: &mut Faults,
    ) -> Option<Found> {
        let head = &self.chunk[header.clone()];
        let time = field(head, "time").filter(|time| time.len() == 8);
        let (Some(connection), Some(time)) = (number(head, "conn"), time) else {
            faults.records.add(self.offset);
            return None;
        };
        let [seconds, nanos] = [0, 4].map(|at| size(time, at).unwrap_or(0) as i64);
        let Some(topic) = self.connections.get(&connection) else {
            faults.strangers.add(self.offset);
            return None;
        };
        let (topic, received) = (*topic, seconds * 1_000_000_000 + nanos);
        let place = data.start - PACKED.len()..data.end;
        self.chunk[place.start..data.start].copy_from_slice(&PACKED);
        Some(Found { topic, received, offset: self.offset, place: Place::Bytes(place) })
    }

    /// Takes the description of a connection; `None` if it is not whole, or one too many.
    fn connection(
        &mut self,
        header: &Range<usize>,
        data: &Range<usize>,
        topics: &mut Topics,
    ) -> Option<()> {
        let (header, data) = (&self.chunk[header.clone()], &self.chunk[data.clone()]);
        let id = number(header, "conn").filter(|_| self.connections.len() < MOST_CONNECTIONS)?;
        let name = text(header, "topic").or_else(|| text(data, "topic"))?;
        let (kind, definition) = (text(data, "type")?, text(data, "message_definition"));
        let topic = topics.add(Topic { name, kind, encoding: "ros1".to_owned(), definition })?;
        self.connections.insert(id, topic);
        Some(())
    }

    /// Reads the next record of the file that holds messages or connections; `false` at the end.
    fn next_chunk(&mut self, faults: &mut Faults) -> Result<bool> {
        (self.at, self.offset) = (0, self.base + self.window.offset());
        self.chunk.clear();
        loop {
            let offset = self.base + self.window.offset();
            if !self.window.need(1)? {
                return Ok(false);
            }
            let Some(whole) = self.whole()? else {
                faults.lost.cuts.push(offset);
                return Ok(false);
            };
            let [header, data] = record(self.window.bytes(), 0).unwrap_or_default();
            let (head, content) = (&self.window.bytes()[header], &self.window.bytes()[data]);
            let found = match field(head, "op") {
                Some(CHUNK) => {
                    self.packed |= !unpack(head, content, &mut self.chunk);
                    true
                }
                Some(MESSAGE | CONNECTION) => {
                    self.chunk.extend_from_slice(&self.window.bytes()[..whole]);
                    true
                }
                _ => false,
            };
            if self.packed && faults.notes.is_empty() {
                faults.notes.push(
                    "chunks that are packed with bz2 are not read: `rosbag decompress` unpacks them"
                        .to_owned(),
                );
            }
            self.window.skip(whole);
            if found {
                self.offset = offset;
                return Ok(true);
            }
        }
    }

    /// The size of the record at the beginning of the window; `None` if the file does not have all
    /// of it, or it is too large for a record.
    fn whole(&mut self) -> Result<Option<usize>> {
        let mut total = 0;
        for most in [HEADER, LONGEST] {
            if !self.window.need(total + 4)? {
                return Ok(None);
            }
            let Some(part) = size(self.window.bytes(), total).filter(|n| *n <= most) else {
                return Ok(None);
            };
            total += 4 + part;
        }
        Ok(self.window.need(total)?.then_some(total))
    }
}

/// Unpacks a chunk; `false` if it is packed in a way that is not read.
fn unpack(header: &[u8], content: &[u8], out: &mut Vec<u8>) -> bool {
    match field(header, "compression") {
        Some(b"lz4") => {
            let decoder = lz4_flex::frame::FrameDecoder::new(content).take(LONGEST as u64);
            // what comes before the damage is read
            let _ = { decoder }.read_to_end(out);
        }
        Some(b"none") | None => out.extend_from_slice(content),
        Some(_) => return false,
    }
    true
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use std::io::Cursor;

    fn part(bytes: &[u8]) -> Vec<u8> {
        [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat()
    }

    fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
        let field = |(name, value): &(&str, &[u8])| part(&[name.as_bytes(), b"=", value].concat());
        let header: Vec<u8> = fields.iter().flat_map(field).collect();
        [part(&header), part(data)].concat()
    }

    /// A connection and three messages.
    fn messages() -> Vec<u8> {
        let text = [("type", "std_msgs/Float64"), ("message_definition", "float64 data")];
        let text = text.map(|(name, value)| part(format!("{name}={value}").as_bytes())).concat();
        let one = 1_u32.to_le_bytes();
        let mut bytes = record(&[("op", CONNECTION), ("conn", &one), ("topic", b"/depth")], &text);
        for k in 0..3_u32 {
            let time = [k.to_le_bytes(), 5_u32.to_le_bytes()].concat();
            let fields: [(&str, &[u8]); 3] = [("conn", &one), ("op", MESSAGE), ("time", &time)];
            bytes.extend(record(&fields, &f64::from(k).to_le_bytes()));
        }
        bytes
    }

    /// Reads a file: times and contents of the messages, and the faults.
    fn read(bytes: &[u8]) -> (Vec<(i64, Vec<u8>)>, Option<String>) {
        let file: Box<dyn Read + Send> = Box::new(Cursor::new(bytes.to_vec()));
        let mut window = Window::new(file);
        window.need(MAGIC.len()).unwrap();
        let (mut bag, mut found) = (Ros1::new(window, 0), Vec::new());
        let (mut topics, mut faults) = (Topics::default(), Faults::default());
        while let Some(message) = bag.advance(&mut topics, &mut faults).unwrap() {
            let Place::Bytes(place) = &message.place else { continue };
            found.push((message.received, bag.data(place).to_vec()));
        }
        (found, faults.describe())
    }

    fn file(compression: &[u8], content: &[u8]) -> Vec<u8> {
        let head = record(&[("op", &[3]), ("chunk_count", &1_u32.to_le_bytes())], &[b' '; 64]);
        let chunk = record(&[("op", CHUNK), ("compression", compression)], content);
        let index = record(&[("op", &[4])], b"12345678");
        [MAGIC, &head, &chunk, &index].concat()
    }

    #[test]
    fn messages_plain_packed_and_outside_of_chunks_are_the_same() {
        let mut packer = lz4_flex::frame::FrameEncoder::new(Vec::new());
        std::io::Write::write_all(&mut packer, &messages()).unwrap();
        let packed = packer.finish().unwrap();
        let outside = [MAGIC, &messages()].concat();
        for bytes in [file(b"none", &messages()), file(b"lz4", &packed), outside] {
            let (found, faults) = read(&bytes);
            assert_eq!(faults, None);
            let expected = |k: u32| {
                let data = [&PACKED[..], &f64::from(k).to_le_bytes()].concat();
                (i64::from(k) * 1_000_000_000 + 5, data)
            };
            assert_eq!(found, [0, 1, 2].map(expected));
        }
        let (found, faults) = read(&file(b"bz2", &packed));
        assert!(found.is_empty() && faults.unwrap().contains("rosbag decompress"));
    }

    #[test]
    fn a_file_that_is_cut_or_changed_anywhere_is_read_to_its_end() {
        let whole = file(b"none", &messages());
        for end in MAGIC.len() + 1..whole.len() {
            let (found, faults) = read(&whole[..end]);
            assert!(found.len() <= 3, "{end}");
            // a cut between records is the end of a file
            assert!(faults.is_some() || found.is_empty() || found.len() == 3, "{end}");
        }
        for at in MAGIC.len()..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 0x55;
            assert!(read(&changed).0.len() <= 3);
        }
    }
}
