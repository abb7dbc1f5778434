//! Lines that name their values: `t=0.01 gx: 0.2`, what programs print, and names and numbers by turns.

mod spoken;

use crate::number::number;
use crate::object::object;
use navfuse_core::units::parse_unit;
use std::borrow::Cow;

/// Headings of a line's beginning: its date or time, and the kind of its record.
const STAMP: &str = "stamp";
const KIND: &str = "kind";

/// Calls `found` with the name and the text of each value of a line. What precedes the first name
/// is the stamp of the line, and the last word of it the kind, where it is no number. Names in brackets, as
/// `accel=Vector(x=0.1)`, follow that of the brackets; digits alone at the end are the stamp of a line of InfluxDB.
pub fn line(text: &str, mut found: impl FnMut(&str, &str)) {
    if !before_object(text, &mut found)
        && !pairs(text, &mut found)
        && !spoken::line(text, &mut found)
    {
        marked(text, found);
    }
}

/// The same for a line whose names have a mark behind them, `t=0.01 gx: 0.2`.
fn marked(text: &str, mut found: impl FnMut(&str, &str)) {
    let named = |c: char| c.is_alphanumeric() || ['_', '.', '[', ']'].contains(&c);
    let (mut at, mut first, mut stamped) = (0, true, false);
    let mut stems: Vec<&str> = Vec::new();
    while let Some(mark) = text[at..].find(['=', ':']).map(|k| at + k) {
        let before = text[at..mark].trim_end();
        let name = before.rsplit(|c: char| !named(c)).next().unwrap_or_default();
        let start = at + before.len() - name.len();
        let closed = before.matches(')').count();
        stems.truncate(stems.len().saturating_sub(closed));
        at = mark + 1;
        // otherwise it is the colon of a time
        if !name.starts_with(|c: char| c.is_alphabetic() || c == '_') {
            continue;
        }
        let value = text[at..].trim_start();
        // as `IMU: gyro=(0.1, 0.2, 0.3)`
        let is_kind = first && text[mark..].starts_with(':') && names_value(value);
        if is_kind {
            found(KIND, name);
        }
        if std::mem::take(&mut first) {
            // the word before a kind, as a level of logging, is none
            let mut once = |name: &str, value: &str| {
                if !(is_kind && name == KIND) {
                    found(name, value);
                }
            };
            stamped = beginning(&text[..start], &mut once);
        }
        if is_kind {
            continue;
        }
        if let Some((numbers, used)) = several(value).filter(|_| stems.is_empty()) {
            at = text.len() - value.len() + used;
            for (k, number) in numbers.into_iter().enumerate() {
                found(&format!("{name}.{k}"), number);
            }
            continue;
        }
        let end = |c: char| c.is_whitespace() || [',', ';', '}', '|', ')'].contains(&c);
        let value = &value[..value.find(end).unwrap_or(value.len())];
        at = text.len() - text[at..].trim_start().len() + value.len();
        let (name, used) = with_unit(name, &text[at..], end);
        at += used;
        let name = &*name;
        match value.split_once('(') {
            Some((word, inner)) if word.chars().all(named) && !word.is_empty() => {
                stems.push(&text[start..start + name.len()]);
                at -= inner.len();
            }
            _ if stems.is_empty() => found(name, value),
            _ => found(&format!("{}.{name}", stems.join(".")), value),
        }
    }
    let rest = text[at..].trim();
    if !first && !stamped && rest.len() > 8 && rest.bytes().all(|b| b.is_ascii_digit()) {
        found(STAMP, rest);
    }
}

/// Tests whether a text begins with a name and its value, `gyro=0.1`.
fn names_value(text: &str) -> bool {
    let named = |c: char| c.is_alphanumeric() || ['_', '.', '[', ']'].contains(&c);
    let after = text.trim_start_matches(named);
    text.starts_with(char::is_alphabetic) && after.starts_with('=')
}

