//! The values of an object of JSON with their paths. Strings may have the quotation marks of Python, arrays its round
//! brackets, and values and arrays the name of a type around them, as in `np.float64(0.1)` and `array([1, 2])`.

use crate::paths::{DEEPEST, join};
use std::fmt::Write;

/// A container of JSON: the length of its path, the next index of an array, and whether an object has
/// a key that waits for its value.
struct Level {
    base: usize,
    index: Option<usize>,
    keyed: bool,
    /// Number of types whose bracket is open.
    types: usize,
}

/// Calls `found` with the path and the text of each value of an object.
pub fn object(text: &str, mut found: impl FnMut(&str, &str)) {
    let (mut path, mut levels, mut rest) = (String::new(), Vec::<Level>::new(), text);
    // all marks are bytes of ASCII, which no other character contains
    while let Some(first) = rest.as_bytes().first().copied() {
        match first {
            b')' if levels.last().is_some_and(|level| level.types > 0) => {
                if let Some(level) = levels.last_mut() {
                    level.types -= 1;
                }
                rest = &rest[1..];
                continue;
            }
            b'}' | b']' | b')' => {
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
        if let Some(level) = levels.last_mut()
            && let Some(inner) = without_type(rest)
        {
            level.types += 1;
            rest = inner;
            continue;
        }
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
            b'{' | b'[' | b'(' if levels.len() < DEEPEST => {
                let index = (first != b'{').then_some(0);
                levels.push(Level { base: path.len(), index, keyed: false, types: 0 });
                rest = &rest[1..];
            }
            _ if quoted => {
                let (value, after) = string(rest);
                found(&path, value);
                rest = after;
            }
            _ => {
                let ends =
                    |b: &u8| matches!(b, b',' | b'}' | b']' | b')') || b.is_ascii_whitespace();
                let at = rest.bytes().skip(1).position(|b| ends(&b)).map_or(rest.len(), |k| k + 1);
                found(
                    &path,
                    if ["null", "None"].contains(&&rest[..at]) { "" } else { &rest[..at] },
                );
                rest = &rest[at..];
            }
        }
    }
}

/// What follows the name of a type and its bracket at the beginning.
fn without_type(text: &str) -> Option<&str> {
    let name = |c: char| c.is_ascii_alphanumeric() || ['.', '_'].contains(&c);
    let named = text.starts_with(|c: char| c.is_ascii_alphabetic());
    named.then(|| text.trim_start_matches(name).strip_prefix('('))?
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

#[cfg(test)]
mod tests {
    use super::object;

    #[test]
    fn what_python_prints_has_the_values_of_json() {
        let values = |text: &str| {
            let mut values = Vec::new();
            object(text, |path, value| values.push(format!("{path}={value}")));
            values.join(" ")
        };
        let json =
            values(r#"{"t": 1.5, "gyro": [0.1, -2e-3], "fix": null, "ok": true, "m": [[1], [2]]}"#);
        for text in [
            "{'t': 1.5, 'gyro': (0.1, -2e-3), 'fix': None, 'ok': true, 'm': ((1,), (2,))}",
            "{'t': np.float64(1.5), 'gyro': array([0.1, -2e-3]), 'fix': None, 'ok': true, 'm': [(1,), [2]]}",
            "{'t': 1.5, 'gyro': (np.float32(0.1), np.float32(-2e-3)), 'fix': None, 'ok': true, \
             'm': array([array([1]), array([2])])}",
        ] {
            assert_eq!(values(text), json);
        }
        // brackets that nothing opened, and types without an end
        for text in [")", "{'a': f(f(f(", "{'a': )}", "{a(: 1}", "((((", "{'a': b(]}"] {
            values(text);
        }
    }
}
