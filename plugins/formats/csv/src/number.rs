//! Numbers as programs write them.

/// Words that programs write for a missing number, in addition to those that Rust parses as NaN.
const ABSENT: [&str; 13] = [
    "na", "n/a", "#n/a", "null", "none", "nil", "missing", "-", "--", "---", "1.#qnan", "1.#ind",
    "-1.#ind",
];

/// Tests whether a cell holds a word for a missing number, or the stars of Fortran for one that its column is too narrow for.
#[must_use]
pub fn is_absent(cell: &str) -> bool {
    let stars = cell.len() > 1 && cell.bytes().all(|b| b == b'*');
    stars || ABSENT.iter().any(|word| word.eq_ignore_ascii_case(cell))
}

/// The number of a cell: as Rust parses it, with an exponent of Fortran (`1.0D+03`), or a coordinate with its side
/// (`4806.0N`, `W 105.2`), which is negative to the south and to the west, or as other programs write it.
#[must_use]
pub fn number(cell: &str) -> Option<f64> {
    let other = || double(cell).or_else(|| sided(cell));
    cell.parse().ok().or_else(other).or_else(|| plain(cell)?.parse().ok())
}

/// The digits of a number with the minus sign of typography, with an apostrophe or a narrow space between groups of three
/// digits, or with the checksum of its line behind it (`9.81*4A`); `None` for any other cell.
pub fn plain(cell: &str) -> Option<String> {
    const MINUS: char = '\u{2212}';
    const BETWEEN: [char; 5] = ['\'', '\u{2019}', '\u{a0}', '\u{2009}', '\u{202f}'];
    let sum = |sum: &str| sum.len() == 2 && sum.bytes().all(|b| b.is_ascii_hexdigit());
    let number = cell.split_once('*').filter(|(_, rest)| sum(rest)).map_or(cell, |(n, _)| n);
    let whole = number.split('.').next()?;
    let mut groups = whole.split(BETWEEN);
    let first = groups.next()?.trim_start_matches(['-', MINUS]);
    let grouped = (1..=3).contains(&first.len()) && groups.clone().all(|group| group.len() == 3);
    let changed = number.len() < cell.len() || number.starts_with(MINUS);
    match groups.next() {
        Some(_) if !grouped => None,
        None if !changed => None,
        _ => Some(number.replace(BETWEEN, "").replace(MINUS, "-")),
    }
}

/// A number with the exponent of a double in Fortran.
fn double(cell: &str) -> Option<f64> {
    let (mantissa, exponent) = cell.split_once(['D', 'd'])?;
    let digits = mantissa.ends_with(|c: char| c.is_ascii_digit() || c == '.');
    let power = exponent.parse::<i32>().ok().filter(|_| digits)?;
    format!("{mantissa}e{power}").parse().ok()
}

/// A coordinate with decimals and with its side before or behind it.
fn sided(cell: &str) -> Option<f64> {
    let is_side = |c: char| matches!(c, 'N' | 'S' | 'E' | 'W');
    let (side, rest) = match cell.strip_suffix(is_side) {
        Some(rest) => (cell.chars().next_back()?, rest.trim_end()),
        None => (cell.chars().next().filter(|c| is_side(*c))?, cell.get(1..)?.trim_start()),
    };
    let plain = rest.bytes().all(|b| b.is_ascii_digit() || b == b'.') && rest.contains('.');
    let angle: f64 = rest.parse().ok().filter(|_| plain)?;
    Some(if matches!(side, 'S' | 'W') { -angle } else { angle })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_of_fortran_and_sides_of_the_earth_are_parts_of_numbers() {
        for (cell, value) in [
            ("-1.5e3", -1500.0),
            ("1.5D+03", 1500.0),
            ("-0.25d-2", -0.0025),
            ("4806.25N", 4806.25),
            ("S 33.5", -33.5),
            ("105.25 W", -105.25),
            ("\u{2212}0.5", -0.5),
            ("-1'234'567.25", -1_234_567.25),
            ("12\u{a0}345", 12_345.0),
            ("-9.81*4A", -9.81),
        ] {
            assert_eq!(number(cell), Some(value), "{cell}");
        }
        for cell in [
            "32N", "D3", "1D", "1.5S2", "N", "1.5 m", "-33.5S", "1e5W", "", "0x1D3", "1'23",
            "'123", "1*2", "48'06",
        ] {
            assert_eq!(number(cell), None, "{cell}");
        }
        assert!(is_absent("#N/A") && is_absent("--") && !is_absent("-1"));
    }
}