/// The name of a value with the unit behind it in brackets, `Speed: 54.1 km/h,`, and the length of the unit; the name
/// alone where another word follows.
fn with_unit<'a>(name: &'a str, behind: &str, end: impl Fn(char) -> bool) -> (Cow<'a, str>, usize) {
    let text = behind.trim_start_matches(' ');
    let unit = &text[..text.find(end).unwrap_or(text.len())];
    let after = text[unit.len()..].trim_start();
    let ends = after.is_empty() || after.starts_with([',', ';', '}', '|', ')']);
    let is_unit = ends && unit.starts_with(char::is_alphabetic) && parse_unit(unit).is_ok();
    match is_unit {
        true => (format!("{name} [{unit}]").into(), behind.len() - text.len() + unit.len()),
        false => (name.into(), 0),
    }
}

/// Tests whether a line ends with an object of JSON behind a stamp or a topic, as brokers of messages print them or as the
/// last cell of a table holds it, and reads it.
fn before_object(text: &str, found: &mut impl FnMut(&str, &str)) -> bool {
    let text = text.trim_end();
    let quoted = text.contains("{\"\"").then(|| text.trim_end_matches('"').replace("\"\"", "\""));
    let text = quoted.as_deref().unwrap_or(text);
    let Some((before, _)) = text.split_once("{\"").filter(|_| text.ends_with('}')) else {
        return false;
    };
    let mut words = before.split(['\t', ' ', ',', ';']).filter(|word| !word.is_empty());
    let Some(first) = words.next() else { return false };
    if first.starts_with(|c: char| c.is_ascii_digit()) {
        found(STAMP, first);
        let topic = words.find(|word| word.starts_with(|c: char| c.is_alphabetic() || c == '/'));
        topic.into_iter().for_each(|topic| found(KIND, topic));
    } else {
        found(KIND, first);
    }
    object(&text[before.len()..], |name, value| found(name, value));
    true
}

/// Least number of values of a line whose cells are names and numbers by turns.
const PAIRS: usize = 3;

/// Reads a line whose cells are a name, its number, and perhaps a unit, by turns, as those of Mission Planner and of the tool
/// for FIT files; `false` for another one. The word before the first name is the kind.
fn pairs(text: &str, found: &mut impl FnMut(&str, &str)) -> bool {
    let cells: Vec<&str> = text.split(',').map(|cell| cell.trim().trim_matches('"')).collect();
    let name = |cell: &str| {
        cell.starts_with(|c: char| c.is_ascii_alphabetic())
            && cell.chars().all(|c| c.is_ascii_alphanumeric() || "_.".contains(c))
            && number(cell).is_none()
    };
    let (mut at, mut kind, mut values) = (0, None, Vec::new());
    while at + 1 < cells.len() {
        let (first, second) = (cells[at], cells[at + 1]);
        if name(first) && number(second).is_some() {
            values.push((first, second));
            at += 2;
        } else {
            let before_one = name(first)
                && name(second)
                && cells.get(at + 2).is_some_and(|c| number(c).is_some());
            if before_one && kind.is_none() {
                kind = Some(first);
            }
            at += 1;
        }
    }
    // the descriptions of the messages in a FIT file
    if kind.is_none() || values.len() < PAIRS || cells[0] == "Definition" {
        return false;
    }
    if cells[0].starts_with(|c: char| c.is_ascii_digit()) {
        found(STAMP, cells[0]);
    }
    kind.into_iter().for_each(|kind| found(KIND, kind));
    values.into_iter().for_each(|(name, number)| found(name, number));
    true
}

/// The three or four numbers at the beginning of a text that belong to one name, `gyro: 0.1, 0.2, 0.3`, and their length.
fn several(text: &str) -> Option<(Vec<&str>, usize)> {
    let separator = |c: char| c.is_whitespace() || matches!(c, ',' | ';');
    let end = |c: char| separator(c) || matches!(c, ']' | ')' | '}' | '|');
    let (mut at, mut numbers) = (usize::from(text.starts_with(['[', '('])), Vec::new());
    loop {
        let token = text[at..].trim_start_matches(separator);
        let word = &token[..token.find(end).unwrap_or(token.len())];
        if number(word).is_none() || numbers.len() > 4 {
            break;
        }
        numbers.push(word);
        at = text.len() - token.len() + word.len();
        if text[at..].starts_with([']', ')']) {
            break;
        }
    }
    matches!(numbers.len(), 3 | 4).then_some((numbers, at))
}

