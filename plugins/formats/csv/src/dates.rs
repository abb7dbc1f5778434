//! Dates with their time of the day in one text whose order needs no key: months by their names, days of the year, and
//! digits without separators.

use crate::config::Order;
use navfuse_core::units::calendar;

/// Months by the first three letters of their English names.
const MONTHS: [&str; 12] =
    ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];
/// Words that neither a month nor a half of a day needs.
const IGNORED: [&str; 10] = ["mon", "tue", "wed", "thu", "fri", "sat", "sun", "utc", "gmt", "z"];
/// Longest text of a date with a time of the day.
const LONGEST: usize = 64;
/// Nanoseconds of half a day.
const HALF: i64 = calendar::DAY / 2;

/// Nanoseconds since 1970 of a date with a time of the day: `14-Nov-2023 22:13:20.01`, `Nov 14, 2023 10:13:20 PM`,
/// `2023:318:22:13:20.01`, `2023-318T22:13:20Z`, `20231114T221320.01Z`, or `20231114221320`; `None` for other texts.
#[must_use]
pub fn date(text: &str) -> Option<i64> {
    let text = text.trim();
    if text.len() > LONGEST || !text.is_ascii() {
        return None;
    }
    named(text).or_else(|| of_year(text)).or_else(|| compact(text))
}

/// The nanoseconds of a calendar date and a time of the day such as `22:13:20.01+01:00`.
fn joined(year: u16, month: u8, day: u8, time: &str) -> Option<i64> {
    let (nanos, has_time) =
        calendar::parse(&format!("{year:04}-{month:02}-{day:02}T{}", time.trim()))?;
    has_time.then_some(nanos)
}

/// A date whose month is a word.
fn named(text: &str) -> Option<i64> {
    if !text.bytes().any(|b| b.is_ascii_alphabetic()) {
        return None;
    }
    let (mut month, mut day, mut year, mut half, mut zone) = (None, None, None, None, "");
    let mut time: Option<(u8, String)> = None;
    for token in text.split([' ', ',', '\t']).filter(|token| !token.is_empty()) {
        if token.contains(':') && offset(token).is_none() {
            // `2023-Nov-14T22:13:20`, and the hour and the rest of the time
            let token = match token.split_once('T') {
                Some((date, clock)) if date.contains('-') => {
                    of_parts(date, &mut month, &mut day, &mut year)?;
                    clock
                }
                _ => token,
            };
            let (hour, rest) = token.split_once(':')?;
            time = Some((hour.parse().ok()?, rest.to_owned()));
        } else if let Some(offset) = offset(token).filter(|_| time.is_some()) {
            zone = offset;
        } else {
            match token.to_ascii_lowercase().as_str() {
                "am" => half = Some(0),
                "pm" => half = Some(HALF),
                word if IGNORED.contains(&word) => {}
                _ => of_parts(token, &mut month, &mut day, &mut year)?,
            }
        }
    }
    let (hour, rest) = time?;
    let (hour, half) = match half {
        Some(_) if !(1..=12).contains(&hour) => return None,
        Some(half) => (hour % 12, half),
        None => (hour, 0),
    };
    joined(year?, month?, day?, &format!("{hour:02}:{rest}{zone}"))?.checked_add(half)
}

/// The offset of a zone, as `+01:00` or `GMT+01:00`.
fn offset(token: &str) -> Option<&str> {
    let prefixes = ["", "GMT", "UTC"].into_iter();
    let mut rests = prefixes.filter_map(|prefix| token.strip_prefix(prefix));
    rests.find(|rest| rest.starts_with(['+', '-']))
}

/// Takes month, day and year from parts such as `14-Nov-2023`, `Nov` or `14`.
fn of_parts(
    token: &str,
    month: &mut Option<u8>,
    day: &mut Option<u8>,
    year: &mut Option<u16>,
) -> Option<()> {
    for part in token.split(['-', '/', '.']).filter(|part| !part.is_empty()) {
        if part.starts_with(|c: char| c.is_ascii_alphabetic()) {
            let name = part.get(..3)?.to_ascii_lowercase();
            if IGNORED.contains(&name.as_str()) {
                continue;
            }
            let k = MONTHS.iter().position(|m| *m == name)?;
            month.replace(u8::try_from(k + 1).ok()?).is_none().then_some(())?;
        } else {
            let number: u16 = part.parse().ok()?;
            let into_year = part.len() == 4 || day.is_some();
            match (into_year, part.len()) {
                (true, 2) => {
                    let year_of = calendar::with_century(u8::try_from(number).ok()?);
                    year.replace(u16::try_from(year_of).ok()?).is_none().then_some(())?;
                }
                (true, _) => year.replace(number).is_none().then_some(())?,
                _ => day.replace(u8::try_from(number).ok()?).is_none().then_some(())?,
            }
        }
    }
    Some(())
}

/// A year with the day of the year in three digits.
fn of_year(text: &str) -> Option<i64> {
    let is_separator = |c: char| matches!(c, ':' | '-' | '/' | ' ' | '_' | '.');
    let (year, rest) = (text.get(..4)?, text.get(4..)?.strip_prefix(is_separator)?);
    let (day, rest) = (rest.get(..3)?, rest.get(3..)?);
    let time = rest.strip_prefix(|c: char| is_separator(c) || c == 'T')?;
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if !digits(year) || !digits(day) || !time.contains(':') {
        return None;
    }
    let first = joined(1970, 1, 1, time)?;
    day_of_year(year.parse().ok()?, day.parse().ok()?)?.checked_add(first)
}

