//! The bytes of an MCAP file: <https://mcap.dev/spec>.

use std::collections::BTreeMap;

/// Appends a record with the fields that a function appends.
pub fn record(out: &mut Vec<u8>, opcode: u8, fields: impl FnOnce(&mut Vec<u8>)) {
    out.push(opcode);
    with_length(out, fields);
}

/// Appends bytes with their length before them, of 8 bytes.
fn with_length(out: &mut Vec<u8>, content: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.extend_from_slice(&[0; 8]);
    content(out);
    let length = (out.len() - start - 8) as u64;
    out[start..start + 8].copy_from_slice(&length.to_le_bytes());
}

/// Appends a number of 2 bytes.
pub fn u16(out: &mut Vec<u8>, number: u16) {
    out.extend_from_slice(&number.to_le_bytes());
}

/// Appends a number of 4 bytes.
pub fn u32(out: &mut Vec<u8>, number: u32) {
    out.extend_from_slice(&number.to_le_bytes());
}

/// Appends numbers of 8 bytes.
pub fn u64s(out: &mut Vec<u8>, numbers: impl IntoIterator<Item = u64>) {
    numbers.into_iter().for_each(|n| out.extend_from_slice(&n.to_le_bytes()));
}

/// Appends bytes with their length before them, of 4 bytes.
pub fn bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    u32(out, bytes.len() as u32);
    out.extend_from_slice(bytes);
}

/// Appends a text.
pub fn text(out: &mut Vec<u8>, text: &str) {
    bytes(out, text.as_bytes());
}

/// Appends texts by their names.
pub fn texts(out: &mut Vec<u8>, map: &BTreeMap<String, String>) {
    let mut content = Vec::new();
    for (key, value) in map {
        text(&mut content, key);
        text(&mut content, value);
    }
    bytes(out, &content);
}

/// Appends a map from channels to numbers.
pub fn by_channel(out: &mut Vec<u8>, map: impl Iterator<Item = (u16, u64)>) {
    let mut content = Vec::new();
    for (channel, number) in map {
        u16(&mut content, channel);
        u64s(&mut content, [number]);
    }
    bytes(out, &content);
}
