//! The formats that a log defines for itself, and the places of their fields.

use navfuse_frames::Number;
use std::collections::HashMap;

/// Largest number of formats; PX4 has about 250.
const FORMATS: usize = 4096;
/// Largest number of fields of all formats.
const DECLARED: usize = 1 << 18;
/// Largest size of a field's name in bytes.
const NAME: usize = 128;
/// Deepest nesting of formats.
const DEPTH: usize = 8;
/// Largest size of a message in bytes: its length has two bytes.
const SIZE: usize = 65_535;

/// The type that ULog calls `name`. A `char` is the number of its byte.
fn number(name: &str) -> Option<Number> {
    Some(match name {
        "int8_t" => Number::I8,
        "uint8_t" | "char" => Number::U8,
        "int16_t" => Number::I16,
        "uint16_t" => Number::U16,
        "int32_t" => Number::I32,
        "uint32_t" => Number::U32,
        "int64_t" => Number::I64,
        "uint64_t" => Number::U64,
        "float" => Number::F32,
        "double" => Number::F64,
        "bool" => Number::Bool,
        _ => return None,
    })
}

/// A number of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    pub name: String,
    /// Offset in the message.
    pub at: usize,
    pub number: Number,
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
pub struct Formats {
    formats: HashMap<String, Vec<Declared>>,
    /// Number of fields of all formats.
    declared: usize,
}

impl Formats {
    /// Takes a format, `name:type field;type[3] field;`; `false` if it is none.
    pub fn define(&mut self, text: &str) -> bool {
        let Some((name, fields)) = text.split_once(':') else { return false };
        let declared: Option<Vec<Declared>> =
            fields.split(';').filter(|f| !f.trim().is_empty()).map(declare).collect();
        let room = self.formats.len() < FORMATS || self.formats.contains_key(name);
        match declared.filter(|d| room && self.declared + d.len() <= DECLARED) {
            Some(declared) => {
                self.declared += declared.len();
                self.formats.insert(name.to_owned(), declared);
                true
            }
            None => false,
        }
    }

    /// The sizes of a message of this format; `None` for an unknown format or one that is too
    /// large.
    pub fn sizes(&self, name: &str) -> Option<Sizes> {
        let fields = self.formats.get(name)?;
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
        for field in self.formats.get(name)? {
            total = total.checked_add(self.extent(field, depth)?).filter(|t| *t <= SIZE)?;
        }
        // each field has a byte or more, so that the limit of the size bounds the time, too
        (total > 0).then_some(total)
    }

    fn extent(&self, field: &Declared, depth: usize) -> Option<usize> {
        let one = match number(&field.kind) {
            Some(number) => number.size(),
            None => self.size(&field.kind, depth + 1)?,
        };
        one.checked_mul(field.count.unwrap_or(1)).filter(|size| *size <= SIZE)
    }

    /// The numbers of a message of this format, without padding and texts. Their memory is taken
    /// from `room`, in bytes; `None` if they need more.
    pub fn fields(&self, name: &str, room: &mut usize) -> Option<Vec<Field>> {
        let mut fields = Vec::new();
        self.flatten(name, "", &mut 0, &mut fields, room)?;
        Some(fields)
    }

    fn flatten(
        &self,
        name: &str,
        prefix: &str,
        at: &mut usize,
        out: &mut Vec<Field>,
        room: &mut usize,
    ) -> Option<()> {
        for field in self.formats.get(name)? {
            let basic = number(&field.kind);
            let text = field.kind == "char" && field.count.is_some();
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
                    Some(number) => {
                        *room = room.checked_sub(size_of::<Field>() + path.len())?;
                        out.push(Field { name: path, at: *at, number });
                        *at += number.size();
                    }
                    None => self.flatten(&field.kind, &format!("{path}."), at, out, room)?,
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
    let fits = count.is_none_or(|n| (1..=SIZE).contains(&n));
    (fits && (1..=NAME).contains(&name.len())).then(|| Declared {
        name: name.to_owned(),
        kind: kind.to_owned(),
        count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formats(definitions: &[&str]) -> Formats {
        let mut formats = Formats::default();
        definitions.iter().for_each(|text| assert!(formats.define(text), "{text}"));
        formats
    }

    #[test]
    fn formats_within_formats_are_numbers_with_their_offsets() {
        let formats = formats(&["pair:float x;int16_t y;", "two:pair[2] p;char[3] text;bool on;"]);
        let fields = formats.fields("two", &mut 4096).unwrap_or_default();
        let found: Vec<_> = fields.iter().map(|f| (f.name.as_str(), f.at)).collect();
        let wanted = [("p[0].x", 0), ("p[0].y", 4), ("p[1].x", 6), ("p[1].y", 10), ("on", 15)];
        assert_eq!(found, wanted);
        assert_eq!(formats.sizes("two"), Some(Sizes { least: 16, most: 16 }));
    }

    /// Both would take hours if each field were visited.
    #[test]
    fn formats_without_bytes_are_rejected_whatever_their_counts() {
        let arrays = formats(&["a:b[65535] x;", "b:c[65535] x;", "c:d[65535] x;", "d:"]);
        assert_eq!(arrays.sizes("a"), None);
        let many = |name: &str, kind: &str| {
            let fields: String = (0..4000).map(|k| format!("{kind} f{k};")).collect();
            format!("{name}:{fields}")
        };
        let texts = [many("a", "b"), many("b", "c"), many("c", "d"), many("d", "e")];
        let mut formats = formats(&["e:"]);
        texts.iter().for_each(|text| assert!(formats.define(text)));
        assert_eq!(formats.sizes("a"), None);
        assert!(!formats.define("zero:float[0] x;"), "an array without elements");
    }

    #[test]
    fn names_take_no_more_memory_than_there_is_room_for() {
        let name = "n".repeat(NAME);
        let formats = formats(&[&format!("a:uint8_t[65535] {name};")]);
        let mut room = 1 << 20;
        assert!(formats.fields("a", &mut room).is_none() && room < 1 << 20);
        assert!(!Formats::default().define(&format!("a:float {name}n;")), "a longer name");
    }
}
