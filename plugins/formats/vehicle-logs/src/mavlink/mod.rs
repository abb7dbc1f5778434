//! MAVLink telemetry logs: each message of version 1 or 2 after the time at which it was received,
//! microseconds since 1970 in big-endian order. An autopilot sends the messages without this time.

mod messages;

use crate::record::{Decoder, Options, Record, Topic};
use messages::Dialect;
use navfuse_frames::mavlink::checksum;
use navfuse_frames::{Count, Damage, Fault, Frames, Framing, Judgement, Stamp};
use std::io::{Read, Result};

/// Size in bytes of the time before a message.
const STAMP: usize = 8;
/// First byte of a message of version 1, and of version 2.
const MARKS: [u8; 2] = [0xfe, 0xfd];
/// Flag of a message of version 2 with a signature of 13 bytes.
const SIGNED: u8 = 1;
/// Largest payload in bytes.
const PAYLOAD: usize = 255;
/// Largest number of topics: messages of several systems.
const TOPICS: usize = 1024;
/// Difference of the clock of a vehicle from the time of reception, in nanoseconds, beyond which
/// the clock was set or restarted.
const STEP: i64 = 5_000_000_000;
/// Microseconds beyond which a time counts from 1970, not from the start of the vehicle: 2001.
const SINCE_1970: i64 = 1_000_000_000_000_000;

/// The parts of a message.
#[derive(Clone, Copy, Debug)]
struct Header {
    id: u32,
    system: u8,
    /// Offset of the payload from the mark, and its size.
    payload: usize,
    size: usize,
    /// Size with time, checksum and signature.
    total: usize,
}

/// The parts of the message in a frame whose mark is after `stamp` bytes; `None` if bytes are missing.
fn header(bytes: &[u8], stamp: usize) -> Option<Header> {
    let rest = bytes.get(stamp..)?;
    let size = usize::from(*rest.get(1)?);
    if rest[0] == MARKS[0] {
        let (system, id) = (*rest.get(3)?, u32::from(*rest.get(5)?));
        return Some(Header { id, system, payload: 6, size, total: stamp + 6 + size + 2 });
    }
    let id = u32::from_le_bytes([*rest.get(7)?, *rest.get(8)?, *rest.get(9)?, 0]);
    let signature = if rest[2] & SIGNED != 0 { 13 } else { 0 };
    let total = stamp + 10 + size + 2 + signature;
    Some(Header { id, system: rest[5], payload: 10, size, total })
}

/// The framing of messages, each after a time of so many bytes.
#[derive(Debug)]
struct Packets {
    dialect: Dialect,
    stamp: usize,
}

impl Framing for Packets {
    const MAX: usize = STAMP + 10 + PAYLOAD + 2 + 13;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        let beyond = bytes.len().saturating_sub(self.stamp);
        let marks = bytes.get(self.stamp..).unwrap_or_default();
        // the mark of a time at the end may be beyond it
        marks.iter().position(|b| MARKS.contains(b)).or((beyond < bytes.len()).then_some(beyond))
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let Some(h) = header(bytes, self.stamp) else { return Judgement::Incomplete };
        let Some(extra) = self.dialect.extra(h.id) else { return Judgement::Rejected(Fault::Form) };
        let packet = bytes.get(self.stamp..h.total);
        let Some(packet) = packet else { return Judgement::Incomplete };
        let (content, rest) = packet.split_at(h.payload + h.size);
        match checksum(&content[1..], extra).to_le_bytes() == rest[..2] {
            true => Judgement::Frame(h.total),
            false => Judgement::Rejected(Fault::Checksum),
        }
    }
}

/// A clock of a vehicle: since its start, or since 1970.
#[derive(Debug)]
struct Anchor {
    system: u8,
    since_1970: bool,
    /// Nanoseconds from this clock to that of the log.
    offset: i64,
}

/// The reader of telemetry logs.
#[derive(Debug)]
pub struct Tlog<R> {
    frames: Frames<R, Packets>,
    options: Options,
    topics: Vec<Topic>,
    /// Identifier and system of each topic, and the places of its time in microseconds and in milliseconds.
    keys: Vec<(u32, u8, [Option<usize>; 2])>,
    anchors: Vec<Anchor>,
    steps: Count,
    /// The clock by which messages without a time of their own are received, ns since 1970.
    now: Option<fn() -> i64>,
}

impl<R: Read> Tlog<R> {
    /// The messages of a log.
    pub fn new(reader: R, options: Options) -> Self {
        Self::with(reader, options, None)
    }

