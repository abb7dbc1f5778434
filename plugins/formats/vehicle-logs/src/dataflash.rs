//! ArduPilot DataFlash: messages whose formats the log itself defines, without checksums.
//!
//! A message is `a3 95`, its type, and numbers as the `FMT` message of this type gives them. The
//! letter of a format is the type of a number and its unit: `c` is a hundredth, `L` is 1e-7 deg.

use crate::record::{Decoder, Options, Record, Topic};
use navfuse_frames::{Damage, Fault, Frames, Framing, Judgement, Number, Stamp};
use std::io::{Read, Result};

/// First bytes of a message.
const MARK: [u8; 2] = [0xa3, 0x95];
/// Type and size of the message that defines a format.
const FMT: (u8, usize) = (0x80, 89);
/// Size in bytes of mark and type.
const HEADER: usize = 3;
/// Size in bytes that no message has.
const LARGEST: usize = 256;
/// Largest number of topics.
const TOPICS: usize = 1024;

/// A number of a format: its name, offset, type and divisor. Texts have none.
#[derive(Clone, Debug, PartialEq)]
struct Field {
    name: String,
    at: usize,
    kind: Number,
    divisor: f64,
}

/// The format of a type of message.
#[derive(Clone, Debug, Default, PartialEq)]
struct Layout {
    name: String,
    size: usize,
    fields: Vec<Field>,
    /// Indices of the time in microseconds or milliseconds, and of the instance.
    time: Option<(usize, f64)>,
    instance: Option<usize>,
}

/// Type, size and divisor of a letter; `None` as type for a text or a list. A quotient is rounded
/// once.
fn letter(letter: u8) -> Option<(Option<Number>, usize, f64)> {
    let number = |kind: Number, divisor| Some((Some(kind), kind.size(), divisor));
    match letter {
        b'b' => number(Number::I8, 1.0),
        b'B' | b'M' => number(Number::U8, 1.0),
        b'h' => number(Number::I16, 1.0),
        b'H' => number(Number::U16, 1.0),
        b'i' => number(Number::I32, 1.0),
        b'I' => number(Number::U32, 1.0),
        b'q' => number(Number::I64, 1.0),
        b'Q' => number(Number::U64, 1.0),
        b'f' => number(Number::F32, 1.0),
        b'd' => number(Number::F64, 1.0),
        b'c' => number(Number::I16, 100.0),
        b'C' => number(Number::U16, 100.0),
        b'e' => number(Number::I32, 100.0),
        b'E' => number(Number::U32, 100.0),
        b'L' => number(Number::I32, 1e7),
        b'n' => Some((None, 4, 1.0)),
        b'N' => Some((None, 16, 1.0)),
        b'Z' | b'a' => Some((None, 64, 1.0)),
        b'g' => Some((None, 2, 1.0)),
        _ => None,
    }
}

/// A text that zeros end.
fn text(bytes: &[u8]) -> Option<&str> {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    std::str::from_utf8(&bytes[..end]).ok().filter(|t| t.bytes().all(|b| b.is_ascii_graphic()))
}

impl Layout {
    /// Reads a message that defines a format: the type, and its layout.
    fn defined(message: &[u8]) -> Option<(u8, Self)> {
        let (kind, size) = (*message.get(3)?, usize::from(*message.get(4)?));
        let name = text(message.get(5..9)?)?;
        let (letters, labels) = (text(message.get(9..25)?)?, text(message.get(25..89)?)?);
        let (mut fields, mut at) = (Vec::new(), HEADER);
        for (label, code) in labels.split(',').zip(letters.bytes()) {
            let (kind, bytes, divisor) = letter(code)?;
            if let Some(kind) = kind {
                fields.push(Field { name: label.to_owned(), at, kind, divisor });
            }
            at += bytes;
        }
        if name.is_empty() || at >= LARGEST {
            return None;
        }
        // some writers count a size that their own fields exceed: a message is never shorter than these
        let size = size.max(at);
        let place = |name: &str| fields.iter().position(|f| f.name == name);
        let micros = place("TimeUS").map(|k| (k, 1e3));
        let time = micros.or_else(|| place("TimeMS").map(|k| (k, 1e6)));
        let instance = place("I");
        Some((kind, Self { name: name.to_owned(), size, fields, time, instance }))
    }
}

