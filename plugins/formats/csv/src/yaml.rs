//! YAML as rows that name their values: a list of records, or documents that `---` separates, as
//! `ros2 topic echo` writes them.

use crate::paths::{DEEPEST, PIECE, bounded, join};
use std::io::{BufRead, Read, Result};

/// Number of lines that are looked at, and the share of them that must look like YAML.
const LINES: usize = 200;
const SHARE: f64 = 0.9;

/// Tests whether a line is a key with or without a value, an element of a list, or a separator.
fn is_line(line: &str) -> bool {
    let text = line.trim();
    let element = text.strip_prefix("- ").unwrap_or(text);
    let key = |c: char| c.is_ascii_alphanumeric() || "_-. \"'".contains(c);
    let keyed = element.split_once(':').is_some_and(|(name, value)| {
        let named = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '"');
        named && name.chars().all(key) && (value.is_empty() || value.starts_with(' '))
    });
    text == "---" || text.starts_with('#') || keyed || text.starts_with("- ")
}

/// The records of a text: elements of a list, or documents.
pub struct Parts {
    documents: bool,
    /// The line that begins the next record.
    ahead: Vec<u8>,
}

impl Parts {
    /// The records of a text that is YAML: nearly all lines are keys, and it is a list, or has several
    /// documents.
    pub fn of(text: &str) -> Option<Self> {
        let lines = || text.lines().filter(|line| !line.trim().is_empty()).take(LINES);
        let count = lines().count();
        let documents = lines().any(|line| line.trim_end() == "---");
        let structured = documents || lines().any(|line| line.starts_with("- "));
        let fits = lines().filter(|line| is_line(line)).count() as f64;
        let yaml = structured && count > 3 && fits >= SHARE * count as f64;
        yaml.then(|| Self { documents, ahead: Vec::new() })
    }

    fn begins(&self) -> bool {
        self.ahead.starts_with(if self.documents { b"---" } else { b"- " })
    }

    /// Reads the next record; `false` at the end.
    pub fn next(&mut self, file: &mut impl BufRead, record: &mut Vec<u8>) -> Result<bool> {
        record.clear();
        record.append(&mut self.ahead);
        loop {
            let length = file.by_ref().take(PIECE).read_until(b'\n', &mut self.ahead)?;
            if self.ahead.trim_ascii_start().starts_with(b"#") {
                self.ahead.clear();
                continue;
            }
            let filled = || record.iter().any(|b| !b.is_ascii_whitespace() && *b != b'-');
            if length == 0 || (self.begins() && filled()) {
                return Ok(length > 0 || filled());
            }
            record.append(&mut self.ahead);
            bounded(record.len())?;
        }
    }
}

/// A mapping, or a list, that is being read.
struct Level {
    /// Spaces before its lines.
    indent: usize,
    /// Length of its path.
    base: usize,
    /// Index of the element of a list; `None` for a mapping.
    index: Option<usize>,
}

