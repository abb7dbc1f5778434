//! The types of LCM: definitions in `.lcm` files, and the fingerprints by which messages name them.
//!
//! The fingerprint of a struct hashes the names, primitive types and dimensions of its members, adds the
//! fingerprints of the structs among them, and rotates the sum by one bit (LCM type specification).

use navfuse_frames::Number;
use std::sync::Arc;

/// Largest depth of structs in structs.
const DEPTH: usize = 16;
/// Largest number of elements of an array that are fields, and of fields of a message.
const ELEMENTS: usize = 64;
const FIELDS: usize = 2000;

/// The type of a member.
#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Number(Number),
    Text,
    /// Another struct, by its name with its package.
    Struct(String),
}

/// A dimension of an array: a number, or the name of the member that has it.
#[derive(Clone, Debug, PartialEq)]
struct Dimension {
    text: String,
    size: Option<usize>,
}

#[derive(Clone, Debug, PartialEq)]
struct Member {
    name: String,
    kind: Kind,
    /// The name of the type as it is hashed: of a primitive one.
    primitive: String,
    dimensions: Vec<Dimension>,
}

#[derive(Clone, Debug, PartialEq)]
struct Struct {
    name: String,
    members: Vec<Member>,
}

/// The types that `.lcm` files define.
#[derive(Clone, Debug, Default)]
pub struct LcmTypes(Arc<Vec<Struct>>);

fn primitive(name: &str) -> Option<Kind> {
    Some(Kind::Number(match name {
        "int8_t" => Number::I8,
        "int16_t" => Number::I16,
        "int32_t" => Number::I32,
        "int64_t" => Number::I64,
        "byte" | "boolean" => Number::U8,
        "float" => Number::F32,
        "double" => Number::F64,
        "string" => return Some(Kind::Text),
        _ => return None,
    }))
}

/// The words and signs of a text without its comments.
fn tokens(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let (mut rest, mut inside) = (text, false);
    while let Some(c) = rest.chars().next() {
        let skipped =
            [("//", "\n"), ("/*", "*/")].into_iter().find(|(open, _)| rest.starts_with(open));
        if let Some((_, close)) = skipped {
            rest = rest.find(close).map_or("", |at| &rest[at + close.len()..]);
            inside = false;
            continue;
        }
        let word = c.is_alphanumeric() || "_.+-".contains(c);
        match words.last_mut().filter(|_| word && inside) {
            Some(last) => last.push(c),
            None if c.is_whitespace() => {}
            None => words.push(c.to_string()),
        }
        inside = word;
        rest = &rest[c.len_utf8()..];
    }
    words
}

/// Reads the definitions of one file.
struct Parser {
    tokens: std::vec::IntoIter<String>,
    package: String,
}

impl Parser {
    fn next(&mut self, what: &str) -> Result<String, String> {
        self.tokens.next().ok_or_else(|| format!("the definitions end where {what} is expected"))
    }

    /// Passes on to the end of a statement.
    fn pass(&mut self) {
        self.tokens.by_ref().find(|token| token == ";");
    }

    fn all(mut self) -> Result<Vec<Struct>, String> {
        let mut structs = Vec::new();
        while let Some(token) = self.tokens.next() {
            match token.as_str() {
                "package" => {
                    self.package = self.next("the name of a package")?;
                    self.pass();
                }
                "struct" => structs.push(self.one()?),
                ";" => {}
                other => return Err(format!("{other:?} where `package` or `struct` is expected")),
            }
        }
        Ok(structs)
    }

    fn one(&mut self) -> Result<Struct, String> {
        let name = self.next("the name of a struct")?;
        let name = if self.package.is_empty() { name } else { format!("{}.{name}", self.package) };
        let open = self.next("{")?;
        if open != "{" {
            return Err(format!("struct {name}: {open:?} where {{ is expected"));
        }
        let mut members = Vec::new();
        loop {
            match self.next("a member")?.as_str() {
                "}" => return Ok(Struct { name, members }),
                ";" => {}
                "const" => self.pass(),
                kind => {
                    self.members(kind, &mut members).map_err(|e| format!("struct {name}: {e}"))?
                }
            }
        }
    }

