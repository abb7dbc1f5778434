//! Lines and tables on the terminal.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, presets};
use std::io::Write;

/// Prints a line on standard output. A reader that closes it early causes no error.
pub fn line(text: impl std::fmt::Display) {
    writeln!(std::io::stdout(), "{text}").ok();
}

/// Prints a line on standard error. A closed standard error causes no error.
pub fn warn(text: impl std::fmt::Display) {
    writeln!(std::io::stderr(), "{text}").ok();
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
