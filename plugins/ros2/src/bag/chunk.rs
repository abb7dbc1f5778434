//! Unpacking of chunks.

use std::io::Read;

/// Largest size in bytes of a chunk or a record; a larger one counts as damaged.
pub const LONGEST: usize = 1 << 26;

/// Unpacks the records of chunks.
pub struct Unpacker {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
}

impl Unpacker {
    pub fn new() -> Self {
        Self { zstd: None }
    }

    /// Unpacks a whole chunk; `false` if its content is damaged.
    pub fn whole(
        &mut self,
        compression: &[u8],
        packed: &[u8],
        size: usize,
        crc: u32,
        out: &mut Vec<u8>,
    ) -> bool {
        out.clear();
        let unpacked = size <= LONGEST
            && match compression {
                b"" => {
                    out.extend_from_slice(packed);
                    true
                }
                b"zstd" => self.zstd(packed, size, out),
                b"lz4" => {
                    let reader = lz4_flex::frame::FrameDecoder::new(packed);
                    reader.take(size as u64 + 1).read_to_end(out).is_ok()
                }
                _ => false,
            };
        unpacked && out.len() == size && (crc == 0 || crc32fast::hash(out) == crc)
    }

    fn zstd(&mut self, packed: &[u8], size: usize, out: &mut Vec<u8>) -> bool {
        if self.zstd.is_none() {
            self.zstd = zstd::bulk::Decompressor::new().ok();
        }
        let Some(zstd) = &mut self.zstd else { return false };
        out.reserve(size);
        zstd.decompress_to_buffer(packed, out).is_ok()
    }

    /// Unpacks the beginning of a chunk whose end is missing.
    pub fn beginning(compression: &[u8], packed: &[u8], out: &mut Vec<u8>) {
        out.clear();
        let reader: Option<Box<dyn Read + '_>> = match compression {
            b"" => Some(Box::new(packed)),
            b"zstd" => match zstd::Decoder::with_buffer(packed) {
                Ok(decoder) => Some(Box::new(decoder)),
                Err(_) => None,
            },
            b"lz4" => Some(Box::new(lz4_flex::frame::FrameDecoder::new(packed))),
            _ => None,
        };
        if let Some(reader) = reader {
            // the error at the end is the cut; the bytes before it are kept
            let _ = reader.take(LONGEST as u64).read_to_end(out);
        }
    }
}
