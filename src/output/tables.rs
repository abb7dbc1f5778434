//! Lines and tables on the terminal.

use super::terminal::{Detail, Stream, Tone, wrapped};
use crate::error::{CommandError, Result};
use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, Row, Width, presets,
};
use std::fmt::{self, Write as _};
use std::io::{self, ErrorKind, Write};
use std::sync::OnceLock;

/// Width beyond which the cells of a column are texts, which may be broken at their spaces.
/// Narrower cells are numbers and names, which are never broken.
const TEXT: u16 = 20;
/// Smallest width of a column of texts.
const NARROWEST: u16 = 14;
/// Length of a word in a text up to which the column has room for it, where the table allows it.
const WORD: u16 = 32;

/// The first error of standard output.
static FAILED: OnceLock<io::Error> = OnceLock::new();

/// Prints a line on standard output; [`check_standard_output`] reports a failure. On a terminal, a
/// longer line than it has columns is broken at spaces; JSON is not.
pub fn line(text: impl fmt::Display) {
    marked_line(text, &[]);
}

/// Prints a line on standard output, with the first occurrence of some words in the colours of
/// their tones.
pub fn marked_line(text: impl fmt::Display, marks: &[(&str, Tone)]) {
    print(&fitted(&text.to_string(), Stream::Output, marks));
}

/// Prints a table on standard output, with every occurrence of some words in the colours of their
/// tones.
pub fn marked_table(table: &Table, marks: &[(&str, Tone)]) {
    let mut text = harmless(&table.to_string());
    for (word, tone) in marks {
        text = text.replace(word, &tone.paint(word, Stream::Output));
    }
    print(&text);
}

fn print(text: &str) {
    if let Err(error) = writeln!(io::stdout(), "{text}") {
        FAILED.set(error).ok();
    }
}

/// Prints a line beside the results, such as an explanation, unless results alone are printed.
pub fn aside(text: impl fmt::Display) {
    if !Detail::is_quiet() {
        line(text);
    }
}

/// Prints a line on standard error; a warning or a note only if more than results is printed. A
/// closed standard error causes no error.
pub fn warn(text: impl fmt::Display) {
    let marks = [("error:", Tone::Bad), ("warning:", Tone::Doubtful)];
    let text = text.to_string();
    if Detail::is_quiet() && ["warning:", "note:"].iter().any(|word| text.starts_with(word)) {
        return;
    }
    // only the word at the start is a level
    let mark = marks.iter().filter(|(word, _)| text.starts_with(word));
    let mark: Vec<(&str, Tone)> = mark.copied().collect();
    writeln!(io::stderr(), "{}", fitted(&text, Stream::Error, &mark)).ok();
}

/// Prints an error on standard error, and the line of the file with the mistake, whose columns have
/// to stay in line.
pub fn mistake(error: &CommandError) {
    warn(format_args!("error: {error}"));
    if let Some(excerpt) = error.excerpt() {
        writeln!(io::stderr(), "{}", harmless(&excerpt.to_string())).ok();
    }
}

/// Prints a text on standard output as it is, such as a script.
pub fn raw(text: &str) {
    if let Err(error) = io::stdout().write_all(text.as_bytes()) {
        FAILED.set(error).ok();
    }
}

/// The text as the stream shows it: harmless, fitted to its width, with colours.
fn fitted(text: &str, stream: Stream, marks: &[(&str, Tone)]) -> String {
    let mut text = harmless(text);
    let json = text.starts_with('{') || text.starts_with("[{");
    if let Some(width) = stream.width().filter(|_| !json) {
        text = wrapped(&text, width);
    }
    for (word, tone) in marks {
        text = text.replacen(word, &tone.paint(word, stream), 1);
    }
    text
}

/// Reports that a line could not be printed. A reader that closes its end early causes no error.
pub fn check_standard_output() -> Result<()> {
    let flushed = io::stdout().flush();
    match flushed.as_ref().err().or(FAILED.get()) {
        Some(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(CommandError::StandardOutput(e.to_string()))
        }
        _ => Ok(()),
    }
}