    /// The members of one type, which commas separate.
    fn members(&mut self, kind: &str, members: &mut Vec<Member>) -> Result<(), String> {
        let known = primitive(kind);
        let named = known.is_some();
        let qualified = match kind.contains('.') || self.package.is_empty() {
            true => kind.to_owned(),
            false => format!("{}.{kind}", self.package),
        };
        let kind_of = known.unwrap_or(Kind::Struct(qualified));
        let primitive = if named { kind.to_owned() } else { String::new() };
        loop {
            let name = self.next("the name of a member")?;
            let mut dimensions = Vec::new();
            let mut end = self.next("; after a member")?;
            while end == "[" {
                let text = self.next("the size of an array")?;
                let size = text.parse().ok();
                let close = self.next("]")?;
                if close != "]" {
                    return Err(format!("{close:?} where ] is expected after {name}[{text}"));
                }
                dimensions.push(Dimension { text, size });
                end = self.next("; after a member")?;
            }
            members.push(Member {
                name,
                kind: kind_of.clone(),
                primitive: primitive.clone(),
                dimensions,
            });
            match end.as_str() {
                "," => {}
                ";" => return Ok(()),
                other => return Err(format!("{other:?} where ; is expected")),
            }
        }
    }
}

fn hash(value: i64, byte: i8) -> i64 {
    (value.wrapping_shl(8) ^ (value >> 55)).wrapping_add(i64::from(byte))
}

fn hash_text(value: i64, text: &str) -> i64 {
    text.bytes().fold(hash(value, text.len() as i8), |value, byte| hash(value, byte as i8))
}

impl Struct {
    /// The hash of the members, without the structs among them.
    fn own(&self) -> i64 {
        self.members.iter().fold(0x1234_5678, |value, member| {
            let mut value = hash_text(value, &member.name);
            if !member.primitive.is_empty() {
                value = hash_text(value, &member.primitive);
            }
            value = hash(value, member.dimensions.len() as i8);
            member.dimensions.iter().fold(value, |value, dimension| {
                hash_text(hash(value, i8::from(dimension.size.is_none())), &dimension.text)
            })
        })
    }
}

/// What a walk through a message collects.
pub struct Walk<'a> {
    /// Names of the fields, where they are wanted.
    pub names: Option<Vec<String>>,
    pub values: &'a mut Vec<f64>,
}

impl LcmTypes {
    /// The types of some files.
    ///
    /// # Errors
    /// With the place where a text is no definition of LCM.
    pub fn parse(texts: &[String]) -> Result<Self, String> {
        let mut structs = Vec::new();
        for text in texts {
            let (tokens, package) = (tokens(text).into_iter(), String::new());
            structs.extend(Parser { tokens, package }.all()?);
        }
        Ok(Self(Arc::new(structs)))
    }

    /// Returns `true` if nothing is defined.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn find(&self, name: &str) -> Option<&Struct> {
        self.0.iter().find(|known| known.name == name)
    }

    /// The fingerprint of a struct inside others; zero for one inside itself, or that nobody defines.
    fn fingerprint(&self, one: &Struct, parents: &[&str]) -> u64 {
        if parents.contains(&one.name.as_str()) || parents.len() >= DEPTH {
            return 0;
        }
        let parents = [parents, &[one.name.as_str()]].concat();
        let inner = one.members.iter().filter_map(|member| match &member.kind {
            Kind::Struct(name) => self.find(name).map(|inner| self.fingerprint(inner, &parents)),
            _ => None,
        });
        inner.fold(one.own() as u64, u64::wrapping_add).rotate_left(1)
    }

    /// The fingerprints of all types, with their names.
    pub fn fingerprints(&self) -> Vec<(u64, String)> {
        self.0.iter().map(|one| (self.fingerprint(one, &[]), one.name.clone())).collect()
    }

    /// Reads a message of a type after its fingerprint; `false` where it does not fit.
    pub fn read(&self, name: &str, mut bytes: &[u8], walk: &mut Walk<'_>) -> bool {
        let Some(one) = self.find(name) else { return false };
        self.walk(one, &mut bytes, "", walk, 0).is_some() && bytes.is_empty()
    }

    fn walk(
        &self,
        one: &Struct,
        bytes: &mut &[u8],
        prefix: &str,
        walk: &mut Walk<'_>,
        depth: usize,
    ) -> Option<()> {
        if depth >= DEPTH {
            return None;
        }
        // members that are whole numbers, which may be sizes
        let mut sizes: Vec<(&str, f64)> = Vec::new();
        for member in &one.members {
            let mut lengths = Vec::with_capacity(member.dimensions.len());
            for dimension in &member.dimensions {
                let size = || sizes.iter().find(|(name, _)| *name == dimension.text).map(|s| s.1);
                lengths.push(
                    dimension.size.or_else(|| size().filter(|s| *s >= 0.0).map(|s| s as usize))?,
                );
            }
            let count = lengths.iter().try_fold(1_usize, |n, length| n.checked_mul(*length))?;
            // an element has at least one byte, or nothing at all
            if count > bytes.len().max(1) && count > 0 {
                return None;
            }
            let fixed = member.dimensions.iter().all(|d| d.size.is_some());
            let kept = fixed && count <= ELEMENTS && depth < DEPTH;
            for k in 0..count {
                let name = || format!("{prefix}{}{}", member.name, index(k, &lengths));
                match &member.kind {
                    Kind::Number(kind) => {
                        let value = kind.read::<false>(bytes.get(..kind.size())?);
                        *bytes = &bytes[kind.size()..];
                        if member.dimensions.is_empty() && value.fract() == 0.0 {
                            sizes.push((&member.name, value));
                        }
                        if kept && walk.values.len() < FIELDS {
                            walk.values.push(value);
                            walk.names.iter_mut().for_each(|names| names.push(name()));
                        }
                    }
                    Kind::Text => {
                        let length = Number::I32.read::<false>(bytes.get(..4)?);
                        let end = 4 + usize::try_from(length as i64).ok()?;
                        *bytes = bytes.get(end..)?;
                    }
                    Kind::Struct(inner) => {
                        let inner = self.find(inner)?;
                        if kept {
                            let prefix =
                                if walk.names.is_some() { name() + "." } else { String::new() };
                            self.walk(inner, bytes, &prefix, walk, depth + 1)?;
                        } else {
                            let mut unused = Vec::new();
                            let mut other = Walk { names: None, values: &mut unused };
                            self.walk(inner, bytes, "", &mut other, depth + 1)?;
                        }
                    }
                }
            }
        }
        Some(())
    }
}

