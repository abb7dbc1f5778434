//! The file: its beginning, its chunks, and the summary at its end.
//!
//! The library `mcap` compresses while it writes, some bytes at a time: for messages of 100 to 800
//! bytes this costs several times the compression of a whole chunk at once. Here a chunk is
//! complete before it is compressed, so that another thread can do it.

use crate::chunk::{Chunk, Definitions};
use crate::format::{by_channel, record, text, texts, u16, u32, u64s};
use crc32fast::Hasher;
use lz4_flex::frame::FrameEncoder;
use mcap::MAGIC;
use mcap::records::op;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::{self, Write};
use zstd::bulk::Compressor;
use zstd::zstd_safe::compress_bound;

/// Level of Zstandard: see `docs/src/explanation/performance.md`.
const LEVEL: i32 = -3;

/// Compression of the chunks of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Zstandard.
    #[default]
    Zstd,
    /// LZ4.
    Lz4,
    /// Not at all.
    None,
}

/// A file to which chunks are being written.
pub struct LogFile<W> {
    out: W,
    /// Number of bytes that were written.
    position: u64,
    /// Checksum of all of them.
    checksum: Hasher,
    packer: Packer,
    definitions: Definitions,
    /// Number of messages by channel.
    counts: Vec<u64>,
    span: Option<[u64; 2]>,
    chunks: Index,
    attachments: Index,
    metadata: Index,
    buffer: Vec<u8>,
    packed: Vec<u8>,
}

/// Records of the summary of one kind.
#[derive(Debug, Default)]
struct Index {
    records: Vec<u8>,
    count: u32,
}

impl Index {
    fn add(&mut self, opcode: u8, fields: impl FnOnce(&mut Vec<u8>)) {
        record(&mut self.records, opcode, fields);
        self.count += 1;
    }
}

/// Compresses chunks.
enum Packer {
    Zstd(Compressor<'static>),
    Lz4,
    None,
}

impl Packer {
    fn new(compression: Compression) -> io::Result<Self> {
        Ok(match compression {
            Compression::Zstd => Self::Zstd(Compressor::new(LEVEL)?),
            Compression::Lz4 => Self::Lz4,
            Compression::None => Self::None,
        })
    }

    /// The name of the compression in the format.
    fn name(&self) -> &'static str {
        match self {
            Self::Zstd(_) => "zstd",
            Self::Lz4 => "lz4",
            Self::None => "",
        }
    }

    fn pack(&mut self, records: &[u8], out: &mut Vec<u8>) -> io::Result<()> {
        out.clear();
        match self {
            Self::Zstd(compressor) => {
                out.reserve(compress_bound(records.len()));
                compressor.compress_to_buffer(records, out)?;
            }
            Self::Lz4 => {
                let mut encoder = FrameEncoder::new(std::mem::take(out));
                encoder.write_all(records)?;
                *out = encoder.finish()?;
            }
            Self::None => out.extend_from_slice(records),
        }
        Ok(())
    }
}

impl<W: Write> LogFile<W> {
    /// Begins a file.
    pub fn begin(
        out: W,
        compression: Compression,
        library: &str,
        definitions: Definitions,
    ) -> io::Result<Self> {
        let mut file = Self {
            out,
            position: 0,
            checksum: Hasher::new(),
            packer: Packer::new(compression)?,
            counts: vec![0; usize::from(definitions.counts()[1])],
            definitions,
            span: None,
            chunks: Index::default(),
            attachments: Index::default(),
            metadata: Index::default(),
            buffer: MAGIC.to_vec(),
            packed: Vec::new(),
        };
        record(&mut file.buffer, op::HEADER, |out| {
            text(out, "ros2");
            text(out, library);
        });
        file.write_buffer()?;
        Ok(file)
    }

    /// Number of bytes that have been written.
    pub fn length(&self) -> u64 {
        self.position
    }

