//! Exact time stamps: decimal text becomes nanoseconds without a binary fraction in between.

use navfuse_core::units::time::{Span, Time};

/// The reason why a cell is not a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimeError {
    /// The cell is not a decimal number.
    NotANumber,
    /// The time is more than 73 years from zero, the limit of [`Time`].
    TooLarge,
}

/// Limit of the mantissa: more digits than any count of nanoseconds has. Its product with the
/// nanoseconds of a day still fits.
const MAX_MANTISSA: u128 = 10_u128.pow(22);
/// Largest power of ten of interest: beyond, the result is zero or too large.
const MAX_POWER: i64 = 40;

/// Parses a decimal number as a time, rounded to the nearest nanosecond, halves away from zero. The
/// `unit` of the number is given in nanoseconds, at most a day.
pub fn parse(text: &[u8], unit: u64) -> Result<Time, TimeError> {
    let inside = |n: &i64| n.unsigned_abs() < Time::MAX.nanos().unsigned_abs();
    let plain = || crate::number::plain(std::str::from_utf8(text).ok()?);
    let nanos = nanos(text, unit).or_else(|error| match plain() {
        Some(text) if error == TimeError::NotANumber => nanos(text.as_bytes(), unit),
        _ => Err(error),
    })?;
    let nanos = i64::try_from(nanos).ok().filter(inside);
    nanos.map(Time::from_nanos).ok_or(TimeError::TooLarge)
}

/// The nanoseconds of a decimal number in a unit.
pub fn nanos(text: &[u8], unit: u64) -> Result<i128, TimeError> {
    let (negative, text) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    let (mut mantissa, mut power, mut digits, mut point) = (0_u128, 0_i64, 0_usize, false);
    let mut rest = text;
    while let [first, after @ ..] = rest {
        match first {
            b'0'..=b'9' => {
                digits += 1;
                if mantissa < MAX_MANTISSA {
                    mantissa = mantissa * 10 + u128::from(first - b'0');
                    power -= i64::from(point);
                } else {
                    power += i64::from(!point);
                }
            }
            b'.' if !point => point = true,
            _ => break,
        }
        rest = after;
    }
    if digits == 0 {
        return Err(TimeError::NotANumber);
    }
    match rest {
        [] => {}
        // D is the exponent of a double in Fortran
        [b'e' | b'E' | b'd' | b'D', exponent @ ..] => {
            let exponent: i64 = std::str::from_utf8(exponent)
                .ok()
                .and_then(|e| e.parse().ok())
                .ok_or(TimeError::NotANumber)?;
            power = power.saturating_add(exponent);
        }
        _ => return Err(TimeError::NotANumber),
    }
    let magnitude = scaled(mantissa, power, unit).ok_or(TimeError::TooLarge)?;
    let nanos = i128::try_from(magnitude).map_err(|_| TimeError::TooLarge)?;
    Ok(if negative { -nanos } else { nanos })
}

/// `mantissa * 10^power * unit`, rounded; `None` when too large.
fn scaled(mantissa: u128, power: i64, unit: u64) -> Option<u128> {
    if mantissa == 0 || power < -MAX_POWER {
        return Some(0);
    }
    let ten = |power: i64| 10_u64.checked_pow(u32::try_from(power).ok()?);
    // the usual case, seconds with at most nine decimals, needs no division of 128-bit numbers
    if let Some(step) = ten(-power).filter(|step| unit.is_multiple_of(*step)) {
        return mantissa.checked_mul(u128::from(unit / step));
    }
    let whole = mantissa.checked_mul(u128::from(unit))?;
    let ten = 10_u128.checked_pow(u32::try_from(power.abs().min(MAX_POWER)).ok()?);
    match ten {
        Some(ten) if power >= 0 => whole.checked_mul(ten),
        Some(ten) => Some((whole + ten / 2) / ten),
        // ten to more than 38: too large, or less than a half
        None => (power < 0).then_some(0),
    }
}

/// The span of a number of seconds; the whole part is exact. `None` if the number is too large.
pub fn from_seconds(seconds: f64) -> Option<Span> {
    let nanos = i128::from(seconds.trunc() as i64) * 1_000_000_000
        + i128::from((seconds.fract() * 1e9).round() as i64);
    i64::try_from(nanos).ok().filter(|n| n.abs() < Time::MAX.nanos()).map(Span::from_nanos)
}

