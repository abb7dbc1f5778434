//! The formats that a log defines for itself, and the places of their fields.

use std::collections::HashMap;

/// Largest number of formats; PX4 has about 250.
const FORMATS: usize = 4096;
/// Deepest nesting of formats.
const DEPTH: usize = 8;
/// Largest size of a message in bytes: its length has two bytes.
const SIZE: usize = 65_535;

/// A number of a basic type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basic {
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
    Bool,
    Char,
}

impl Basic {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "int8_t" => Self::I8,
            "uint8_t" => Self::U8,
            "int16_t" => Self::I16,
            "uint16_t" => Self::U16,
            "int32_t" => Self::I32,
            "uint32_t" => Self::U32,
            "int64_t" => Self::I64,
            "uint64_t" => Self::U64,
            "float" => Self::F32,
            "double" => Self::F64,
            "bool" => Self::Bool,
            "char" => Self::Char,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 | Self::Bool | Self::Char => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at the beginning of some bytes; NaN beyond their end. Integers beyond 2^53 are
    /// rounded.
    pub fn read(self, bytes: &[u8]) -> f64 {
        fn first<const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
            bytes.first_chunk().copied()
        }
        let value = match self {
            Self::I8 => first(bytes).map(|b| f64::from(i8::from_le_bytes(b))),
            Self::U8 | Self::Bool | Self::Char => first::<1>(bytes).map(|[b]| f64::from(b)),
            Self::I16 => first(bytes).map(|b| f64::from(i16::from_le_bytes(b))),
            Self::U16 => first(bytes).map(|b| f64::from(u16::from_le_bytes(b))),
            Self::I32 => first(bytes).map(|b| f64::from(i32::from_le_bytes(b))),
            Self::U32 => first(bytes).map(|b| f64::from(u32::from_le_bytes(b))),
            Self::I64 => first(bytes).map(|b| i64::from_le_bytes(b) as f64),
            Self::U64 => first(bytes).map(|b| u64::from_le_bytes(b) as f64),
            Self::F32 => first(bytes).map(|b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => first(bytes).map(f64::from_le_bytes),
        };
        value.unwrap_or(f64::NAN)
    }
}

/// A number of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    pub name: String,
    /// Offset in the message.
    pub at: usize,
    pub basic: Basic,
}

/// A field as its format writes it.
#[derive(Clone, Debug)]
struct Declared {
    name: String,
    kind: String,
    /// Number of elements; `None` for a single value.
    count: Option<usize>,
}

/// Sizes of a message in bytes: without the padding at its end, which writers may omit, and with
/// it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    pub least: usize,
    pub most: usize,
}

/// The formats of a log.
#[derive(Debug, Default)]
pub struct Formats(HashMap<String, Vec<Declared>>);

impl Formats {
    /// Takes a format, `name:type field;type[3] field;`; `false` if it is none.
    pub fn define(&mut self, text: &str) -> bool {
        let Some((name, fields)) = text.split_once(':') else { return false };
        let declared: Option<Vec<Declared>> =
            fields.split(';').filter(|f| !f.trim().is_empty()).map(declare).collect();
        match declared {
            Some(declared) if self.0.len() < FORMATS || self.0.contains_key(name) => {
                self.0.insert(name.to_owned(), declared);
                true
            }
            _ => false,
        }
    }

    /// The sizes of a message of this format; `None` for an unknown format or one that is too
    /// large.
    pub fn sizes(&self, name: &str) -> Option<Sizes> {
        let fields = self.0.get(name)?;
        let most = self.size(name, 0)?;
        let padding = fields.last().filter(|f| f.name.starts_with("_padding"));
        let omitted = padding.map_or(Some(0), |f| self.extent(f, 0))?;
        Some(Sizes { least: most - omitted, most })
    }

    fn size(&self, name: &str, depth: usize) -> Option<usize> {
        if depth > DEPTH {
            return None;
        }
        let mut total = 0_usize;
        for field in self.0.get(name)? {
            total = total.checked_add(self.extent(field, depth)?).filter(|t| *t <= SIZE)?;
        }
        Some(total)
    }

    fn extent(&self, field: &Declared, depth: usize) -> Option<usize> {
        let one = match Basic::parse(&field.kind) {
            Some(basic) => basic.size(),
            None => self.size(&field.kind, depth + 1)?,
        };
        one.checked_mul(field.count.unwrap_or(1)).filter(|size| *size <= SIZE)
    }

    /// The numbers of a message of this format, without padding and texts; `None` if they are more
    /// than `most`.
    pub fn fields(&self, name: &str, most: usize) -> Option<Vec<Field>> {
        let mut fields = Vec::new();
        self.flatten(name, "", &mut 0, &mut fields, most)?;
        Some(fields)
    }

    fn flatten(
        &self,
        name: &str,
        prefix: &str,
        at: &mut usize,
        out: &mut Vec<Field>,
        most: usize,
    ) -> Option<()> {
        for field in self.0.get(name)? {
            let basic = Basic::parse(&field.kind);
            let text = basic == Some(Basic::Char) && field.count.is_some();
            if text || field.name.starts_with("_padding") {
                *at += self.extent(field, 0)?;
                continue;
            }
            for k in 0..field.count.unwrap_or(1) {
                let mut path = format!("{prefix}{}", field.name);
                if field.count.is_some() {
                    path.push_str(&format!("[{k}]"));
                }
                match basic {
                    Some(basic) => {
                        if out.len() >= most {
                            return None;
                        }
                        out.push(Field { name: path, at: *at, basic });
                        *at += basic.size();
                    }
                    None => self.flatten(&field.kind, &format!("{path}."), at, out, most)?,
                }
            }
        }
        Some(())
    }
}

/// A field of a format: `type name` or `type[count] name`.
fn declare(text: &str) -> Option<Declared> {
    let (kind, name) = text.trim().split_once(' ')?;
    let (kind, count) = match kind.split_once('[') {
        Some((kind, count)) => (kind, Some(count.strip_suffix(']')?.parse().ok()?)),
        None => (kind, None),
    };
    (!name.is_empty() && count.is_none_or(|n| n <= SIZE)).then(|| Declared {
        name: name.to_owned(),
        kind: kind.to_owned(),
        count,
    })
}