/// Calls `found` with the path and the text of each value of a record.
pub fn values(record: &str, mut found: impl FnMut(&str, &str)) {
    // the element of the outermost list is the record itself
    let inner = record.strip_prefix("- ").map(|rest| format!("  {rest}"));
    let mut lines = inner.as_deref().unwrap_or(record).lines();
    let (mut path, mut levels) = (String::new(), Vec::<Level>::new());
    while let Some(line) = lines.next() {
        let mut rest = line.trim();
        let mut indent = line.len() - line.trim_start().len();
        if rest.is_empty() || rest.starts_with(['#', '%']) || rest == "---" || rest == "..." {
            continue;
        }
        while let Some(element) = rest.strip_prefix("- ").filter(|_| levels.len() < DEEPEST) {
            levels.retain(|level| level.indent <= indent);
            match levels.last_mut().filter(|level| level.indent == indent) {
                Some(Level { index: Some(index), base, .. }) => {
                    *index += 1;
                    path.truncate(*base);
                }
                _ => levels.push(Level { indent, base: path.len(), index: Some(0) }),
            }
            let index = levels.last().and_then(|level| level.index).unwrap_or_default();
            join(&mut path, &index.to_string());
            indent += rest.len() - element.trim_start().len();
            rest = element.trim_start();
        }
        let Some((key, value)) = key(rest) else {
            if levels.last().is_some_and(|level| level.index.is_some()) {
                scalar(&path, rest, &mut found);
            }
            continue;
        };
        // a list may stand below its key without more spaces
        levels.retain(|l| l.indent < indent || (l.indent == indent && l.index.is_none()));
        match levels.last().filter(|level| level.indent == indent) {
            Some(level) => path.truncate(level.base),
            None if levels.len() < DEEPEST => {
                levels.push(Level { indent, base: path.len(), index: None });
            }
            None => continue,
        }
        join(&mut path, key);
        let mut value = value.to_owned();
        while value.starts_with(['[', '{']) && open(&value) {
            let Some(line) = lines.next() else { break };
            value.push(' ');
            value.push_str(line.trim());
        }
        if value.starts_with(['[', '{']) {
            flow(&mut path, &value, DEEPEST, &mut found);
        } else if !value.is_empty() {
            scalar(&path, &value, &mut found);
        }
    }
}

/// The key of a line, and its value.
fn key(text: &str) -> Option<(&str, &str)> {
    let (key, value) = text.split_once(": ").or_else(|| Some((text.strip_suffix(':')?, "")))?;
    Some((key.trim().trim_matches(['"', '\'']), value.trim()))
}

fn scalar(path: &str, text: &str, found: &mut impl FnMut(&str, &str)) {
    let text = text.split(" #").next().unwrap_or_default().trim().trim_matches(['"', '\'']);
    found(path, if ["null", "~"].contains(&text) { "" } else { text });
}

/// Tests whether a bracket is still open.
fn open(text: &str) -> bool {
    text.matches(['[', '{']).count() > text.matches([']', '}']).count()
}

/// Calls `found` with each value of a list or mapping in brackets.
fn flow(path: &mut String, text: &str, depth: usize, found: &mut impl FnMut(&str, &str)) {
    let mapping = text.starts_with('{');
    // a bracket is one byte
    let inner = text.get(1..).unwrap_or_default();
    let (base, mut level, mut start) = (path.len(), 0_usize, 0);
    let mut parts = Vec::new();
    for (at, c) in inner.char_indices() {
        match c {
            '[' | '{' => level += 1,
            ']' | '}' if level == 0 => {
                parts.push(&inner[start..at]);
                start = inner.len();
                break;
            }
            ']' | '}' => level -= 1,
            ',' if level == 0 => {
                parts.push(&inner[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&inner[start..]);
    for (index, part) in parts.iter().map(|part| part.trim()).enumerate() {
        let named = key(part).filter(|_| mapping);
        let (name, value) = named.map_or((index.to_string(), part), |(k, v)| (k.to_owned(), v));
        if value.is_empty() {
            continue;
        }
        join(path, &name);
        if value.starts_with(['[', '{']) && depth > 0 {
            flow(path, value, depth - 1, found);
        } else {
            scalar(path, value, found);
        }
        path.truncate(base);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_yaml(text: &str) -> bool {
        Parts::of(text).is_some()
    }

    #[test]
    fn lists_and_documents_are_yaml_and_tables_are_not() {
        assert!(is_yaml(
            "- time: 0.01\n  gyro: [0.1, 0.2, 0.3]\n- time: 0.02\n  gyro: [0, 0, 1]\n"
        ));
        assert!(is_yaml("header:\n  stamp:\n    sec: 1\nw:\n  x: 0.1\n---\nheader:\n  sec: 2\n"));
        assert!(!is_yaml("time,gx\n0.01,2\n0.02,3\n0.03,4\n0.04,5\n"));
        assert!(!is_yaml("t: 0.01 gx: 0.2 gy: 0.3\nt: 0.02 gx: 0.2 gy: 0.3\n"));
    }
}