/// The framing of messages.
#[derive(Debug, Default)]
struct Messages {
    /// Size of the messages of each type that was defined.
    sizes: Vec<usize>,
}

impl Framing for Messages {
    const MAX: usize = LARGEST;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK[0])
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let size = match bytes {
            [] | [_] => return Judgement::Incomplete,
            [_, second, ..] if *second != MARK[1] => return Judgement::Rejected(Fault::Form),
            [_, _] => return Judgement::Incomplete,
            [_, _, kind, ..] if *kind == FMT.0 => FMT.1,
            [_, _, kind, ..] => self.sizes.get(usize::from(*kind)).copied().unwrap_or(0),
        };
        match size {
            0 => Judgement::Rejected(Fault::Form),
            _ if bytes.len() < size => Judgement::Incomplete,
            _ if bytes[2] == FMT.0 && Layout::defined(bytes).is_none() => {
                Judgement::Rejected(Fault::Form)
            }
            _ => Judgement::Frame(size),
        }
    }
}

/// The reader of DataFlash logs.
#[derive(Debug)]
pub struct Dataflash<R> {
    frames: Frames<R, Messages>,
    options: Options,
    /// The layout of each type that was defined and is selected.
    layouts: Vec<Option<Layout>>,
    topics: Vec<Topic>,
    /// Type and instance of each topic.
    keys: Vec<(u8, u32)>,
}

impl<R: Read> Dataflash<R> {
    /// The messages of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let frames = Frames::new(reader, Messages { sizes: vec![0; 256] });
        let (topics, keys) = (Vec::new(), Vec::new());
        Self { frames, options, layouts: vec![None; 256], topics, keys }
    }

    /// Takes the definition of a format. The topics of a format that changes are new ones.
    fn define(&mut self, kind: u8, layout: Layout) {
        self.frames.framing().sizes[usize::from(kind)] = layout.size;
        let selected = self.options.selects(&layout.name);
        let new = Some(layout).filter(|_| selected);
        let before = std::mem::replace(&mut self.layouts[usize::from(kind)], new);
        if before != self.layouts[usize::from(kind)] {
            // no message has the type of a definition
            self.keys.iter_mut().filter(|key| key.0 == kind).for_each(|key| key.0 = FMT.0);
        }
    }

    /// The topic of a type and instance.
    fn topic(&mut self, kind: u8, instance: u32) -> Option<usize> {
        if let Some(known) = self.keys.iter().position(|key| *key == (kind, instance)) {
            return Some(known);
        }
        let layout = self.layouts[usize::from(kind)].as_ref()?;
        if self.topics.len() >= TOPICS {
            return None;
        }
        let fields = layout.fields.iter().map(|f| f.name.clone()).collect();
        self.topics.push(Topic { name: layout.name.clone(), instance, fields });
        self.keys.push((kind, instance));
        Some(self.topics.len() - 1)
    }
}

impl<R: Read + Send> Decoder for Dataflash<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, kind) = (frame.offset, frame.bytes[2]);
            if kind == FMT.0 {
                if let Some((kind, layout)) = Layout::defined(frame.bytes) {
                    self.define(kind, layout);
                }
                continue;
            }
            let Some(layout) = &self.layouts[usize::from(kind)] else { continue };
            values.clear();
            values.extend(layout.fields.iter().map(|f| {
                f.kind.read::<true>(frame.bytes.get(f.at..).unwrap_or_default()) / f.divisor
            }));
            let at = |k: usize| values.get(k).copied().unwrap_or(0.0);
            let stamp = match layout.time.map(|(k, unit)| at(k) * unit) {
                Some(nanos) if nanos > 0.0 && nanos < 9e18 => Stamp::Date(nanos as i64),
                _ => Stamp::Missing,
            };
            let instance = layout.instance.map_or(0.0, at) as u32;
            if let Some(topic) = self.topic(kind, instance) {
                return Ok(Some(Record { offset, topic, stamp }));
            }
        }
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }
}
