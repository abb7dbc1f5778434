//! The outer form of an MCAP file: its records, the heads of records and of chunks, and the unpacking
//! of chunks.

mod records;

pub use records::{Chunks, Found, Lost, MESSAGE_HEAD, Place, Records};

use std::io::Read;

/// Opcodes of the records.
#[allow(missing_docs, reason = "the names are those of the specification")]
pub mod op {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const METADATA: u8 = 0x0c;
    pub const DATA_END: u8 = 0x0f;
}

/// First bytes of a file, and last.
pub const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Number of bytes of a record before its content: opcode and length.
pub const HEAD: usize = 9;
/// Number of bytes of a chunk beside the name of its compression and its records.
pub const CHUNK_HEAD: usize = 40;
/// Largest size in bytes of a chunk or a record; a larger one counts as damaged.
pub const LONGEST: usize = 1 << 26;

/// The parts of a record, read from front to back.
pub struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    /// The next bytes.
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (now, later) = self.0.split_at_checked(count)?;
        self.0 = later;
        Some(now)
    }

    /// A number of 16 bits.
    pub fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.take(2)?.try_into().ok()?))
    }

    /// A number of 32 bits.
    pub fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    /// A number of 64 bits.
    pub fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    /// Bytes after their number.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    /// A text after the number of its bytes.
    pub fn text(&mut self) -> Option<String> {
        Some(String::from_utf8_lossy(self.bytes()?).into_owned())
    }
}

/// Tests whether the texts of a record with names are as long as they claim. Libraries reserve the
/// claimed length, up to 4 GiB for each text, before they read it.
pub fn is_sound(opcode: u8, content: &[u8]) -> bool {
    let texts = |fields: &mut Fields<'_>, count: usize| {
        (0..count).try_for_each(|_| fields.bytes().map(drop))
    };
    let map = |fields: &mut Fields<'_>| {
        let mut entries = Fields(fields.bytes()?);
        while !entries.0.is_empty() {
            texts(&mut entries, 2)?;
        }
        Some(())
    };
    let mut fields = Fields(content);
    let walked = match opcode {
        op::HEADER => texts(&mut fields, 2),
        op::SCHEMA => fields.take(2).and_then(|_| texts(&mut fields, 3)),
        op::CHANNEL => {
            fields.take(4).and_then(|_| texts(&mut fields, 2)).and_then(|()| map(&mut fields))
        }
        op::METADATA => texts(&mut fields, 1).and_then(|()| map(&mut fields)),
        _ => Some(()),
    };
    walked.is_some()
}

/// Opcode and length of the record at the beginning of some bytes.
pub fn head(bytes: &[u8]) -> Option<(u8, u64)> {
    let mut fields = Fields(bytes.get(1..)?);
    Some((bytes[0], fields.u64()?))
}

/// Opcode and length of the record at the beginning of some bytes, if they hold all of it.
pub fn whole_head(bytes: &[u8]) -> Option<(u8, usize)> {
    let (opcode, length) = head(bytes)?;
    let length = usize::try_from(length).ok()?;
    (length <= bytes.len() - HEAD).then_some((opcode, length))
}

/// A chunk as it is packed.
#[derive(Clone, Copy, Debug)]
pub struct PackedChunk<'a> {
    /// Size in bytes of the unpacked records.
    pub size: u64,
    /// Checksum of the unpacked records; 0 if there is none.
    pub crc: u32,
    /// Name of the compression; empty for none.
    pub compression: &'a [u8],
    /// Length in bytes of the packed records.
    pub length: u64,
    /// The packed records, as far as they are there.
    pub packed: &'a [u8],
}

impl<'a> PackedChunk<'a> {
    /// Reads the content of a chunk's record, whose end may be missing.
    pub fn new(content: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(content);
        fields.take(16)?;
        let (size, crc) = (fields.u64()?, fields.u32()?);
        let compression = fields.bytes()?;
        let length = fields.u64()?;
        Some(Self { size, crc, compression, length, packed: fields.0 })
    }

    /// Tests whether the length of the chunk's record is that of its parts.
    pub fn fits(&self, length: usize) -> bool {
        let records = length.checked_sub(CHUNK_HEAD + self.compression.len());
        records.is_some_and(|n| n as u64 == self.length)
    }

    /// Unpacks the beginning of the records of a chunk whose end is missing.
    pub fn unpack_beginning(&self, out: &mut Vec<u8>) {
        out.clear();
        let reader: Option<Box<dyn Read + '_>> = match self.compression {
            b"" => Some(Box::new(self.packed)),
            b"zstd" => match zstd::Decoder::with_buffer(self.packed) {
                Ok(decoder) => Some(Box::new(decoder)),
                Err(_) => None,
            },
            b"lz4" => Some(Box::new(lz4_flex::frame::FrameDecoder::new(self.packed))),
            _ => None,
        };
        if let Some(reader) = reader {
            // the error at the end is the cut; the bytes before it are kept
            let _ = reader.take(LONGEST as u64).read_to_end(out);
        }
    }
}

/// Unpacks the records of chunks.
#[derive(Default)]
pub struct Unpacker {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
}

impl Unpacker {
    /// Unpacks a whole chunk; `false` if it is damaged or of an unknown compression, and `out` then
    /// has no meaning.
    pub fn unpack(&mut self, chunk: &PackedChunk<'_>, out: &mut Vec<u8>) -> bool {
        out.clear();
        let Some(size) = usize::try_from(chunk.size).ok().filter(|n| *n <= LONGEST) else {
            return false;
        };
        let unpacked = match chunk.compression {
            b"" => {
                out.extend_from_slice(chunk.packed);
                true
            }
            b"zstd" => self.zstd(chunk.packed, size, out),
            b"lz4" => {
                let reader = lz4_flex::frame::FrameDecoder::new(chunk.packed);
                reader.take(size as u64 + 1).read_to_end(out).is_ok()
            }
            _ => false,
        };
        let intact = || chunk.crc == 0 || crc32fast::hash(out) == chunk.crc;
        unpacked && out.len() == size && intact()
    }

    fn zstd(&mut self, packed: &[u8], size: usize, out: &mut Vec<u8>) -> bool {
        if self.zstd.is_none() {
            self.zstd = zstd::bulk::Decompressor::new().ok();
        }
        let Some(zstd) = &mut self.zstd else { return false };
        out.reserve(size);
        zstd.decompress_to_buffer(packed, out).is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_claims_more_than_its_record_has_is_not_sound() {
        let text = |claimed: u32| [&claimed.to_le_bytes()[..], b"abc"].concat();
        let map = |of: &[u8]| [&(of.len() as u32).to_le_bytes()[..], of].concat();
        let record = |entry: u32| [text(3), map(&[text(3), text(entry)].concat())].concat();
        assert!(is_sound(op::METADATA, &record(3)));
        for claimed in [4, u32::MAX] {
            assert!(!is_sound(op::METADATA, &record(claimed)));
            assert!(!is_sound(op::HEADER, &[text(3), text(claimed)].concat()));
            let channel = [&[0; 4][..], &text(3), &text(3), &map(&text(claimed))].concat();
            assert!(!is_sound(op::CHANNEL, &channel));
            assert!(!is_sound(op::SCHEMA, &[&[0; 2][..], &text(3), &text(claimed)].concat()));
        }
    }
}
