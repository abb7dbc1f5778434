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

/// A number whose digits stand in groups of three, such as `1,234.5`, without the commas; `None` for any other cell. Where
/// commas do not separate cells, one comma alone may begin decimals: the number then needs a second one, or a point.
#[must_use]
pub fn ungrouped(cell: &[u8], between_commas: bool) -> Option<Vec<u8>> {
    let marks = cell.iter().filter(|b| [b',', b'.'].contains(b)).count();
    if !between_commas && marks < 2 {
        return None;
    }
    let digits = cell.strip_prefix(b"-").unwrap_or(cell);
    let whole = digits.split(|b| *b == b'.').next()?;
    let mut groups = whole.split(|b| *b == b',');
    let first = groups.next()?;
    let number = |group: &[u8]| group.iter().all(u8::is_ascii_digit);
    let begins = (1..=3).contains(&first.len()) && first[0] != b'0' && number(first);
    let fits = begins && groups.all(|group| group.len() == 3 && number(group));
    let grouped = fits && whole.len() > first.len() && !digits[whole.len()..].contains(&b',');
    grouped.then(|| cell.iter().copied().filter(|b| *b != b',').collect())
}

#[cfg(test)]
mod tests {
    // a failed test may panic
    #![allow(clippy::unwrap_used)]
    use super::{text, ungrouped};

    #[test]
    fn groups_of_three_digits_are_one_number_and_other_commas_are_none() {
        let between = |cell: &str, commas: bool| {
            ungrouped(cell.as_bytes(), commas).map(|n| String::from_utf8(n).unwrap())
        };
        let number = |cell: &str| between(cell, true);
        assert_eq!(number("-1,234,010.25").as_deref(), Some("-1234010.25"));
        assert_eq!(number("12,345").as_deref(), Some("12345"));
        // between tabs
        assert_eq!(between("1,234,010", false).as_deref(), Some("1234010"));
        assert_eq!(between("1,234.5", false).as_deref(), Some("1234.5"));
        assert_eq!(between("12,345", false), None);
        // decimal commas, lists, and a number without groups
        for cell in
            ["0,123", "9,81", "1,2,3", "1234", "1,2345", "1,234,", "1.5,234", "", ",123", "-"]
        {
            assert_eq!(number(cell), None, "{cell}");
        }
    }

    #[test]
    fn lines_are_in_utf_8_or_in_latin_1() {
        assert_eq!(text(b"L\xe4nge [\xb0]\n48,1\n"), "Länge [°]\n48,1\n");
        assert_eq!(text("Länge\n".as_bytes()), "Länge\n");
        // each line by itself, and the last one may be cut off within a character
        assert_eq!(text(b"L\xc3\xa4nge\nH\xf6he\n1\xc3"), "Länge\nHöhe\n1\u{fffd}");
    }
}
