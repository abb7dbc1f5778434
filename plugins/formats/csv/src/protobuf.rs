//! Messages of protobuf as text, which `gz topic -e` prints one after another with an empty line between them:
//! `angular_velocity {`, `x: 0.1`, `}`.

use crate::paths::{DEEPEST, PIECE, bounded, join};
use std::io::{BufRead, Read, Result};

/// Number of lines by which the form is found.
const LINES: usize = 200;

/// A line of a message.
enum Line<'a> {
    Begin(&'a str),
    Value(&'a str, &'a str),
    End,
}

impl<'a> Line<'a> {
    fn of(line: &'a str) -> Option<Self> {
        let line = line.trim();
        let is_name = |name: &&str| {
            let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
            name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(part)
        };
        let value = || {
            let (name, value) = line.split_once(": ")?;
            Some((name, value.trim().trim_matches('"'))).filter(|(name, _)| is_name(name))
        };
        match line.strip_suffix(" {").filter(is_name) {
            Some(name) => Some(Self::Begin(name)),
            None if line == "}" => Some(Self::End),
            None => value().map(|(name, value)| Self::Value(name, value)),
        }
    }
}

/// Tests whether a text begins with such messages: every line is one of theirs, and some begin a message within another.
pub fn begins(text: &str) -> bool {
    let filled = text.lines().filter(|line| !line.trim().is_empty());
    // the last line may be cut off
    let lines: Vec<&str> = filled.take(LINES).collect();
    let whole = lines.split_last().map_or(&[][..], |(_, whole)| whole);
    let nested = whole.iter().any(|line| matches!(Line::of(line), Some(Line::Begin(_))));
    nested && whole.iter().all(|line| Line::of(line).is_some())
}

/// Reads the next message; `false` at the end.
pub fn next(file: &mut impl BufRead, record: &mut Vec<u8>) -> Result<bool> {
    record.clear();
    loop {
        let before = record.len();
        let length = file.by_ref().take(PIECE).read_until(b'\n', record)?;
        if record[before..].trim_ascii().is_empty() {
            record.truncate(before);
            if length == 0 || before > 0 {
                return Ok(before > 0);
            }
        }
        bounded(record.len())?;
    }
}

/// Calls `found` with the path and the text of each value of a message.
pub fn values(record: &str, mut found: impl FnMut(&str, &str)) {
    let (mut path, mut bases) = (String::new(), Vec::new());
    for line in record.lines().filter_map(Line::of) {
        let base = path.len();
        match line {
            Line::Begin(name) if bases.len() < DEEPEST => {
                bases.push(base);
                join(&mut path, name);
            }
            Line::Begin(_) => {}
            Line::End => path.truncate(bases.pop().unwrap_or_default()),
            Line::Value(name, value) => {
                join(&mut path, name);
                found(&path, value);
                path.truncate(base);
            }
        }
    }
}
