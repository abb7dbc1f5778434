//! Text of unknown encoding.

use std::borrow::Cow;

/// The text of bytes: lines that are not UTF-8 are in Latin-1, as Windows programs write degrees and
/// umlauts. A character at the end may be cut off.
#[must_use]
pub fn text(bytes: &[u8]) -> Cow<'_, str> {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return Cow::Borrowed(text);
    }
    let line = |line: &[u8]| match std::str::from_utf8(line) {
        Err(e) if e.error_len().is_some() => line.iter().map(|b| char::from(*b)).collect(),
        _ => String::from_utf8_lossy(line).into_owned(),
    };
    bytes.split_inclusive(|b| *b == b'\n').map(line).collect::<String>().into()
}

#[cfg(test)]
mod tests {
    use super::text;

    #[test]
    fn lines_are_in_utf_8_or_in_latin_1() {
        assert_eq!(text(b"L\xe4nge [\xb0]\n48,1\n"), "Länge [°]\n48,1\n");
        assert_eq!(text("Länge\n".as_bytes()), "Länge\n");
        // each line by itself, and the last one may be cut off within a character
        assert_eq!(text(b"L\xc3\xa4nge\nH\xf6he\n1\xc3"), "Länge\nHöhe\n1\u{fffd}");
    }
}
