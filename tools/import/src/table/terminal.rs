//! Tables with the stamp of a terminal program before each line.

use navfuse_csv::{as_cell, stamp};

/// Marks that end a stamp.
const MARKS: [&str; 2] = ["->", "]"];
/// Number of lines that are looked at, and the share of them that must have a stamp.
const LINES: usize = 2000;
const SHARE: f64 = 0.9;
/// Separators behind the stamp, the likeliest first.
const SEPARATORS: [char; 4] = [',', ';', '\t', '|'];

/// The text with the stamps as first cells, and the mark that ends them; `None` for a text without them.
pub fn without_stamps(text: &str) -> Option<(String, &'static str)> {
    let lines = || text.lines().filter(|line| !line.trim().is_empty()).take(LINES);
    let stamped = |line: &str, mark: &str| {
        let found = stamp(line, mark);
        found.is_some_and(|(stamp, rest)| {
            let clock =
                stamp.matches(':').count() == 2 && stamp.starts_with(|c: char| c.is_ascii_digit());
            clock && !rest.is_empty()
        })
    };
    let most = |mark: &&&str| {
        let count = lines().filter(|line| stamped(line, mark)).count();
        count > 2 && count as f64 > SHARE * lines().count() as f64
    };
    let mark = *MARKS.iter().find(most)?;
    let rest = || lines().filter_map(|line| Some(stamp(line, mark)?.1));
    let often = |c: &char| rest().filter(|rest| rest.contains(*c)).count() * 2 > lines().count();
    let separator = SEPARATORS.into_iter().find(often).unwrap_or(' ');
    let cell = |line: &str| as_cell(line, mark, separator).unwrap_or_else(|| line.to_owned());
    Some((text.split('\n').map(cell).collect::<Vec<_>>().join("\n"), mark))
}
