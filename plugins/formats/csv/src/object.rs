//! The values of an object of JSON with their paths.

use crate::paths::{DEEPEST, join};

/// Quotation marks of JSON, and of the printed objects of Python.
const QUOTES: [char; 2] = ['"', '\''];

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
    while let Some(first) = rest.chars().next() {
        match first {
            '}' | ']' => {
                levels.pop();
                if let Some(level) = levels.last_mut() {
                    level.keyed = false;
                }
                rest = &rest[1..];
                continue;
            }
            ',' | ':' => {
                rest = &rest[1..];
                continue;
            }
            c if c.is_whitespace() => {
                rest = &rest[c.len_utf8()..];
                continue;
            }
            _ => {}
        }
        if let Some(level) = levels.last_mut().filter(|l| l.index.is_some() || l.keyed) {
            level.keyed = false;
            if let Some(index) = &mut level.index {
                path.truncate(level.base);
                join(&mut path, &index.to_string());
                *index += 1;
            }
        } else if QUOTES.contains(&first)
            && let Some(level) = levels.last_mut()
        {
            let (key, after) = string(rest);
            path.truncate(level.base);
            join(&mut path, key);
            level.keyed = true;
            rest = after;
            continue;
        }
        match first {
            '{' | '[' if levels.len() < DEEPEST => {
                let index = (first == '[').then_some(0);
                levels.push(Level { base: path.len(), index, keyed: false });
                rest = &rest[1..];
            }
            '"' | '\'' => {
                let (value, after) = string(rest);
                found(&path, value);
                rest = after;
            }
            _ => {
                let end = |c: char| c.is_whitespace() || [',', '}', ']'].contains(&c);
                let at = rest.find(end).unwrap_or(rest.len()).max(first.len_utf8());
                found(&path, if &rest[..at] == "null" { "" } else { &rest[..at] });
                rest = &rest[at..];
            }
        }
    }
}

/// The text of a string at the beginning, with its escapes, and what follows.
fn string(text: &str) -> (&str, &str) {
    let (quote, inner) = (text.chars().next(), &text[1..]);
    let mut escaped = false;
    let end = inner.find(|c: char| {
        let ends = Some(c) == quote && !escaped;
        escaped = c == '\\' && !escaped;
        ends
    });
    end.map_or((inner, ""), |at| (&inner[..at], &inner[at + 1..]))
}
