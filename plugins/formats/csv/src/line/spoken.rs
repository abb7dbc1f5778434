//! Lines of a program's log in which names and numbers follow one another without marks: `[INFO] 22:13:20.010 imu: gyro
//! [0.1, 0.2, 0.3] rad/s, accel [...]`, `[INFO] [1700000000.01] [gps]: 48.1, 11.5, 500`.

use super::{KIND, STAMP, number};
use navfuse_core::units::parse_unit;

/// Characters around and between names and numbers.
const AROUND: [char; 8] = ['[', ']', '(', ')', ',', ';', '{', '}'];
/// Least number of numbers of a line.
const NUMBERS: usize = 3;
/// Words of a log for the importance of a line.
const LEVELS: [&str; 10] =
    ["info", "debug", "warn", "warning", "error", "trace", "notice", "data", "i", "d"];

/// A stamp, which has a time of the day, or is a number in brackets.
fn is_stamp(token: &str, bare: &str) -> bool {
    let clock = bare.matches(':').count() == 2 && bare.starts_with(|c: char| c.is_ascii_digit());
    clock
        || (token.starts_with(['[', '(']) && token.ends_with([']', ')']) && number(bare).is_some())
}

/// Reads a line of a log that begins with a stamp, behind which the word before a colon is the kind; `false` for another
/// one. Numbers without a name are counted from zero.
pub fn line(text: &str, found: &mut impl FnMut(&str, &str)) -> bool {
    let (mut stamp, mut kind, mut name) = (None, None, "");
    let mut values: Vec<(&str, Vec<&str>)> = Vec::new();
    let mut before = "";
    for token in text.split_whitespace() {
        let bare = token.trim_matches(AROUND);
        let marked = bare.ends_with(':') || token.ends_with("]:") || token.ends_with("):");
        let word = bare.trim_end_matches([':', ']', ')']);
        if stamp.is_none() && is_stamp(token, word) {
            stamp = Some(match before.matches(['-', '/']).count() {
                2 => format!("{before} {word}"),
                _ => word.to_owned(),
            });
        } else if bare.contains('=') || bare.starts_with(['$', '!']) {
            return false;
        } else if number(bare).is_some() && stamp.is_some() && kind.is_some() {
            match values.last_mut().filter(|(last, _)| *last == name) {
                Some((_, numbers)) => numbers.push(bare),
                None => values.push((name, vec![bare])),
            }
        } else if marked
            && kind.is_none()
            && stamp.is_some()
            && word.starts_with(char::is_alphabetic)
        {
            kind = Some(word);
        } else if marked && kind.is_some() {
            // names with marks are those of other lines
            return false;
        } else if kind.is_some()
            && word.starts_with(char::is_alphabetic)
            && parse_unit(word).is_err()
        {
            name = word;
        }
        before = bare;
    }
    let (Some(stamp), Some(kind)) = (stamp, kind) else { return false };
    let count: usize = values.iter().map(|(_, numbers)| numbers.len()).sum();
    if count < NUMBERS || LEVELS.contains(&kind.to_ascii_lowercase().as_str()) {
        return false;
    }
    found(STAMP, &stamp);
    found(KIND, kind);
    for (name, numbers) in values {
        for (k, number) in numbers.iter().enumerate() {
            match (name, numbers.len()) {
                ("", _) => found(&k.to_string(), number),
                (_, 1) => found(name, number),
                _ => found(&format!("{name}.{k}"), number),
            }
        }
    }
    true
}