/// The text without the characters that control a terminal, which a file could have brought in: an
/// escape sequence, or a change of the direction of writing, is shown as `\u001b`. JSON keeps its
/// meaning.
fn harmless(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        let directs = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        if directs || (c.is_control() && c != '\n') {
            // writing into a string cannot fail
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    out
}

/// Width of a table in a file or a pipe, if nothing gives another, columns.
const PAGE: usize = 120;

/// A table that fits itself to the terminal when it is printed.
pub struct Table {
    headings: Vec<String>,
    table: comfy_table::Table,
    /// The columns of numbers.
    numbers: Vec<usize>,
}

/// An empty table with headings.
pub fn table(headings: &[&str]) -> Table {
    let mut table = comfy_table::Table::new();
    let line = LineStyle::none().fill('─').junction('─');
    table.load_style(presets::NOTHING.top_border(line).header_separator(line).bottom_border(line));
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_header(headings.to_vec());
    Table {
        headings: headings.iter().map(|h| (*h).to_owned()).collect(),
        table,
        numbers: Vec::new(),
    }
}

/// Aligns columns of numbers.
pub fn right(table: &mut Table, columns: std::ops::Range<usize>) {
    table.numbers.extend(columns.clone());
    for column in columns {
        if let Some(column) = table.table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

impl Table {
    /// Adds a row.
    pub fn add_row(&mut self, row: impl Into<Row>) {
        self.table.add_row(row);
    }

    /// The table as lines of at most `width` columns. Numbers that have no room beside one another are in
    /// further tables, whose rows begin with the same names.
    fn lines(&self, width: usize) -> Vec<String> {
        let names = self.numbers.iter().copied().min().unwrap_or(1).max(1);
        let (whole, fits) = self.drawn(names, width);
        if fits || self.headings.len() <= names + 1 {
            return whole;
        }
        let mut all = Vec::new();
        let mut begin = names;
        while begin < self.headings.len() {
            // as many columns as fit beside the names, and at least one
            let ends = (begin + 2..=self.headings.len()).rev();
            let parts = ends.map(|end| (end, self.part(names, begin..end).drawn(names, width)));
            let mut fitting = parts.filter(|(_, (_, fits))| *fits);
            let (end, (lines, _)) = fitting.next().unwrap_or_else(|| {
                (begin + 1, self.part(names, begin..begin + 1).drawn(names, width))
            });
            all.extend(lines);
            begin = end;
        }
        all
    }

    /// The table as lines, and `true` if no line is wider and no name is broken inside of a word.
    fn drawn(&self, names: usize, width: usize) -> (Vec<String>, bool) {
        // the space behind the last column could reach beyond the edge
        let drawn = self.within(width);
        let lines: Vec<String> = drawn.lines().map(|line| line.trim_end().to_owned()).collect();
        let text = lines.join("\n");
        let mut cells = self.table.row_iter().flat_map(|row| row.cell_iter().take(names));
        let named =
            cells.all(|cell| cell.content().split_whitespace().all(|word| text.contains(word)));
        let fits = named && lines.iter().all(|line| line.chars().count() <= width);
        (lines, fits)
    }

    /// A table of the names and of some other columns, without the rows that are empty there.
    fn part(&self, names: usize, columns: std::ops::Range<usize>) -> Self {
        let of = |k: &usize| *k < names || columns.contains(k);
        let chosen: Vec<usize> = (0..self.headings.len()).filter(of).collect();
        let headings: Vec<&str> = chosen.iter().map(|k| self.headings[*k].as_str()).collect();
        let mut part = table(&headings);
        for row in self.table.row_iter() {
            let cells: Vec<String> = row.cell_iter().map(|cell| cell.content()).collect();
            let cell = |k: &usize| cells.get(*k).cloned().unwrap_or_default();
            if columns.clone().any(|k| !cell(&k).is_empty()) {
                part.add_row(chosen.iter().map(cell).collect::<Vec<_>>());
            }
        }
        for (place, _) in chosen.iter().enumerate().filter(|(_, k)| self.numbers.contains(k)) {
            right(&mut part, place..place + 1);
        }
        part
    }

    /// The table in at most `width` columns, if its numbers and names have room in them: columns
    /// stand closer, texts and headings are broken.
    fn within(&self, width: usize) -> comfy_table::Table {
        let mut table = self.table.clone();
        let contents = table.column_max_content_widths();
        let separators = contents.len().saturating_sub(1);
        let content = |widths: &[u16]| widths.iter().map(|w| usize::from(*w)).sum::<usize>();
        if content(&contents) + 2 * contents.len() + separators <= width {
            return table;
        }
        let is_text = |k: usize| contents.get(k).is_some_and(|content| *content > TEXT);
        let broken = |(k, heading): (usize, &String)| match is_text(k) {
            true => heading.clone(),
            false => heading.replace(' ', "\n").replace('/', "/\n"),
        };
        let least = |table: &comfy_table::Table| {
            let widths = table.column_max_content_widths().into_iter().enumerate();
            content(
                &widths.map(|(k, w)| if is_text(k) { NARROWEST } else { w }).collect::<Vec<_>>(),
            )
        };
        if least(&table) + contents.len() + separators > width {
            table.set_header(self.headings.iter().enumerate().map(broken).collect::<Vec<_>>());
        }
        let words = longest_words(&table, contents.len());
        let widths = table.column_max_content_widths().into_iter().zip(words).enumerate();
        let bound = |(k, (width, word)): (usize, (u16, u16))| match is_text(k) {
            true => word.clamp(NARROWEST, WORD),
            false => width,
        };
        let bounds: Vec<u16> = widths.map(bound).collect();
        // names that leave no room for the rest are broken
        let whole = content(&bounds) + separators <= width;
        let needed = if whole { content(&bounds) } else { least(&table) };
        let space = u16::from(needed + contents.len() + separators <= width);
        for ((k, column), bound) in table.column_iter_mut().enumerate().zip(bounds) {
            column.set_padding((0, space)).set_constraint(if is_text(k) {
                let bound = if whole { bound } else { NARROWEST };
                ColumnConstraint::LowerBoundary(Width::Fixed(bound))
            } else {
                ColumnConstraint::ContentWidth
            });
        }
        table.set_width(u16::try_from(width).unwrap_or(u16::MAX));
        table
    }
}

/// The longest word of each column.
fn longest_words(table: &comfy_table::Table, columns: usize) -> Vec<u16> {
    let mut longest = vec![0; columns];
    for row in table.row_iter() {
        for (most, cell) in longest.iter_mut().zip(row.cell_iter()) {
            let content = cell.content();
            let words = content.split_whitespace().map(|w| w.chars().count());
            *most = words.fold(*most, |a, b| a.max(u16::try_from(b).unwrap_or(u16::MAX)));
        }
    }
    longest
}

/// The cells of a row in a line.
fn in_line(row: &Row) -> String {
    let cells: Vec<String> = row.cell_iter().map(|c| c.content().replace('\n', " ")).collect();
    cells.join("  ").trim_end().to_owned()
}

/// A table, or its rows alone where results are printed without tables.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = if Detail::is_quiet() {
            self.table.row_iter().map(in_line).collect()
        } else {
            self.lines(Stream::Output.width().unwrap_or(PAGE))
        };
        f.write_str(&lines.join("\n"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table of 14 + 2 * 20 + 10 columns and what is between them has no room in 60 columns, or in 40.
    #[test]
    fn numbers_without_room_are_in_a_further_table_with_the_same_names() {
        let mut rows = table(&["method", "k", "roll", "settles"]);
        let (k, roll) = ("0.99916 ± 0.00055000", "-0.0860000 ± 0.09900");
        rows.add_row(["io-dvlc-single", k, roll, "1234567 s"]);
        rows.add_row(["  error", "-0.00064", "+0.014", ""]);
        right(&mut rows, 1..4);
        for (width, tables) in [(40, 3), (60, 2), (80, 1)] {
            let lines = rows.lines(width);
            assert!(lines.iter().all(|line| line.chars().count() <= width), "{lines:#?}");
            let text = lines.join("\n");
            let words = ["io-dvlc-single", k, roll, "1234567 s", "+0.014"];
            assert!(words.iter().all(|word| text.contains(word)), "{text}");
            assert_eq!(text.matches("method").count(), tables, "{text}");
        }
        // the row of the errors has no time
        let narrow = rows.lines(60);
        assert_eq!(narrow.iter().filter(|line| line.contains("error")).count(), 1, "{narrow:#?}");
    }
}
