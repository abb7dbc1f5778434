//! Values in CDR, the encoding of messages on the wire and in bags.

use crate::error::MessageError;
use navfuse_frames::Number;

/// Bytes before the body of a message: the representation and its options.
const ENCAPSULATION: usize = 4;

/// The mark of a message of ROS 1, whose numbers follow each other without padding, and whose headers
/// begin with a counter: a representation that CDR leaves to vendors.
pub const PACKED: [u8; ENCAPSULATION] = [0x80, 1, 0, 0];

/// The body of a message, by its encoding.
#[derive(Clone, Copy, Debug)]
pub enum Body<'a> {
    Little(&'a [u8]),
    Big(&'a [u8]),
    /// Of ROS 1.
    Packed(&'a [u8]),
}

/// The body of a message.
///
/// # Errors
/// When the representation is another than plain CDR.
pub fn body(message: &[u8]) -> Result<Body<'_>, MessageError> {
    match message.split_at_checked(ENCAPSULATION) {
        None => Err(MessageError::Short { at: message.len() }),
        Some(([0, 0, ..], body)) => Ok(Body::Big(body)),
        Some(([0, 1, ..], body)) => Ok(Body::Little(body)),
        Some((head, body)) if head == PACKED => Ok(Body::Packed(body)),
        Some((head, _)) => {
            Err(MessageError::Representation(u16::from_be_bytes([head[0], head[1]])))
        }
    }
}

/// A place in the body of a message; `LITTLE` is its byte order. Every read is checked.
#[derive(Clone, Copy, Debug)]
pub struct Cursor<'a, const LITTLE: bool> {
    body: &'a [u8],
    at: usize,
    packed: bool,
}

impl<'a, const LITTLE: bool> Cursor<'a, LITTLE> {
    /// The beginning of a body.
    pub fn new(body: &'a [u8]) -> Self {
        Self { body, at: 0, packed: false }
    }

    /// The beginning of a body of ROS 1.
    pub fn packed(body: &'a [u8]) -> Self {
        Self { body, at: 0, packed: true }
    }

    /// Skips the stamp of a header, and the counter before it in ROS 1.
    pub fn stamp(&mut self) -> Result<(), MessageError> {
        self.take(4, if self.packed { 3 } else { 2 }).map(drop)
    }

    /// Number of bytes that are left.
    pub fn left(&self) -> usize {
        self.body.len() - self.at
    }

    /// Skips `count` values of a size, aligned to it; returns their bytes.
    #[inline]
    pub fn take(&mut self, size: usize, count: usize) -> Result<&'a [u8], MessageError> {
        if count == 0 {
            return Ok(&[]);
        }
        let short = MessageError::Short { at: self.at + ENCAPSULATION };
        let from = if self.packed { self.at } else { self.at.next_multiple_of(size) };
        let end = size.checked_mul(count).and_then(|n| from.checked_add(n)).ok_or(short)?;
        let bytes = self.body.get(from..end).ok_or(short)?;
        self.at = end;
        Ok(bytes)
    }

    /// Reads a number.
    #[inline]
    pub fn number(&mut self, number: Number) -> Result<f64, MessageError> {
        Ok(number.read::<LITTLE>(self.take(number.size(), 1)?))
    }

    /// Reads the number of elements of a sequence. Each element has at least one byte.
    pub fn count(&mut self) -> Result<usize, MessageError> {
        let at = self.at + ENCAPSULATION;
        let bytes = self.take(4, 1)?.try_into().unwrap_or_default();
        let count = if LITTLE { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) };
        match count as usize {
            n if n <= self.left() => Ok(n),
            _ => Err(MessageError::Count { count, at }),
        }
    }

    /// Reads a text, without the zero at its end.
    pub fn text(&mut self) -> Result<&'a [u8], MessageError> {
        let count = self.count()?;
        let bytes = self.take(1, count)?;
        Ok(bytes.strip_suffix(&[0]).unwrap_or(bytes))
    }
}
