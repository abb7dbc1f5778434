//! Definitions of message types, as bags carry them in `ros2msg` form.

use crate::error::DefinitionError;
use navfuse_frames::Number;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// The definitions of the types that are known without the help of a bag.
const BUILT_IN: &str = include_str!("builtin.msg");
/// The line between two definitions begins with this.
const SEPARATOR: &str = "====";
/// The line with the name of the next definition.
const NAME: &str = "MSG: ";

/// The type of one element of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    Number(Number),
    Text,
    WideText,
    /// Another message, by its name `package/Type`.
    Message(String),
}

/// Number of elements of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    One,
    Array(u32),
    Sequence,
}

/// A field of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    pub name: String,
    pub kind: Kind,
    pub shape: Shape,
}

/// Definitions by their names `package/Type`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Definitions(BTreeMap<String, Vec<Field>>);

/// The name without the `msg` in the middle: `sensor_msgs/Imu`.
pub fn short_name(name: &str) -> String {
    let mut parts = name.split('/');
    match (parts.next(), parts.next_back()) {
        (Some(package), Some(name)) => format!("{package}/{name}"),
        _ => name.to_owned(),
    }
}

impl Definitions {
    /// The definitions that are known without the help of a bag.
    pub fn built_in() -> &'static Self {
        static BUILT: OnceLock<Definitions> = OnceLock::new();
        // a test holds that the text is well-formed
        BUILT.get_or_init(|| Self::parse("", BUILT_IN).unwrap_or_default())
    }

    /// Parses the definition of a type, followed by those that it refers to.
    ///
    /// # Errors
    /// When a line is no field.
    pub fn parse(name: &str, text: &str) -> Result<Self, DefinitionError> {
        let mut types = BTreeMap::new();
        let (mut of, mut fields) = (short_name(name), Vec::new());
        for line in text.lines() {
            let line = line.trim();
            if line.starts_with(SEPARATOR) {
                continue;
            }
            if let Some(next) = line.strip_prefix(NAME) {
                types.insert(std::mem::replace(&mut of, short_name(next.trim())), fields);
                fields = Vec::new();
            } else if let Some(field) = field(&of, line)? {
                fields.push(field);
            }
        }
        types.insert(of, fields);
        types.remove("");
        Ok(Self(types))
    }

    /// The fields of a type: those of these definitions, otherwise the built-in ones.
    ///
    /// # Errors
    /// When there is no definition.
    pub fn fields(&self, name: &str) -> Result<&[Field], DefinitionError> {
        let found = self.0.get(name).or_else(|| Self::built_in().0.get(name));
        found.map(Vec::as_slice).ok_or_else(|| DefinitionError::Missing(name.to_owned()))
    }
}

/// The field in a line; `None` for an empty line and a constant.
fn field(of: &str, line: &str) -> Result<Option<Field>, DefinitionError> {
    let wrong =
        || DefinitionError::Line { of: of.to_owned(), line: line.chars().take(80).collect() };
    let code = line.split('#').next().unwrap_or_default().trim();
    let Some((kind, rest)) = code.split_once(char::is_whitespace) else {
        return if code.is_empty() { Ok(None) } else { Err(wrong()) };
    };
    let rest = rest.trim_start();
    let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    if after.trim_start().starts_with('=') {
        return Ok(None);
    }
    let (element, shape) = match kind.split_once('[') {
        None => (kind, Shape::One),
        Some((element, size)) => match size.strip_suffix(']').ok_or_else(wrong)? {
            "" => (element, Shape::Sequence),
            bounded if bounded.starts_with("<=") => (element, Shape::Sequence),
            fixed => (element, Shape::Array(fixed.parse().map_err(|_| wrong())?)),
        },
    };
    let element = element.split("<=").next().unwrap_or_default();
    if name.is_empty() || element.is_empty() {
        return Err(wrong());
    }
    let kind = match element {
        "bool" => Kind::Number(Number::Bool),
        "int8" => Kind::Number(Number::I8),
        "uint8" | "byte" | "char" => Kind::Number(Number::U8),
        "int16" => Kind::Number(Number::I16),
        "uint16" => Kind::Number(Number::U16),
        "int32" => Kind::Number(Number::I32),
        "uint32" => Kind::Number(Number::U32),
        "int64" => Kind::Number(Number::I64),
        "uint64" => Kind::Number(Number::U64),
        "float32" => Kind::Number(Number::F32),
        "float64" => Kind::Number(Number::F64),
        "string" => Kind::Text,
        "wstring" => Kind::WideText,
        "time" => Kind::Message("builtin_interfaces/Time".to_owned()),
        "duration" => Kind::Message("builtin_interfaces/Duration".to_owned()),
        "Header" => Kind::Message("std_msgs/Header".to_owned()),
        other if other.contains('/') => Kind::Message(short_name(other)),
        other => {
            let package = of.split('/').next().unwrap_or_default();
            Kind::Message(format!("{package}/{other}"))
        }
    };
    Ok(Some(Field { name: name.to_owned(), kind, shape }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn fields_constants_bounds_defaults_and_comments_are_told_apart() {
        let text = "# a comment\nuint8 MODE=1 # one\nstring NAME = \"a # b\"\nHeader header\n\
                    float64[9] covariance\nint32[<=5] few\nstring<=10[<=3] names\nNear[] near # x\n\
                    bool on true\nother_msgs/msg/Far far\n=====\nMSG: pack/Near\nbyte one\n";
        let parsed = Definitions::parse("pack/msg/Main", text).unwrap();
        let fields: Vec<(String, Kind, Shape)> = parsed
            .fields("pack/Main")
            .unwrap()
            .iter()
            .map(|f| (f.name.clone(), f.kind.clone(), f.shape))
            .collect();
        let message = |name: &str| Kind::Message(name.to_owned());
        let expected = [
            ("header", message("std_msgs/Header"), Shape::One),
            ("covariance", Kind::Number(Number::F64), Shape::Array(9)),
            ("few", Kind::Number(Number::I32), Shape::Sequence),
            ("names", Kind::Text, Shape::Sequence),
            ("near", message("pack/Near"), Shape::Sequence),
            ("on", Kind::Number(Number::Bool), Shape::One),
            ("far", message("other_msgs/Far"), Shape::One),
        ];
        assert_eq!(fields, expected.map(|(name, kind, shape)| (name.to_owned(), kind, shape)));
        assert_eq!(parsed.fields("pack/Near").unwrap().len(), 1);
        assert!(Definitions::parse("a/B", "float64").is_err());
        assert!(Definitions::parse("a/B", "float64[x] name").is_err());
    }

    #[test]
    fn every_type_that_a_built_in_definition_uses_is_built_in() {
        let built_in = Definitions::parse("", BUILT_IN).unwrap();
        assert!(built_in.0.len() > 20);
        for field in built_in.0.values().flatten() {
            if let Kind::Message(name) = &field.kind {
                assert!(built_in.0.contains_key(name), "{name}");
            }
        }
    }
}
