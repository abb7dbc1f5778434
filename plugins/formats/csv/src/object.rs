//! The values of an object of JSON with their paths. Strings may have the quotation marks of Python.

use crate::paths::{DEEPEST, join};
use std::fmt::Write;

/// A container of JSON: the length of its path, the next index of an array, and whether an object has
/// a key that waits for its value.
struct Level {
    base: usize,
    index: Option<usize>,
    keyed: bool,
}

/// Calls `found` with the path and the text of each value of an object.
pub fn object(text: &str, mut found: impl FnMut(&str, &str)) {
    let (mut path, mut levels, mut rest) = (String::new(), Vec::<Level>::new(), text);
    // all marks are bytes of ASCII, which no other character contains
    while let Some(first) = rest.as_bytes().first().copied() {
        match first {
            b'}' | b']' => {
                levels.pop();
                if let Some(level) = levels.last_mut() {
                    level.keyed = false;
                }
                rest = &rest[1..];
                continue;
            }
            b',' | b':' | b' ' | b'\n' | b'\r' | b'\t' => {
                rest = &rest[1..];
                continue;
            }
            _ => {}
        }
        let quoted = matches!(first, b'"' | b'\'');
        if let Some(level) = levels.last_mut().filter(|l| l.index.is_some() || l.keyed) {
            level.keyed = false;
            if let Some(index) = &mut level.index {
                path.truncate(level.base);
                join(&mut path, "");
                // writing into a text cannot fail
                let _ = write!(path, "{index}");
                *index += 1;
            }
        } else if let Some(level) = levels.last_mut().filter(|_| quoted) {
            let (key, after) = string(rest);
            path.truncate(level.base);
            join(&mut path, key);
            level.keyed = true;
            rest = after;
            continue;
        }
        match first {
            b'{' | b'[' if levels.len() < DEEPEST => {
                let index = (first == b'[').then_some(0);
                levels.push(Level { base: path.len(), index, keyed: false });
                rest = &rest[1..];
            }
            _ if quoted => {
                let (value, after) = string(rest);
                found(&path, value);
                rest = after;
            }
            _ => {
                let ends = |b: &u8| matches!(b, b',' | b'}' | b']') || b.is_ascii_whitespace();
                let at = rest.bytes().skip(1).position(|b| ends(&b)).map_or(rest.len(), |k| k + 1);
                found(&path, if &rest[..at] == "null" { "" } else { &rest[..at] });
                rest = &rest[at..];
            }
        }
    }
}

/// The text of a string at the beginning, with its escapes, and what follows.
fn string(text: &str) -> (&str, &str) {
    let (quote, inner) = (text.as_bytes().first().copied(), &text[1..]);
    let mut from = 0;
    while let Some(at) = inner[from..].bytes().position(|b| Some(b) == quote || b == b'\\') {
        if inner.as_bytes()[from + at] != b'\\' {
            return (&inner[..from + at], &inner[from + at + 1..]);
        }
        // what is escaped may have several bytes
        let escaped = inner[from + at + 1..].chars().next().map_or(0, char::len_utf8);
        from += at + 1 + escaped;
    }
    (inner, "")
}
