//! Units after the numbers of the cells, as `0.010 sec`.

use csv::ByteRecord;

/// The number at the beginning of a cell and the one word after a space; `None` for a cell without.
#[must_use]
pub fn with_unit(cell: &str) -> Option<(&str, &str)> {
    let (number, unit) = cell.split_once(' ')?;
    let unit = unit.trim();
    // single capitals are sides of the Earth
    let side = ["N", "S", "E", "W"].contains(&unit);
    let text = unit.starts_with(|c: char| c.is_alphabetic() || c == '°') && !unit.contains(' ');
    let fits = text && !side && number.parse::<f64>().is_ok_and(f64::is_finite);
    fits.then_some((number, unit))
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
        assert_eq!(with_unit("57.1 / 11.9"), None);
        assert_eq!(with_unit("57.1 S 11.9 W"), None);
    }
}
