//! PX4 ULog: messages whose formats the log itself defines. The format has neither marks nor
//! checksums: a message is recognised by its type, its length and, for data, its subscription.

mod definitions;

use crate::record::{Decoder, Options, Record, Topic};
use definitions::{Field, Formats, Sizes};
use navfuse_frames::{Count, Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// First bytes of a file.
const MAGIC: [u8; 7] = [b'U', b'L', b'o', b'g', 0x01, 0x12, 0x35];
/// Size in bytes of the header of a file: magic, version, time.
const FILE_HEADER: usize = 16;
/// Size in bytes of the header of a message: length and type.
const HEADER: usize = 3;
/// Bytes of a message for synchronisation.
const SYNC: [u8; 8] = [0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];
/// Number of bytes of a message by which it is recognised.
const BEGINNING: usize = 32;
/// Number of bytes by which a text is recognised.
const TEXT: usize = 24;
/// Largest number of selected topics.
const TOPICS: usize = 1024;
/// Memory in bytes of the fields of all selected topics.
const FIELDS: usize = 32 * 1024 * 1024;

/// The framing of messages.
#[derive(Debug, Default)]
struct Messages {
    /// Sizes of the data of each subscription, by its identifier.
    subscribed: Vec<Option<Sizes>>,
}

impl Messages {
    /// Tests whether a message of this type and size can begin with this content.
    fn plausible(&self, kind: u8, size: usize, content: &[u8]) -> bool {
        let byte = |k: usize| content.get(k).copied().unwrap_or_default();
        let text = |from: usize| {
            let end = content.len().min(from + TEXT);
            content.get(from..end).is_some_and(|t| !t.is_empty() && t.iter().all(|b| printable(*b)))
        };
        // a key begins with the name of a type
        let key = |at: usize| (3..size).contains(&usize::from(byte(at))) && text(at + 1);
        let level = |least: usize| (b'0'..=b'7').contains(&byte(0)) && size >= least;
        match kind {
            b'F' => text(0),
            b'I' | b'P' => key(0),
            b'M' | b'Q' => key(1),
            b'A' => size <= 3 + 256 && text(3),
            b'B' => size == 40,
            b'R' | b'O' => size == 2,
            b'S' => content == SYNC,
            b'L' => level(9),
            b'C' => level(11),
            b'D' => {
                let id = usize::from(u16::from_le_bytes([byte(0), byte(1)]));
                let sizes = self.subscribed.get(id).copied().flatten();
                sizes.is_some_and(|s| size > 2 && (s.least..=s.most).contains(&(size - 2)))
            }
            _ => false,
        }
    }
}

fn printable(byte: u8) -> bool {
    (b' '..=b'~').contains(&byte)
}

impl Framing for Messages {
    const MAX: usize = HEADER + 65_535;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        // no mark: a message may begin at any byte
        (!bytes.is_empty()).then_some(0)
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        if bytes[0] == MAGIC[0] && bytes.iter().zip(MAGIC).all(|(a, b)| *a == b) {
            return if bytes.len() < FILE_HEADER {
                Judgement::Incomplete
            } else {
                Judgement::Frame(FILE_HEADER)
            };
        }
        let &[low, high, kind, ref rest @ ..] = bytes else { return Judgement::Incomplete };
        let size = usize::from(u16::from_le_bytes([low, high]));
        let beginning = &rest[..rest.len().min(size).min(BEGINNING)];
        if beginning.len() < size.min(BEGINNING) {
            return Judgement::Incomplete;
        }
        match self.plausible(kind, size, beginning) {
            false => Judgement::Rejected(Fault::Form),
            true if rest.len() < size => Judgement::Incomplete,
            true => Judgement::Frame(HEADER + size),
        }
    }
}

/// The place of a selected topic's numbers.
#[derive(Debug)]
struct Layout {
    fields: Vec<Field>,
    /// Offset of the time in the message.
    time: Option<usize>,
}

/// The reader of ULog.
#[derive(Debug)]
pub struct Ulog<R> {
    frames: Frames<R, Messages>,
    options: Options,
    formats: Formats,
    topics: Vec<Topic>,
    layouts: Vec<Layout>,
    /// Index of the topic of each subscription, by its identifier.
    selected: Vec<Option<usize>>,
    /// Memory in bytes that is left for fields.
    room: usize,
    dropouts: Count,
    /// Milliseconds of all dropouts.
    dropped: u64,
    /// Features of a newer format that the reader does not know.
    incompatible: Count,
}