/// Writes nanoseconds as seconds with the decimals that it needs.
pub fn write_seconds(nanos: i64, out: &mut Vec<u8>) {
    use std::io::Write;
    let magnitude = nanos.unsigned_abs();
    let sign = if nanos < 0 { "-" } else { "" };
    // writing into a vector cannot fail
    let _ = write!(out, "{sign}{}", magnitude / 1_000_000_000);
    if !magnitude.is_multiple_of(1_000_000_000) {
        let _ = write!(out, ".{:09}", magnitude % 1_000_000_000);
        while out.last() == Some(&b'0') {
            out.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    // a failed test may panic
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    const S: u64 = 1_000_000_000;
    const MS: u64 = 1_000_000;

    fn nanos(text: &str, unit: u64) -> Result<i64, TimeError> {
        parse(text.as_bytes(), unit).map(Time::nanos)
    }

    #[test]
    fn decimal_text_becomes_its_exact_nanoseconds() {
        for (text, unit, expected) in [
            ("0.01", S, 10_000_000),
            ("-0.41", S, -410_000_000),
            ("+1.", S, 1_000_000_000),
            (".5", S, 500_000_000),
            ("0", S, 0),
            ("-0.0", S, 0),
            // as numpy writes 0.01 by default
            ("1.000000000000000021e-02", S, 10_000_000),
            ("2.5e3", S, 2_500_000_000_000),
            ("2.5D+03", S, 2_500_000_000_000),
            // a double near 1.65e9 s is 240 ns from the next
            ("1654321000.123456789", S, 1_654_321_000_123_456_789),
            ("1654321000123456789", 1, 1_654_321_000_123_456_789),
            ("1654321000123.456", MS, 1_654_321_000_123_456_000),
            ("1.5", 60 * S, 90_000_000_000),
            ("0.0000000015", S, 2),
            ("-0.0000000015", S, -2),
            ("0.00000000149", S, 1),
            ("0.00000000000000000000000000000000000000000000001", S, 0),
            ("1e-9999999999999", S, 0),
            ("0e999999999", S, 0),
            ("0000000000000000000000000000000000000000000000001", S, 1_000_000_000),
            ("100000000000000000000000000e-26", S, 1_000_000_000),
        ] {
            assert_eq!(nanos(text, unit), Ok(expected), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_or_too_large_is_refused() {
        for text in [
            "", "-", ".", "e5", "1e", "1e+", "1 2", "1,5", "0x10", "1.2.3", "nan", "inf",
            "12:30:01", "1\u{b5}",
        ] {
            assert_eq!(nanos(text, S), Err(TimeError::NotANumber), "{text}");
        }
        for text in
            ["1e10", "-1e10", "1e999999999999", "99999999999999999999999999999999999999999999"]
        {
            assert_eq!(nanos(text, S), Err(TimeError::TooLarge), "{text}");
        }
    }

    proptest! {
        #[test]
        fn a_written_time_reads_back(n in -Time::MAX.nanos() + 1..Time::MAX.nanos()) {
            let mut text = Vec::new();
            write_seconds(n, &mut text);
            prop_assert_eq!(parse(&text, S), Ok(Time::from_nanos(n)));
        }

        #[test]
        fn any_unit_gives_the_same_time(n in -1_000_000_000_000_000_i64..1_000_000_000_000_000) {
            let at = |divisor: i64, digits: usize| {
                let (sign, m) = (if n < 0 { "-" } else { "" }, n.abs());
                format!("{sign}{}.{:0digits$}", m / divisor, m % divisor)
            };
            prop_assert_eq!(nanos(&at(1_000_000_000, 9), S), Ok(n));
            prop_assert_eq!(nanos(&at(1_000_000, 6), MS), Ok(n));
            prop_assert_eq!(nanos(&at(1_000, 3), 1_000), Ok(n));
            prop_assert_eq!(nanos(&n.to_string(), 1), Ok(n));
        }

        #[test]
        fn any_bytes_are_a_time_or_an_error(text in proptest::collection::vec(any::<u8>(), 0..40)) {
            let _ = parse(&text, S);
        }

        #[test]
        fn anything_like_a_number_is_a_time_or_an_error(
            text in "[-+]?[0-9]{0,50}\\.?[0-9]{0,50}([eE][-+]?[0-9]{1,20})?"
        ) {
            let _ = parse(text.as_bytes(), 86_400 * S);
        }
    }

    #[test]
    fn an_offset_of_whole_seconds_is_exact() {
        // 1654321000.25 s is a double exactly
        assert_eq!(from_seconds(-1_654_321_000.25).unwrap().nanos(), -1_654_321_000_250_000_000);
        assert_eq!(from_seconds(0.05).unwrap().nanos(), 50_000_000);
        assert_eq!(from_seconds(1e10), None);
        assert_eq!(from_seconds(f64::INFINITY), None);
    }
}
