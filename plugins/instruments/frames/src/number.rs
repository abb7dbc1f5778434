//! Numbers of binary formats.

/// The type of a number, as programs write it in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names of the types")]
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
    /// Size in bytes.
    pub const fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at the beginning of some bytes, whose order `LITTLE` gives; NaN beyond their end.
    /// Integers beyond 2^53 are rounded.
    /// ```
    /// use navfuse_frames::Number;
    /// assert_eq!(Number::I16.read::<true>(&[0xfe, 0xff, 7]), -2.0);
    /// assert_eq!(Number::U16.read::<false>(&[1, 2]), 258.0);
    /// assert!(Number::F64.read::<true>(&[0; 7]).is_nan());
    /// ```
    #[inline]
    pub fn read<const LITTLE: bool>(self, bytes: &[u8]) -> f64 {
        macro_rules! read {
            ($type:ty) => {
                match bytes.first_chunk() {
                    Some(chunk) if LITTLE => <$type>::from_le_bytes(*chunk) as f64,
                    Some(chunk) => <$type>::from_be_bytes(*chunk) as f64,
                    None => f64::NAN,
                }
            };
        }
        match self {
            Self::Bool | Self::U8 => read!(u8),
            Self::I8 => read!(i8),
            Self::I16 => read!(i16),
            Self::U16 => read!(u16),
            Self::I32 => read!(i32),
            Self::U32 => read!(u32),
            Self::I64 => read!(i64),
            Self::U64 => read!(u64),
            Self::F32 => read!(f32),
            Self::F64 => read!(f64),
        }
    }
}