/// A date and a time of the day without separators, between which a `T`, a space, `_` or `-` may stand.
fn compact(text: &str) -> Option<i64> {
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    let (date, rest) = (text.get(..8).filter(|date| digits(date))?, text.get(8..)?);
    let rest = rest.strip_prefix(['T', ' ', '_', '-']).unwrap_or(rest);
    let (clock, rest) = (rest.get(..6).filter(|clock| digits(clock))?, rest.get(6..)?);
    if !rest.is_empty() && !rest.starts_with(['.', 'Z', '+', '-']) {
        return None;
    }
    let time = format!("{}:{}:{}{rest}", &clock[..2], &clock[2..4], &clock[4..]);
    joined(date[..4].parse().ok()?, date[4..6].parse().ok()?, date[6..].parse().ok()?, &time)
}

/// Nanoseconds since 1970 of the begin of a day in a column of dates without separators: `20231114`, or six digits in an
/// order, of which `year-month-day` is that of `231114`.
pub fn day_of_digits(text: &str, order: Order) -> Option<i64> {
    let number = |from: usize, to: usize| text.get(from..to)?.parse::<u8>().ok();
    if !text.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let [year, month, day] = match (text.len(), order) {
        (8, _) => {
            let year = text[..4].parse::<u16>().ok()?;
            return joined(year, number(4, 6)?, number(6, 8)?, "00:00:00");
        }
        (6, Order::YearMonthDay) => [0, 2, 4],
        (6, Order::DayMonthYear) => [4, 2, 0],
        (6, Order::MonthDayYear) => [4, 0, 2],
        _ => return None,
    };
    let year = u16::try_from(calendar::with_century(number(year, year + 2)?)).ok()?;
    joined(year, number(month, month + 2)?, number(day, day + 2)?, "00:00:00")
}

/// Nanoseconds since 1970 of the begin of a day of the year, from 1.
pub fn day_of_year(year: i32, day: i32) -> Option<i64> {
    let begin = |year: i32| joined(u16::try_from(year).ok()?, 1, 1, "00:00:00");
    let nanos = begin(year)?.checked_add(i64::from(day.checked_sub(1)?) * calendar::DAY)?;
    (day > 0 && nanos < begin(year.checked_add(1)?)?).then_some(nanos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn dates_with_names_days_of_the_year_or_digits_alone_are_the_same_time() {
        // `date -u -d @1700000000`
        let nanos = Some(1_700_000_000_250_000_000);
        for text in [
            "14-Nov-2023 22:13:20.25",
            "14 November 2023 22:13:20.250",
            "Nov 14, 2023 22:13:20.25",
            "Nov 14, 2023, 10:13:20.25 PM",
            "Tue Nov 14 22:13:20.25 2023",
            "Tue, 14 Nov 2023 22:13:20.25 GMT",
            "14/Nov/23 23:13:20.25 +0100",
            "Tue Nov 14 23:13:20.25 GMT+01:00 2023",
            "2023-Nov-14T22:13:20.25Z",
            "2023:318:22:13:20.25",
            "2023-318T22:13:20.25Z",
            "2023/318 22:13:20.25",
            "20231114T221320.25Z",
            "20231114T231320.25+01:00",
            "20231114_221320.25",
            "20231114221320.25",
        ] {
            assert_eq!(date(text), nanos, "{text}");
        }
        for text in [
            "14-Nev-2023 22:13:20",
            "Nov 14 2023",
            "14 Nov Dec 2023 22:13:20",
            "2023:366:22:13:20",
            "2023:000:22:13:20",
            "20231314221320",
            "20231114226020",
            "2023-11-14 22:13:20",
            "170000000025000000",
            "",
        ] {
            assert_eq!(date(text), None, "{text}");
        }
        assert_eq!(date("2024:366:00:00:00"), date("31 Dec 2024 00:00:00"));
    }

    #[test]
    fn a_day_of_eight_digits_begins_with_the_year_and_six_have_an_order() {
        let day = joined(2023, 11, 14, "00:00:00");
        for (text, order) in [
            ("20231114", Order::YearMonthDay),
            ("20231114", Order::DayMonthYear),
            ("231114", Order::YearMonthDay),
            ("141123", Order::DayMonthYear),
            ("111423", Order::MonthDayYear),
        ] {
            assert_eq!(day_of_digits(text, order), day, "{text}");
        }
        for text in ["20231314", "311123", "2023", "+41123", "", "20231114.5"] {
            assert_eq!(day_of_digits(text, Order::DayMonthYear), None, "{text}");
        }
        assert_eq!(day_of_year(2023, 318), day);
        assert_eq!((day_of_year(2023, 366), day_of_year(2023, 0)), (None, None));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_is_a_date_or_none(text in "(Nov|[0-9]{1,4}|[-/:. TZ+,é]|PM|am|20231114){0,14}") {
            let _ = (date(&text), day_of_digits(&text, Order::DayMonthYear));
        }
    }
}
