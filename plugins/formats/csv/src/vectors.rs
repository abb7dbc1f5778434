//! Cells with several numbers, as `[0.1, 0.2, 9.8]` or `Vector3D(x=0.1, y=0.2, z=9.8)`, in columns of their own.

use csv::ByteRecord;
use std::collections::BTreeMap;

/// Longest text.
const LONGEST: usize = 256;

/// The numbers of a cell with several of them: between brackets, behind names, or between commas and semicolons;
/// empty for any other cell.
#[must_use]
pub fn vector(cell: &str) -> Vec<&str> {
    let (mut numbers, mut apart, mut named, mut depth) = (Vec::new(), false, false, 0_usize);
    let mut rest = cell.trim();
    if rest.len() > LONGEST {
        return numbers;
    }
    while let Some(c) = rest.chars().next() {
        let begins = c.is_ascii_digit() || matches!(c, '-' | '+' | '.');
        let length = if begins {
            let inside = |c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.' | 'e' | 'E');
            let length = rest.find(|c| !inside(c)).unwrap_or(rest.len());
            if rest[..length].parse::<f64>().is_err() {
                return Vec::new();
            }
            numbers.push(&rest[..length]);
            length
        } else if c.is_alphabetic() {
            // a name before a bracket or before its value
            let length = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
            let length = length.unwrap_or(rest.len());
            if !rest[length..].trim_start().starts_with(['(', '=', ':', '[']) {
                return Vec::new();
            }
            (named, apart) = (true, true);
            length
        } else {
            match c {
                '(' | '[' | '{' => (depth, apart) = (depth + 1, true),
                ')' | ']' | '}' if depth > 0 => depth -= 1,
                ',' | ';' => apart = true,
                // between digits it is the colon of a time
                '=' | ':' if named => {}
                _ if c.is_whitespace() => {}
                _ => return Vec::new(),
            }
            c.len_utf8()
        };
        named &= !begins;
        rest = &rest[length..];
    }
    // spaces alone separate degrees, minutes and seconds, too
    if numbers.len() > 1 && apart && depth == 0 { numbers } else { Vec::new() }
}

/// The headings of a table whose columns with several numbers have a heading for each: `accel.0` to `accel.2`.
pub fn spread(headings: Vec<String>, vectors: &BTreeMap<String, u8>) -> Vec<String> {
    let each = |heading: String| match vectors.get(&heading) {
        Some(count) => (0..*count).map(|k| format!("{heading}.{k}")).collect(),
        None => vec![heading],
    };
    headings.into_iter().flat_map(each).collect()
}

/// The columns with several numbers in each cell.
pub struct Vectors(Vec<(usize, usize)>);

impl Vectors {
    /// Finds the columns by the headings of the file.
    pub fn new(headings: &[String], vectors: &BTreeMap<String, u8>) -> Self {
        let column =
            |(k, heading): (usize, &String)| Some((k, usize::from(*vectors.get(heading)?)));
        Self(headings.iter().enumerate().filter_map(column).collect())
    }

    /// Puts each number of these cells into a cell of its own; another number of them leaves empty cells.
    pub fn spread(&self, record: &mut ByteRecord) {
        if self.0.is_empty() {
            return;
        }
        let mut cells = ByteRecord::new();
        for (k, cell) in record.iter().enumerate() {
            let Some((_, count)) = self.0.iter().find(|(column, _)| *column == k) else {
                cells.push_field(cell);
                continue;
            };
            let text = crate::text::text(cell.trim_ascii());
            let numbers = vector(&text);
            let fits = numbers.len() == *count;
            (0..*count)
                .for_each(|k| cells.push_field(if fits { numbers[k].as_bytes() } else { b"" }));
        }
        *record = cells;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_names_and_spaces_are_beside_the_numbers_of_a_vector() {
        for cell in [
            "[0.1, -2e-3, 9.8]",
            "(0.1,-2e-3,9.8)",
            "[0.1 -2e-3  9.8]",
            "0.1;-2e-3;9.8",
            "Vector3D(x=0.1, y=-2e-3, z=9.8)",
            "{x: 0.1, y: -2e-3, z: 9.8}",
        ] {
            assert_eq!(vector(cell), ["0.1", "-2e-3", "9.8"], "{cell}");
        }
        for cell in [
            "9.8",
            "2023-11-14 22:13:20",
            "57.1 N 11.9 E",
            "22:13:20.5",
            "48 06 00.1",
            "0.1 m 0.2 m",
            "a, b",
            "(1, 2",
            "",
        ] {
            assert!(vector(cell).is_empty(), "{cell}");
        }
    }

    #[test]
    fn a_cell_with_another_number_of_numbers_is_empty() {
        let vectors = BTreeMap::from([("a".to_owned(), 3)]);
        let headings = ["t", "a"].map(str::to_owned);
        let columns = Vectors::new(&headings, &vectors);
        assert_eq!(spread(headings.to_vec(), &vectors), ["t", "a.0", "a.1", "a.2"]);
        let row = |cells: [&str; 2]| {
            let mut record = ByteRecord::from(cells.to_vec());
            columns.spread(&mut record);
            record.iter().map(|c| String::from_utf8_lossy(c).into_owned()).collect::<Vec<_>>()
        };
        assert_eq!(row(["5", "[1, 2, 3]"]), ["5", "1", "2", "3"]);
        assert_eq!(row(["5", "[1, 2]"]), ["5", "", "", ""]);
    }
}
