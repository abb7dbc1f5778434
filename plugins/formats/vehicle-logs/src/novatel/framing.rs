//! The frames of NovAtel's logs.

use navfuse_frames::Number::{self, U16, U32};
use navfuse_frames::{Fault, Framing, Judgement};

/// First and second byte of a binary log, and the third one of a long and of a short header.
pub const BINARY: u8 = 0xaa;
const SECOND: u8 = 0x44;
const LONG: u8 = 0x12;
const SHORT: u8 = 0x13;
/// Sizes in bytes of a short header, and of the CRC.
const FIRST: usize = 12;
const CHECK: usize = 4;

/// The framing of logs in text: mark, text, `*` and eight hexadecimal digits of a CRC; and of binary
/// ones: three marks, a long or a short header, content and the CRC.
#[derive(Debug)]
pub struct Logs {
    /// Set if a log in text is used whatever its checksum.
    pub unchecked: bool,
}

impl Framing for Logs {
    const MAX: usize = 16 * 1024;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| matches!(*b, b'#' | b'%' | BINARY))
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        if bytes[0] == BINARY { binary(bytes) } else { text(bytes, self.unchecked) }
    }

    fn separates(&self, byte: u8) -> bool {
        matches!(byte, b'\r' | b'\n')
    }
}

/// Tests whether a log in text has its right checksum.
pub fn is_checked(log: &[u8]) -> bool {
    text(log, false) == Judgement::Frame(log.len())
}

fn text(bytes: &[u8], unchecked: bool) -> Judgement {
    let ends = |b: &u8| matches!(b, b'*' | b'#' | b'%') || !(b' '..=b'~').contains(b);
    let Some(length) = bytes[1..].iter().position(ends) else { return Judgement::Incomplete };
    let end = 1 + length;
    if bytes[end] != b'*' {
        return Judgement::Rejected(Fault::Form);
    }
    let Some(digits) = bytes.get(end + 1..end + 9) else { return Judgement::Incomplete };
    let written = std::str::from_utf8(digits).ok().and_then(|d| u32::from_str_radix(d, 16).ok());
    match written {
        None => Judgement::Rejected(Fault::Form),
        Some(crc) if unchecked || crc == checksum(&bytes[1..end]) => Judgement::Frame(end + 9),
        Some(_) => Judgement::Rejected(Fault::Checksum),
    }
}

fn binary(bytes: &[u8]) -> Judgement {
    if bytes.get(1).is_some_and(|byte| *byte != SECOND) {
        return Judgement::Rejected(Fault::Form);
    }
    let Some(header) = Header::read(bytes) else {
        let long = bytes.get(2).is_none_or(|kind| [LONG, SHORT].contains(kind));
        return if long { Judgement::Incomplete } else { Judgement::Rejected(Fault::Form) };
    };
    let end = header.size + header.content;
    if header.size < FIRST || end + CHECK > Logs::MAX {
        return Judgement::Rejected(Fault::Form);
    }
    match bytes.get(end..).and_then(|rest| rest.first_chunk()) {
        None => Judgement::Incomplete,
        Some(crc) if u32::from_le_bytes(*crc) == checksum(&bytes[..end]) => {
            Judgement::Frame(end + CHECK)
        }
        Some(_) => Judgement::Rejected(Fault::Checksum),
    }
}

/// The header of a binary log.
#[derive(Clone, Copy, Debug)]
pub struct Header {
    /// Sizes in bytes of the header and of the content.
    pub size: usize,
    content: usize,
    /// Number of the log.
    pub id: u32,
    /// Week of GPS, and milliseconds of the week.
    pub time: [f64; 2],
}

impl Header {
    /// The header at the beginning of some bytes; `None` where they are too few or no header.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let at = |place: usize, kind: Number| kind.read::<true>(bytes.get(place..).unwrap_or(&[]));
        let header = match *bytes.get(2)? {
            LONG => Self {
                size: usize::from(*bytes.get(3)?),
                content: at(8, U16) as usize,
                id: at(4, U16) as u32,
                time: [at(14, U16), at(16, U32)],
            },
            SHORT => Self {
                size: FIRST,
                content: usize::from(*bytes.get(3)?),
                id: at(4, U16) as u32,
                time: [at(6, U16), at(8, U32)],
            },
            _ => return None,
        };
        (!header.time[1].is_nan()).then_some(header)
    }
}

/// The CRC-32 of NovAtel: the polynomial 0xedb88320, reflected, start 0, not inverted.
fn checksum(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let (mut table, mut k) = ([0; 256], 0);
        while k < 256 {
            let (mut crc, mut bit) = (k as u32, 0);
            while bit < 8 {
                crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
                bit += 1;
            }
            table[k] = crc;
            k += 1;
        }
        table
    };
    bytes.iter().fold(0, |crc, b| (crc >> 8) ^ TABLE[usize::from((crc as u8) ^ b)])
}
