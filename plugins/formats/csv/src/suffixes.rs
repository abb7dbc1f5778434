//! Units after the numbers of the cells, as `0.010 sec`.

use csv::ByteRecord;

/// The number at the beginning of a cell and the one word after it, which may follow a space; `None` for a cell without.
#[must_use]
pub fn with_unit(cell: &str) -> Option<(&str, &str)> {
    let (number, unit) = cell.split_once(' ').or_else(|| glued(cell))?;
    let unit = unit.trim();
    // single capitals are sides of the Earth
    let side = ["N", "S", "E", "W"].contains(&unit);
    let text = unit.starts_with(|c: char| c.is_alphabetic() || c == '°') && !unit.contains(' ');
    let fits = text && !side && number.parse::<f64>().is_ok_and(f64::is_finite);
    fits.then_some((number, unit))
}

/// A number with a unit right behind it, `9.81m/s2`. Digits and the letters to F alone may be a number of another base.
fn glued(cell: &str) -> Option<(&str, &str)> {
    let exponent = |at: usize, c: char| {
        let behind =
            || cell[at + 1..].starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '+');
        matches!(c, 'e' | 'E') && behind()
    };
    let mut ends = cell.char_indices().filter(|(_, c)| c.is_alphabetic() || *c == '°');
    let (at, _) = ends.find(|(at, c)| !exponent(*at, *c))?;
    let (number, unit) = cell.split_at(at);
    let base = !number.contains('.') && unit.chars().all(|c| c.is_ascii_hexdigit());
    let begins = number.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    (begins && !base && crate::number::number(cell).is_none()).then_some((number, unit))
}

/// The texts after the numbers of each column.
pub struct Suffixes {
    known: Vec<String>,
    /// The text of each column so far.
    columns: Vec<Option<String>>,
}

impl Suffixes {
    pub fn new(known: &[String]) -> Self {
        Self { known: known.to_vec(), columns: Vec::new() }
    }

    /// Removes the known texts from the cells of a row. A cell whose text is another one than that of its column before
    /// stays as it is, and is no number.
    pub fn remove(&mut self, record: &mut ByteRecord) {
        if self.known.is_empty() {
            return;
        }
        self.columns.resize(self.columns.len().max(record.len()), None);
        let plain = |(cell, column): (&[u8], &mut Option<String>)| -> Vec<u8> {
            let text = crate::text::text(cell.trim_ascii());
            let parts = with_unit(&text).filter(|(_, unit)| self.known.iter().any(|k| k == unit));
            match parts {
                Some((number, unit)) if column.get_or_insert_with(|| unit.to_owned()) == unit => {
                    number.as_bytes().to_vec()
                }
                _ => cell.to_vec(),
            }
        };
        *record = record.iter().zip(&mut self.columns).map(plain).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_after_a_number_is_removed_unless_it_changes_within_a_column() {
        let mut suffixes = Suffixes::new(&["sec".to_owned(), "ms".to_owned(), "deg/s".to_owned()]);
        let mut row = |cells: &[&str]| {
            let mut record = ByteRecord::from(cells.to_vec());
            suffixes.remove(&mut record);
            record.iter().map(|c| String::from_utf8_lossy(c).into_owned()).collect::<Vec<_>>()
        };
        assert_eq!(row(&["0.01 sec", "1e-3 deg/s", "5", "2 V"]), ["0.01", "1e-3", "5", "2 V"]);
        assert_eq!(row(&["20 ms", "-2 deg/s", "57.1 N"]), ["20 ms", "-2", "57.1 N"]);
        for (cell, parts) in [
            ("9.81m/s2", ("9.81", "m/s2")),
            ("-1.5e-3rad/s", ("-1.5e-3", "rad/s")),
            ("48.1°", ("48.1", "°")),
            ("12deg", ("12", "deg")),
        ] {
            assert_eq!(with_unit(cell), Some(parts));
        }
        for cell in
            ["1.0D+03", "48.1S", "1A", "2e5", "x1m", "22:13:20Z", "2023-11-14T22:13:20Z", "m"]
        {
            assert_eq!(with_unit(cell), None, "{cell}");
        }
        assert_eq!(with_unit("57.1 / 11.9"), None);
        assert_eq!(with_unit("57.1 S 11.9 W"), None);
    }
}
