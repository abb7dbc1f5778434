//! Values in CDR, the encoding of messages on the wire and in bags.

use crate::error::MessageError;

/// Bytes before the body of a message: the representation and its options.
const ENCAPSULATION: usize = 4;

/// The body of a message and its byte order.
///
/// # Errors
/// When the representation is another than plain CDR.
pub fn body(message: &[u8]) -> Result<(&[u8], bool), MessageError> {
    match message.split_at_checked(ENCAPSULATION) {
        None => Err(MessageError::Short { at: message.len() }),
        Some(([0, 0, ..], body)) => Ok((body, false)),
        Some(([0, 1, ..], body)) => Ok((body, true)),
        Some((head, _)) => {
            Err(MessageError::Representation(u16::from_be_bytes([head[0], head[1]])))
        }
    }
}

/// A primitive type of a fixed size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    /// Size in bytes, which is also the alignment.
    pub const fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// A place in the body of a message; `LITTLE` is its byte order. Every read is checked.
#[derive(Clone, Copy, Debug)]
pub struct Cursor<'a, const LITTLE: bool> {
    body: &'a [u8],
    at: usize,
}

impl<'a, const LITTLE: bool> Cursor<'a, LITTLE> {
    /// The beginning of a body.
    pub fn new(body: &'a [u8]) -> Self {
        Self { body, at: 0 }
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
        let from = self.at.next_multiple_of(size);
        let end = size.checked_mul(count).and_then(|n| from.checked_add(n)).ok_or(short)?;
        let bytes = self.body.get(from..end).ok_or(short)?;
        self.at = end;
        Ok(bytes)
    }

    /// The value of a number in its own bytes.
    #[inline]
    pub fn value(number: Number, bytes: &[u8]) -> f64 {
        macro_rules! read {
            ($type:ty) => {{
                let bytes = bytes.try_into().unwrap_or_default();
                let value = if LITTLE {
                    <$type>::from_le_bytes(bytes)
                } else {
                    <$type>::from_be_bytes(bytes)
                };
                value as f64
            }};
        }
        match number {
            Number::Bool | Number::U8 => read!(u8),
            Number::I8 => read!(i8),
            Number::I16 => read!(i16),
            Number::U16 => read!(u16),
            Number::I32 => read!(i32),
            Number::U32 => read!(u32),
            Number::I64 => read!(i64),
            Number::U64 => read!(u64),
            Number::F32 => read!(f32),
            Number::F64 => read!(f64),
        }
    }

    /// Reads a number.
    #[inline]
    pub fn number(&mut self, number: Number) -> Result<f64, MessageError> {
        Ok(Self::value(number, self.take(number.size(), 1)?))
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
