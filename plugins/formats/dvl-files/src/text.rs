//! Fields of a sentence.

use std::str::FromStr;

/// Splits a sentence at its commas, without blanks and without the names of tagged fields:
/// `DIST=36.66` is `36.66`.
pub fn fields(sentence: &[u8]) -> impl Iterator<Item = &str> {
    sentence.split(|b| *b == b',').map(|field| {
        let text = std::str::from_utf8(field).unwrap_or_default().trim();
        text.split_once('=').map_or(text, |(_, value)| value)
    })
}

/// The next field as a value.
pub fn value<'a, T: FromStr>(fields: &mut impl Iterator<Item = &'a str>) -> Option<T> {
    fields.next()?.parse().ok()
}

/// The next field as a finite number.
pub fn number<'a>(fields: &mut impl Iterator<Item = &'a str>) -> Option<f64> {
    value::<f64>(fields).filter(|x| x.is_finite())
}

/// The two digits at an offset.
pub fn two_digits(text: &str, at: usize) -> Option<u8> {
    let digits = text.get(at..at + 2)?;
    if digits.bytes().all(|b| b.is_ascii_digit()) { digits.parse().ok() } else { None }
}