/// The indices of an element of an array, the last one fastest.
fn index(mut k: usize, lengths: &[usize]) -> String {
    let mut text = String::new();
    for length in lengths.iter().rev() {
        text = format!("[{}]{text}", k % length.max(&1));
        k /= length.max(&1);
    }
    text
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    const EXAMPLE: &str = "package exlcm; // the example of LCM's tutorial\n\
        struct example_t { int64_t timestamp; double position[3]; double orientation[4];\n\
        int32_t num_ranges; int16_t ranges[num_ranges]; string name; boolean enabled; }";

    #[test]
    fn the_fingerprint_of_the_tutorial_is_the_one_of_lcm_gen() {
        let types = LcmTypes::parse(&[EXAMPLE.to_owned()]).unwrap();
        // `lcm-gen --python` writes this number for the example
        assert_eq!(types.fingerprints(), [(0x3755_3c53_61f7_5516, "exlcm.example_t".to_owned())]);
    }

    #[test]
    fn arrays_of_any_size_are_passed_and_those_of_a_fixed_one_are_fields() {
        let types = LcmTypes::parse(&[EXAMPLE.to_owned()]).unwrap();
        let mut bytes = 5_i64.to_be_bytes().to_vec();
        bytes
            .extend([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0].iter().flat_map(|v: &f64| v.to_be_bytes()));
        bytes.extend(2_i32.to_be_bytes());
        bytes.extend([7_i16, 8].iter().flat_map(|v| v.to_be_bytes()));
        bytes.extend(3_i32.to_be_bytes());
        bytes.extend(b"ab\0\x01");
        let mut values = Vec::new();
        let mut walk = Walk { names: Some(Vec::new()), values: &mut values };
        assert!(types.read("exlcm.example_t", &bytes, &mut walk));
        let names = walk.names.unwrap();
        assert_eq!((names[1].as_str(), names[8].as_str()), ("position[0]", "num_ranges"));
        assert_eq!(values, [5.0, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 2.0, 1.0]);
        // one byte too few, one too many, a size below zero
        let read = |bytes: &[u8]| {
            types.read("exlcm.example_t", bytes, &mut Walk { names: None, values: &mut Vec::new() })
        };
        assert!(!read(&bytes[..bytes.len() - 1]) && !read(&[&bytes[..], &[0]].concat()));
        bytes[64..68].copy_from_slice(&(-1_i32).to_be_bytes());
        assert!(!read(&bytes));
    }

    #[test]
    fn what_is_no_definition_is_refused_with_its_word() {
        for (text, word) in [
            ("hello", "hello"),
            ("struct a { int8_t b }", "}"),
            ("struct a { int8_t b[3; }", ";"),
            ("struct a", "{"),
        ] {
            let error = LcmTypes::parse(&[text.to_owned()]).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}
