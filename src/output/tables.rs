//! Lines and tables on the terminal.

use crate::error::{CommandError, Result};
use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, presets};
use std::fmt::Write as _;
use std::io::{self, ErrorKind, Write};
use std::sync::OnceLock;

/// The first error of standard output.
static FAILED: OnceLock<io::Error> = OnceLock::new();

/// Prints a line on standard output; [`check_standard_output`] reports a failure.
pub fn line(text: impl std::fmt::Display) {
    if let Err(error) = writeln!(io::stdout(), "{}", harmless(&text.to_string())) {
        FAILED.set(error).ok();
    }
}

/// Prints a line on standard error. A closed standard error causes no error.
pub fn warn(text: impl std::fmt::Display) {
    writeln!(io::stderr(), "{}", harmless(&text.to_string())).ok();
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

/// An empty table with headings.
pub fn table(headings: &[&str]) -> Table {
    let mut table = Table::new();
    let line = LineStyle::none().fill('─').junction('─');
    table.load_style(presets::NOTHING.top_border(line).header_separator(line).bottom_border(line));
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_header(headings.to_vec());
    table
}

/// Aligns columns of numbers.
pub fn right(table: &mut Table, columns: std::ops::Range<usize>) {
    for column in columns {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}
