//! Reads a log by its own message definitions, and so checks its messages against them.

#![allow(dead_code, reason = "each test file uses a part")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

pub mod fixture;

use re_cdr::{CdrReader, LittleEndian};
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::path::Path;

/// A message of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Logged {
    pub topic: String,
    pub schema: String,
    pub log_time: u64,
    pub publish_time: u64,
    /// Fields in order. A float is the text `f:` and its bits, so that every value is exact.
    pub fields: Value,
}

/// All messages of a log in their order.
pub fn read(path: &Path) -> Vec<Logged> {
    let bytes = std::fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap();
    messages
        .map(|m| {
            let m = m.unwrap();
            let schema = m.channel.schema.as_ref().unwrap();
            assert_eq!(
                (schema.encoding.as_str(), m.channel.message_encoding.as_str()),
                ("ros2msg", "cdr")
            );
            let text = std::str::from_utf8(&schema.data).unwrap();
            Logged {
                topic: m.channel.topic.clone(),
                schema: schema.name.clone(),
                log_time: m.log_time,
                publish_time: m.publish_time,
                fields: decode(text, &m.data),
            }
        })
        .collect()
}

/// A number with a point as it stands in [`Logged::fields`].
pub fn float(x: f64) -> Value {
    Value::String(format!("f:{:016x}", x.to_bits()))
}

/// Numbers with a point.
pub fn floats(x: &[f64]) -> Value {
    x.iter().map(|x| float(*x)).collect()
}

/// The number in a field.
pub fn number(value: &Value) -> f64 {
    let text = value.as_str().unwrap();
    f64::from_bits(u64::from_str_radix(text.strip_prefix("f:").unwrap(), 16).unwrap())
}

/// Decodes one message, all of it.
fn decode(schema: &str, data: &[u8]) -> Value {
    let separator = "=".repeat(80);
    let mut definitions = HashMap::new();
    for (i, part) in schema.split(&format!("{separator}\n")).enumerate() {
        let (name, body) = match part.strip_prefix("MSG: ") {
            Some(rest) => rest.split_once('\n').unwrap(),
            None => ("", part),
        };
        assert_eq!(name.is_empty(), i == 0);
        definitions.insert(name, body);
    }
    assert_eq!(data[..4], [0, 1, 0, 0]);
    let mut reader = CdrReader::<LittleEndian>::new(&data[4..]);
    let value = message("", &definitions, &mut reader);
    assert_eq!(reader.remaining(), 0, "bytes beyond the definition");
    value
}

fn message(
    name: &str,
    definitions: &HashMap<&str, &str>,
    r: &mut CdrReader<'_, LittleEndian>,
) -> Value {
    let mut fields = Map::new();
    for line in definitions[name]
        .lines()
        .map(|l| l.split('#').next().unwrap().trim())
        .filter(|l| !l.is_empty())
    {
        let (kind, field) = line.split_once(' ').unwrap();
        if field.contains('=') {
            continue; // a constant
        }
        let value = match kind.split_once('[') {
            None => one(kind, definitions, r),
            Some((element, "]")) => {
                let n = r.read_sequence_length().unwrap();
                (0..n).map(|_| one(element, definitions, r)).collect()
            }
            Some((element, n)) => {
                let n = n.trim_end_matches(']').parse::<usize>().unwrap();
                (0..n).map(|_| one(element, definitions, r)).collect()
            }
        };
        fields.insert(field.to_owned(), value);
    }
    Value::Object(fields)
}

fn one(
    kind: &str,
    definitions: &HashMap<&str, &str>,
    r: &mut CdrReader<'_, LittleEndian>,
) -> Value {
    match kind {
        "float64" => float(r.read_f64().unwrap()),
        "float32" => float(r.read_f32().unwrap().into()),
        "bool" => r.read_bool().unwrap().into(),
        "int32" => r.read_i32().unwrap().into(),
        "uint32" => r.read_u32().unwrap().into(),
        "uint16" => r.read_u16().unwrap().into(),
        "int8" => r.read_i8().unwrap().into(),
        "uint8" | "byte" => r.read_u8().unwrap().into(),
        "string" => format!("s:{}", r.read_str().unwrap()).into(),
        other => message(other, definitions, r),
    }
}

/// Numbers that look random and are always the same (SplitMix64).
pub struct Draw(pub u64);

impl Draw {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Below `n`.
    pub fn below(&mut self, n: u64) -> usize {
        (self.bits() % n) as usize
    }

    /// Between -1 and 1.
    pub fn number(&mut self) -> f64 {
        self.bits() as f64 / u64::MAX as f64 * 2.0 - 1.0
    }
}
