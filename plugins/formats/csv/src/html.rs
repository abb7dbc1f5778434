//! Tables of a page of HTML: the first row of each has the titles.

use crate::transposed::{Cells, Group};

/// Tests whether a text begins as a page with a table.
pub fn begins(text: &str) -> bool {
    let has = |tag: &str| text.contains(tag) || text.contains(&tag.to_uppercase());
    text.trim_start().starts_with('<') && has("<table") && has("<tr")
}

/// A table that is read.
#[derive(Default)]
struct Table {
    columns: Vec<(String, Cells)>,
    row: Vec<String>,
    rows: usize,
}

impl Table {
    fn end_row(&mut self) {
        let row = std::mem::take(&mut self.row);
        if self.columns.is_empty() {
            let titled = row.into_iter().enumerate();
            let title =
                |(k, name): (usize, String)| if name.is_empty() { format!("{k}") } else { name };
            self.columns = titled.map(|cell| (title(cell), Cells::default())).collect();
        } else if row.len() == self.columns.len() {
            self.columns.iter_mut().zip(&row).for_each(|((_, cells), cell)| cells.push(cell));
            self.rows += 1;
        }
    }
}

/// The columns of each table.
pub fn read(text: &str) -> Vec<Group> {
    let (mut tables, mut within) = (Vec::<Table>::new(), false);
    for piece in text.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').unwrap_or((piece, ""));
        let name = tag.split(char::is_whitespace).next().unwrap_or_default().to_ascii_lowercase();
        if name == "table" {
            tables.push(Table::default());
        }
        let Some(table) = tables.last_mut() else { continue };
        match name.as_str() {
            "tr" => table.row.clear(),
            "/tr" => table.end_row(),
            "td" | "th" => {
                within = true;
                table.row.push(String::new());
            }
            "/td" | "/th" => within = false,
            _ => {}
        }
        if let Some(cell) = table.row.last_mut().filter(|_| within) {
            cell.push_str(text.trim());
        }
    }
    let filled = tables.into_iter().filter(|table| table.rows > 1);
    filled.map(|table| Group::of(table.columns.into_iter(), table.rows)).collect()
}
