//! Event logs of LCM: each message with its channel and the time at which it was received, in microseconds since
//! 1970. The definitions of its types, `.lcm` files, name its numbers.

mod types;

pub use types::LcmTypes;

use crate::record::{Decoder, Options, Record, Topic};
use navfuse_frames::Number::{I32, I64};
use navfuse_frames::{Count, Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};
use types::Walk;

/// First bytes of an event.
const MARK: [u8; 4] = [0xed, 0xa1, 0xda, 0x01];
/// Sizes in bytes of the header of an event, of a channel's name, and of the fingerprint.
const HEADER: usize = 28;
const CHANNEL: usize = 63;
const FINGERPRINT: usize = 8;
/// Largest message, in bytes.
const LARGEST: usize = 16 * 1024 * 1024;
/// Largest number of channels.
const CHANNELS: usize = 1000;
/// Microseconds by which the time in a message and that of its reception may differ: a day.
const APART: f64 = 86_400e6;

/// The framing of events: mark, number, time, sizes, channel, message. They have no checksum, so that an event with
/// another mark inside is none.
#[derive(Debug)]
struct Events;

impl Framing for Events {
    const MAX: usize = HEADER + CHANNEL + LARGEST;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| *b == MARK[0])
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        if bytes.iter().zip(MARK).any(|(byte, mark)| *byte != mark) {
            return Judgement::Rejected(Fault::Form);
        }
        let Some(header) = bytes.first_chunk::<HEADER>() else { return Judgement::Incomplete };
        let size = |at: usize| I32.read::<false>(&header[at..]) as i64;
        let (Ok(channel), Ok(data)) = (usize::try_from(size(20)), usize::try_from(size(24))) else {
            return Judgement::Rejected(Fault::Form);
        };
        if !(1..=CHANNEL).contains(&channel) || data > LARGEST {
            return Judgement::Rejected(Fault::Form);
        }
        let end = HEADER + channel + data;
        let content = &bytes[HEADER..end.min(bytes.len())];
        let name = &content[..channel.min(content.len())];
        if !name.iter().all(|b| b.is_ascii_graphic() || *b == b' ') {
            return Judgement::Rejected(Fault::Form);
        }
        let inside = content.iter().enumerate().filter(|(_, b)| **b == MARK[0]);
        match () {
            () if inside.into_iter().any(|(at, _)| content[at..].starts_with(&MARK)) => {
                Judgement::Rejected(Fault::Form)
            }
            () if bytes.len() < end => Judgement::Incomplete,
            () => Judgement::Frame(end),
        }
    }
}

/// A channel: the type of its first message, and the place of the time among its numbers.
#[derive(Debug)]
struct Channel {
    fingerprint: Option<u64>,
    name: Option<String>,
    time: Option<usize>,
}

/// The channels of a log.
#[derive(Debug)]
struct Channels {
    options: Options,
    /// Types by their fingerprints.
    known: Vec<(u64, String)>,
    topics: Vec<Topic>,
    all: Vec<Channel>,
}

impl Channels {
    /// The index of the channel of an event, which its first message describes; `None` if it is not selected.
    fn of(&mut self, name: &[u8], data: &[u8]) -> Option<usize> {
        if let Some(k) = self.topics.iter().position(|topic| topic.name.as_bytes() == name) {
            return Some(k);
        }
        let channel = String::from_utf8_lossy(name).into_owned();
        if self.topics.len() >= CHANNELS || !self.options.selects(&channel) {
            return None;
        }
        let fingerprint = fingerprint(data);
        let name = self.known.iter().find(|(known, _)| Some(*known) == fingerprint);
        let name = name.map(|(_, name)| name.clone());
        let mut values = Vec::new();
        let mut walk = Walk { names: Some(Vec::new()), values: &mut values };
        let body = data.get(FINGERPRINT..).unwrap_or_default();
        let types = &self.options.definitions;
        let read = name.as_ref().is_some_and(|name| types.read(name, body, &mut walk));
        let fields = walk.names.filter(|_| read).unwrap_or_default();
        let time = fields.iter().position(|f| f == "utime" || f == "timestamp");
        self.topics.push(Topic { name: channel, instance: 0, fields });
        self.all.push(Channel { fingerprint, name, time });
        Some(self.topics.len() - 1)
    }
}

fn fingerprint(data: &[u8]) -> Option<u64> {
    data.first_chunk().map(|bytes| u64::from_be_bytes(*bytes))
}

/// The reader of event logs.
#[derive(Debug)]
pub struct Lcm<R> {
    frames: Frames<R, Events>,
    channels: Channels,
    /// Messages of another type than the first of their channel, or that do not fit their type.
    others: Count,
}

impl<R: Read> Lcm<R> {
    /// The events of `reader`.
    pub fn new(reader: R, options: Options) -> Self {
        let known = options.definitions.fingerprints();
        let channels = Channels { options, known, topics: Vec::new(), all: Vec::new() };
        Self { frames: Frames::new(reader, Events), channels, others: Count::default() }
    }
}

/// The time of a message: its own in microseconds or nanoseconds, where it is near that of its reception.
fn stamp(own: Option<f64>, received: f64) -> Stamp {
    let micros = own.into_iter().flat_map(|time| [time, 1e-3 * time]);
    let near = micros.into_iter().find(|time| (time - received).abs() < APART);
    let micros = near.unwrap_or(received);
    // microseconds since 1970 have 51 bits, and fit into the mantissa
    let nanos = || 1000 * micros as i64 + (1e3 * micros.fract()) as i64;
    if (0.0..9e15).contains(&micros) { Stamp::Date(nanos()) } else { Stamp::Missing }
}

impl<R: Read + Send> Decoder for Lcm<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let (offset, bytes) = (frame.offset, frame.bytes);
            let received = I64.read::<false>(&bytes[12..]);
            let (name, data) = bytes[HEADER..].split_at(I32.read::<false>(&bytes[20..]) as usize);
            let Some(topic) = self.channels.of(name, data) else { continue };
            let of = &self.channels.all[topic];
            values.clear();
            let mut walk = Walk { names: None, values };
            let body = data.get(FINGERPRINT..).unwrap_or_default();
            let types = &self.channels.options.definitions;
            let fits = of.name.as_ref().is_none_or(|name| types.read(name, body, &mut walk));
            let whole = values.len() == self.channels.topics[topic].fields.len();
            if !fits || !whole || fingerprint(data) != of.fingerprint {
                self.others.add(offset);
                continue;
            }
            let own = of.time.and_then(|k| values.get(k).copied());
            let stamp = stamp(own.filter(|_| !self.channels.options.received), received);
            return Ok(Some(Record { offset, topic, stamp }));
        }
    }

    fn topics(&self) -> &[Topic] {
        &self.channels.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }

    fn events(&self) -> Option<String> {
        self.others.describe("message", "that does not fit the type of its channel")
    }
}