    /// The messages of an autopilot as they arrive, and the clock of this computer.
    pub fn connected(reader: R, options: Options, now: fn() -> i64) -> Self {
        Self::with(reader, options, Some(now))
    }

    fn with(reader: R, options: Options, now: Option<fn() -> i64>) -> Self {
        let stamp = if now.is_some() { 0 } else { STAMP };
        Self {
            now,
            frames: Frames::new(reader, Packets { dialect: Dialect::new(), stamp }),
            options,
            topics: Vec::new(),
            keys: Vec::new(),
            anchors: Vec::new(),
            steps: Count::default(),
        }
    }

    /// Index of the topic of a message; `None` if it is not selected.
    fn topic(&mut self, id: u32, system: u8) -> Option<usize> {
        if let Some(known) = self.keys.iter().position(|(i, s, _)| (*i, *s) == (id, system)) {
            return Some(known);
        }
        let message = self.frames.framing().dialect.message(id)?;
        if self.topics.len() >= TOPICS || !self.options.selects(message.name) {
            return None;
        }
        let fields: Vec<String> = message.fields.iter().map(|(name, ..)| name.clone()).collect();
        let times = ["time_usec", "time_boot_ms"].map(|t| fields.iter().position(|f| f == t));
        self.topics.push(Topic { name: message.name.to_owned(), instance: system.into(), fields });
        self.keys.push((id, system, times));
        Some(self.keys.len() - 1)
    }

    /// The time of a message on the clock of the log. The first message of a vehicle's clock fixes
    /// the offset between the two, so that intervals are those of the vehicle.
    fn time(&mut self, topic: usize, values: &[f64], received: i64, offset: u64) -> Stamp {
        let (_, system, times) = self.keys[topic];
        let [micros, millis] = times.map(|k| k.and_then(|k| values.get(k)));
        let micros = match (micros, millis) {
            (Some(micros), _) => *micros as i64,
            (None, Some(millis)) => *millis as i64 * 1000,
            (None, None) => 0,
        };
        let nanos = micros.checked_mul(1000).filter(|n| *n > 0 && !self.options.received);
        let Some(nanos) = nanos else {
            return if received > 0 { Stamp::Date(received) } else { Stamp::Missing };
        };
        let since_1970 = micros > SINCE_1970;
        let same = |a: &Anchor| a.system == system && a.since_1970 == since_1970;
        let anchor = self.anchors.iter().position(same);
        let fresh = received.saturating_sub(nanos);
        let offset = match anchor.map(|k| &mut self.anchors[k].offset) {
            None if received > 0 => {
                self.anchors.push(Anchor { system, since_1970, offset: fresh });
                fresh
            }
            None => return Stamp::Missing,
            Some(known) if received > 0 && fresh.saturating_sub(*known).saturating_abs() > STEP => {
                self.steps.add(offset);
                *known = fresh;
                fresh
            }
            Some(known) => *known,
        };
        nanos.checked_add(offset).map_or(Stamp::Missing, Stamp::Date)
    }
}

impl<R: Read + Send> Decoder for Tlog<R> {
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Record>> {
        loop {
            let Some(frame) = self.frames.next()? else { return Ok(None) };
            let stamp = if self.now.is_some() { 0 } else { STAMP };
            let (offset, Some(h)) = (frame.offset, header(frame.bytes, stamp)) else { continue };
            // a message of version 2 ends before its last zeros, and an old one before newer fields
            let mut payload = [0; PAYLOAD];
            let from = stamp + h.payload;
            payload[..h.size].copy_from_slice(&frame.bytes[from..from + h.size]);
            let micros = frame.bytes.first_chunk().map_or(0, |b| u64::from_be_bytes(*b));
            let logged = i64::try_from(micros).ok().and_then(|m| m.checked_mul(1000));
            let received = self.now.map_or(logged, |now| Some(now()));
            let Some(topic) = self.topic(h.id, h.system) else { continue };
            let Some(message) = self.frames.framing().dialect.message(h.id) else { continue };
            values.clear();
            let fields = message.fields.iter();
            values.extend(
                fields.map(|(_, at, kind)| kind.read::<true>(payload.get(*at..).unwrap_or(&[]))),
            );
            let stamp = self.time(topic, values, received.unwrap_or(0), offset);
            return Ok(Some(Record { offset, topic, stamp }));
        }
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn damage(&self) -> &Damage {
        self.frames.damage()
    }

    fn events(&self) -> Option<String> {
        self.steps.describe("step", "of the vehicle's clock")
    }
}