impl<R: Read> Ulog<R> {
    /// The messages of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        Self {
            frames: Frames::new(reader, Messages::default()),
            options,
            formats: Formats::default(),
            topics: Vec::new(),
            layouts: Vec::new(),
            selected: Vec::new(),
            room: FIELDS,
            dropouts: Count::default(),
            dropped: 0,
            incompatible: Count::default(),
        }
    }

    /// Takes a message that is no data; `false` if its content contradicts the format.
    fn define(&mut self, kind: u8, content: &[u8], offset: u64) -> bool {
        match kind {
            b'F' => std::str::from_utf8(content).is_ok_and(|text| self.formats.define(text)),
            b'A' => self.subscribe(content),
            b'R' => {
                let id = content.first_chunk().map(|b| usize::from(u16::from_le_bytes(*b)));
                if let Some(slot) = id.and_then(|id| self.frames.framing().subscribed.get_mut(id)) {
                    *slot = None;
                }
                true
            }
            b'O' => {
                let duration = content.first_chunk().map_or(0, |b| u16::from_le_bytes(*b));
                self.dropouts.add(offset);
                self.dropped += u64::from(duration);
                true
            }
            b'B' => {
                // one bit is known: data were appended to the file after it was closed
                let unknown = |(k, b): (usize, &u8)| *b & if k == 0 { !1 } else { !0 } != 0;
                if content.iter().skip(8).take(8).enumerate().any(unknown) {
                    self.incompatible.add(offset);
                }
                true
            }
            _ => true,
        }
    }

    fn subscribe(&mut self, content: &[u8]) -> bool {
        let [instance, low, high, name @ ..] = content else { return false };
        let id = usize::from(u16::from_le_bytes([*low, *high]));
        let Ok(name) = std::str::from_utf8(name) else { return false };
        let Some(sizes) = self.formats.sizes(name) else { return false };
        let subscribed = &mut self.frames.framing().subscribed;
        if subscribed.len() <= id {
            subscribed.resize(id + 1, None);
        }
        subscribed[id] = Some(sizes);
        if self.selected.len() <= id {
            self.selected.resize(id + 1, None);
        }
        self.selected[id] = self.select(name, u32::from(*instance));
        true
    }

    /// Index of a topic, if it is selected.
    fn select(&mut self, name: &str, instance: u32) -> Option<usize> {
        let same = |t: &Topic| t.name == name && t.instance == instance;
        if !self.options.selects(name) {
            return None;
        }
        // a format does not change after its first subscription
        if let Some(known) = self.topics.iter().position(same) {
            return Some(known);
        }
        if self.topics.len() >= TOPICS {
            return None;
        }
        let fields = self.formats.fields(name, &mut self.room)?;
        let names = fields.iter().map(|f| f.name.clone()).collect();
        let time = fields.iter().find(|f| f.name == "timestamp").map(|f| f.at);
        self.topics.push(Topic { name: name.to_owned(), instance, fields: names });
        self.layouts.push(Layout { fields, time });
        Some(self.topics.len() - 1)
    }
}

impl<R: Read + Send> Decoder for Ulog<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        while let Some(frame) = self.frames.next()? {
            let offset = frame.offset;
            if frame.bytes.len() == FILE_HEADER && frame.bytes.starts_with(&MAGIC) {
                continue;
            }
            let (kind, content) = (frame.bytes[2], &frame.bytes[HEADER..]);
            if kind != b'D' {
                let content = content.to_vec();
                if !self.define(kind, &content, offset) {
                    self.frames.reject_last();
                }
                continue;
            }
            let (id, data) = content.split_at(2);
            let id = usize::from(u16::from_le_bytes([id[0], id[1]]));
            let Some(topic) = self.selected.get(id).copied().flatten() else { continue };
            let layout = &self.layouts[topic];
            let number = |f: &Field| f.number.read::<true>(data.get(f.at..).unwrap_or_default());
            values.clear();
            values.extend(layout.fields.iter().map(number));
            let time = layout.time.and_then(|at| data.get(at..)?.first_chunk().copied());
            let nanos =
                time.and_then(|b| i64::try_from(u64::from_le_bytes(b)).ok()?.checked_mul(1000));
            let stamp = nanos.map_or(Stamp::Missing, Stamp::Date);
            return Ok(Some(Record { offset, topic, stamp }));
        }
        Ok(None)
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }

    fn events(&self) -> Option<String> {
        let mut parts = Vec::new();
        let dropouts = self.dropouts.describe("dropout", "of the logger");
        parts.extend(dropouts.map(|text| format!("{text} ({:.3} s)", self.dropped as f64 * 1e-3)));
        let unknown = "with features of a newer format, which may be misread,";
        parts.extend(self.incompatible.describe("header", unknown));
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