/// The stamp and the kind in what precedes the names of a line; `true` if it has a stamp.
fn beginning(text: &str, found: &mut impl FnMut(&str, &str)) -> bool {
    // as `candump` and its decoders write them: `(1700000000.01)  can0  1A0 [8] 01 02 :: Message(`
    let inner = text.trim_start().strip_prefix('(').and_then(|rest| rest.split_once(')'));
    if let Some((stamp, rest)) = inner.filter(|(stamp, _)| number(stamp).is_some()) {
        found(STAMP, stamp);
        let rest = rest.trim_end_matches(['(', ' ', ':']);
        let kind = rest.rsplit([' ', ':']).next().unwrap_or_default();
        if kind.starts_with(char::is_alphabetic) {
            found(KIND, kind);
        }
        return true;
    }
    // as `<NMEA(GNGGA, `
    if let Some((_, kind)) = text.trim_start().strip_prefix('<').and_then(|t| t.split_once('(')) {
        found(KIND, kind.trim_end_matches([',', ' ']));
        return false;
    }
    let text = text.trim_end_matches(['{', '(', ' ', '\t', ',', ';']);
    let cut = text.rfind(char::is_whitespace).map_or(0, |k| k + 1);
    let (stamp, kind) = match text.ends_with(|c: char| c.is_alphabetic()) {
        true => text.split_at(cut),
        false => (text, ""),
    };
    let stamp = stamp.trim().trim_end_matches(':');
    // as `IMU 10 A: 0.1 0.2`
    if let Some((first, rest)) = stamp.split_once(' ')
        && first.starts_with(|c: char| c.is_ascii_alphabetic())
        && number(rest.trim()).is_some()
    {
        found(KIND, first);
        found(STAMP, rest.trim());
        return true;
    }
    // a stamp in brackets, beside the level of a message
    let digit = |part: &&str| part.starts_with(|c: char| c.is_ascii_digit());
    let groups = stamp.split(['[', ']', ',']).map(str::trim);
    let inner = groups.filter(|_| stamp.contains(']')).find(digit);
    let stamp = inner.unwrap_or(stamp);
    if !stamp.is_empty() {
        found(STAMP, stamp);
    }
    if !kind.is_empty() {
        found(KIND, kind);
    }
    !stamp.is_empty()
}

#[cfg(test)]
mod tests {
    use super::line;

    fn values(text: &str) -> Vec<(String, String)> {
        let mut values = Vec::new();
        line(text, |name, value| values.push((name.to_owned(), value.to_owned())));
        values
    }

    #[test]
    fn the_stamp_and_the_kind_are_those_of_the_program_that_printed_the_line() {
        let expected = |pairs: &[(&str, &str)]| -> Vec<(String, String)> {
            pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect()
        };
        let can = "(1700000000.01)  can0  1A0   [8]  80 4A :: IMU(X: 0.1 deg/s, Y: 2 rpm, Z: 3 ok)";
        let can_values = [
            ("stamp", "1700000000.01"),
            ("kind", "IMU"),
            ("X [deg/s]", "0.1"),
            ("Y [rpm]", "2"),
            ("Z", "3"),
        ];
        assert_eq!(values(can), expected(&can_values));
        let nmea = "<NMEA(GNGGA, time=22:13:20, lat=48.1)>";
        assert_eq!(
            values(nmea),
            expected(&[("kind", "GNGGA"), ("time", "22:13:20"), ("lat", "48.1")])
        );
        let turns = "2023-11-14 22:13:20,FE,1B,raw_imu,time,5,x,-1,Len,3";
        let named = [
            ("stamp", "2023-11-14 22:13:20"),
            ("kind", "raw_imu"),
            ("time", "5"),
            ("x", "-1"),
            ("Len", "3"),
        ];
        assert_eq!(values(turns), expected(&named));
        let units = "Data,1,record,timestamp,\"5\",s,lat,\"2\",semicircles,lon,\"3\",semicircles,";
        let named =
            [("kind", "record"), ("Data", "1"), ("timestamp", "5"), ("lat", "2"), ("lon", "3")];
        assert_eq!(values(units), expected(&named));
        let object = "2023-11-14T22:13:20Z\t*\t{\"lat\": 1, \"a\": [2]}";
        let named = [("stamp", "2023-11-14T22:13:20Z"), ("lat", "1"), ("a.0", "2")];
        assert_eq!(values(object), expected(&named));
        assert_eq!(values("1700000000,ACC,0.1,0.2,9.8"), []);
    }
}
