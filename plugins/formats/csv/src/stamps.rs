//! Stamps that a terminal program writes before each line: `22:13:20.010 -> 0.1,0.2` of the Arduino IDE, and
//! `[2023-11-14 22:13:20.010] 0.1,0.2`.

/// The stamp and the rest of a line; `None` for a line without the mark that ends the stamp.
#[must_use]
pub fn stamp<'a>(line: &'a str, mark: &str) -> Option<(&'a str, &'a str)> {
    let (stamp, rest) = line.split_once(mark)?;
    Some((stamp.trim_start_matches('[').trim(), rest.trim_start()))
}

/// A line whose stamp is its first cell; a date and its time become one word.
#[must_use]
pub fn as_cell(line: &str, mark: &str, delimiter: char) -> Option<String> {
    let (stamp, rest) = stamp(line, mark)?;
    Some(format!("{}{delimiter}{rest}", stamp.replacen(' ', "T", 1)))
}

#[cfg(test)]
mod tests {
    use crate::lines::{Change, Lines};
    use std::io::Read;

    #[test]
    fn the_stamp_of_a_terminal_is_the_first_cell_of_its_line() {
        let text = "Opening port\n22:13:20.010 -> 0.1,-0.2\r\n[2023-11-14 22:13:20.020] 0.3,0.4";
        let read = |mark: &str| {
            let mut rows = String::new();
            let change = Change::Stamp(mark.to_owned(), ',');
            let done = Lines::new(text.as_bytes(), change).read_to_string(&mut rows);
            assert!(done.is_ok());
            rows
        };
        assert!(read("->").contains("\n22:13:20.010,0.1,-0.2\r\n["));
        assert!(read("]").ends_with("\n2023-11-14T22:13:20.020,0.3,0.4"));
    }
}