    /// Writes the buffer and clears it.
    fn write_buffer(&mut self) -> io::Result<()> {
        let bytes = std::mem::take(&mut self.buffer);
        let written = self.write(&bytes);
        self.buffer = bytes;
        self.buffer.clear();
        written
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.checksum.update(bytes);
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Writes texts by their names.
    pub fn metadata(&mut self, name: &str, entries: &BTreeMap<String, String>) -> io::Result<()> {
        record(&mut self.buffer, op::METADATA, |out| {
            text(out, name);
            texts(out, entries);
        });
        let (offset, length) = (self.position, self.buffer.len() as u64);
        self.metadata.add(op::METADATA_INDEX, |out| {
            u64s(out, [offset, length]);
            text(out, name);
        });
        self.write_buffer()
    }

    /// Writes a file inside of this file.
    pub fn attach(&mut self, name: &str, media: &str, time: u64, data: &[u8]) -> io::Result<()> {
        record(&mut self.buffer, op::ATTACHMENT, |out| {
            let start = out.len();
            u64s(out, [time, 0]);
            text(out, name);
            text(out, media);
            u64s(out, [data.len() as u64]);
            out.extend_from_slice(data);
            let checksum = crc32fast::hash(&out[start..]);
            u32(out, checksum);
        });
        let (offset, length) = (self.position, self.buffer.len() as u64);
        self.attachments.add(op::ATTACHMENT_INDEX, |out| {
            u64s(out, [offset, length, time, 0, data.len() as u64]);
            text(out, name);
            text(out, media);
        });
        self.write_buffer()
    }

    /// Compresses and writes a chunk and the index of its messages.
    pub fn chunk(&mut self, chunk: &Chunk) -> io::Result<()> {
        let mut packed = std::mem::take(&mut self.packed);
        let result = self.packed_chunk(chunk, &mut packed);
        self.packed = packed;
        result
    }

    fn packed_chunk(&mut self, chunk: &Chunk, packed: &mut Vec<u8>) -> io::Result<()> {
        self.packer.pack(&chunk.records, packed)?;
        let compression = self.packer.name();
        let span = chunk.span.unwrap_or_default();
        let start = self.position;
        let raw = chunk.records.len() as u64;
        let length = packed.len() as u64;
        // the record is as long as its fields: three numbers, a checksum, a text and the records
        let fields = 3 * 8 + 4 + 4 + compression.len() as u64 + 8 + length;
        self.buffer.push(op::CHUNK);
        u64s(&mut self.buffer, [fields, span[0], span[1], raw]);
        u32(&mut self.buffer, crc32fast::hash(&chunk.records));
        text(&mut self.buffer, compression);
        u64s(&mut self.buffer, [length]);
        self.write_buffer()?;
        self.write(packed)?;
        let end = self.position;
        let mut offsets = Vec::new();
        for (channel, entries) in chunk.index.iter().enumerate().filter(|(_, e)| !e.is_empty()) {
            offsets.push((channel as u16, end + self.buffer.len() as u64));
            record(&mut self.buffer, op::MESSAGE_INDEX, |out| {
                u16(out, channel as u16);
                crate::format::bytes(out, entries);
            });
            self.counts[channel] += entries.len() as u64 / 16;
        }
        let index = self.buffer.len() as u64;
        self.write_buffer()?;
        self.chunks.add(op::CHUNK_INDEX, |out| {
            u64s(out, [span[0], span[1], start, end - start]);
            by_channel(out, offsets.into_iter());
            u64s(out, [index]);
            text(out, compression);
            u64s(out, [length, raw]);
        });
        if let Some([from, to]) = chunk.span {
            self.span = Some(self.span.map_or([from, to], |[a, b]| [a.min(from), b.max(to)]));
        }
        Ok(())
    }

    /// Writes the summary, and returns the file.
    pub fn finish(mut self) -> io::Result<W> {
        let checksum = self.checksum.clone().finalize();
        record(&mut self.buffer, op::DATA_END, |out| u32(out, checksum));
        self.write_buffer()?;
        let start = self.position;
        let summary = self.summary(start);
        self.write(&summary)?;
        self.out.flush()?;
        Ok(self.out)
    }

    /// The summary section, the footer and the magic bytes at the end.
    fn summary(&self, start: u64) -> Vec<u8> {
        let mut out = Vec::new();
        let [schemas, channels] = self.definitions.counts();
        let mut statistics = Vec::new();
        record(&mut statistics, op::STATISTICS, |out| {
            u64s(out, [self.counts.iter().sum()]);
            u16(out, schemas);
            let counts = [&self.attachments, &self.metadata, &self.chunks].map(|i| i.count);
            [u32::from(channels)].into_iter().chain(counts).for_each(|n| u32(out, n));
            u64s(out, self.span.unwrap_or_default());
            let counts = self.counts.iter().enumerate().filter(|(_, n)| **n > 0);
            by_channel(out, counts.map(|(channel, n)| (channel as u16, *n)));
        });
        let groups = [
            (op::SCHEMA, &self.definitions.schemas),
            (op::CHANNEL, &self.definitions.channels),
            (op::STATISTICS, &statistics),
            (op::CHUNK_INDEX, &self.chunks.records),
            (op::ATTACHMENT_INDEX, &self.attachments.records),
            (op::METADATA_INDEX, &self.metadata.records),
        ];
        let mut offsets = Vec::new();
        for (opcode, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            record(&mut offsets, op::SUMMARY_OFFSET, |group| {
                group.push(opcode);
                u64s(group, [start + out.len() as u64, records.len() as u64]);
            });
            out.extend_from_slice(records);
        }
        let offsets_start = start + out.len() as u64;
        out.extend_from_slice(&offsets);
        record(&mut out, op::FOOTER, |_| {});
        // the footer is not complete yet, but its length is: two numbers and a checksum
        let length = out.len() - 8;
        out[length..].copy_from_slice(&(2 * 8 + 4_u64).to_le_bytes());
        u64s(&mut out, [start, offsets_start]);
        let checksum = crc32fast::hash(&out);
        u32(&mut out, checksum);
        out.extend_from_slice(MAGIC);
        out
    }
}
