//! Tables of which a sensor needs several, one beside another by their times: a file for each channel, as recorders and
//! databases export them, and gravity beside accelerations without it.

use crate::number::{is_absent, number};
use crate::pivot::{VALUES, cells, point, separator, word};
use crate::series::{Named, TIMES, groups, seconds};
use crate::transposed::Group;

/// Lines within which the first row stands.
const HEAD: usize = 50;

/// A table: the separator and the titles of its columns, which are empty without a line of them, and the place of its time.
struct Table {
    separator: Option<char>,
    titles: Vec<String>,
    time: usize,
    width: usize,
}

/// Tests whether cells are those of a row: numbers, and the text of a time.
fn is_row(cells: &[&str]) -> bool {
    let read = |cell: &str| number(&cell.replace(',', ".")).is_some();
    let fits = |cell: &&str| cell.is_empty() || read(cell) || is_absent(cell);
    cells.len() > 1
        && cells.iter().any(|cell| read(cell))
        && cells.iter().filter(|cell| !fits(cell)).all(|cell| seconds(cell).is_some())
}

fn lines(text: &str) -> impl Iterator<Item = &str> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    text.lines().map(str::trim).filter(|line| !line.is_empty())
}

impl Table {
    fn of(text: &str) -> Option<Self> {
        let head: Vec<&str> = lines(text).take(HEAD).collect();
        let row = |line: &&str| is_row(&cells(line, separator(line)));
        let first = head.iter().position(row)?;
        let separator = separator(head[first]);
        let width = cells(head[first], separator).len();
        let titles = |line: &&str| {
            let line = line.trim_start_matches(['#', '%', '/', ' ']);
            let titles = cells(line, separator);
            (titles.len() == width).then(|| titles.into_iter().map(str::to_owned).collect())
        };
        let titles: Vec<String> = head[..first].iter().rev().find_map(titles).unwrap_or_default();
        let time = titles.iter().position(|title| TIMES.contains(&word(title).as_str()));
        Some(Self { separator, titles, time: time.unwrap_or(0), width })
    }

    /// The title of the only column beside the time, where it names the value.
    fn alone(&self) -> Option<&str> {
        let title = self.titles.get(1 - self.time.min(1)).map(String::as_str)?;
        let named = !word(title).is_empty() && !VALUES.contains(&word(title).as_str());
        (self.width == 2 && named).then_some(title)
    }
}

/// Tests whether a text is a table of a time and one value.
#[must_use]
pub fn has_one_value(text: &str) -> bool {
    Table::of(text).is_some_and(|table| table.width == 2)
}

/// The unit of a title, in its brackets.
fn unit(title: &str) -> String {
    title.find(['[', '(']).map_or_else(String::new, |at| format!(" {}", &title[at..]))
}

/// The columns of tables with the names of their files. The title of a column that stands alone is its name, if no other
/// file has the same; else the file names it.
pub fn read(files: &[(String, String)]) -> Vec<Group> {
    let tables: Vec<Option<Table>> = files.iter().map(|(_, text)| Table::of(text)).collect();
    let alone: Vec<Option<&str>> =
        tables.iter().map(|t| t.as_ref().and_then(Table::alone)).collect();
    let mut named = Named::default();
    let mut time = None;
    for (k, (table, (stem, text))) in tables.iter().zip(files).enumerate() {
        let Some(table) = table else { continue };
        let own =
            alone[k].filter(|own| alone.iter().filter(|other| *other == &Some(*own)).count() == 1);
        let title = |column: usize| table.titles.get(column).map_or("", String::as_str);
        let name = |column: usize| match own {
            Some(own) => own.to_owned(),
            None if table.width == 2 => stem.clone() + &unit(title(column)),
            None if title(column).is_empty() => format!("{stem}.{column}"),
            None => format!("{stem}.{}", title(column)),
        };
        let names: Vec<String> = (0..table.width).map(name).collect();
        time = time.or_else(|| table.titles.get(table.time));
        for line in lines(text) {
            let cells = cells(line, table.separator);
            if cells.len() != table.width {
                continue;
            }
            for (column, cell) in cells.iter().enumerate().filter(|(c, _)| *c != table.time) {
                let cell = point(cell, table.separator);
                named.push(&names[column], &point(cells[table.time], table.separator), &cell);
            }
        }
    }
    groups(named.series, time.map_or("time", String::as_str))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transposed::Columns;

    fn rows(files: &[(&str, String)]) -> String {
        let files: Vec<(String, String)> =
            files.iter().map(|(stem, text)| ((*stem).to_owned(), text.clone())).collect();
        let mut columns = Columns::new(read(&files));
        let mut rows = String::new();
        while columns.advance() {
            columns.values(|name, cell| rows += &format!("{name}={cell};"));
            rows.push('\n');
        }
        rows
    }

    #[test]
    fn a_file_for_each_channel_is_a_column_by_its_title_or_its_name() {
        let file = |head: &str, value: fn(usize) -> f64| {
            head.to_owned() + &(0..4).map(|k| format!("0.{k};{}\n", value(k))).collect::<String>()
        };
        let [x, y] =
            [file("t;value [deg/s]\n", |k| k as f64), file("# t;wy\n", |k| 0.5 * k as f64)];
        assert!(has_one_value(&x) && !has_one_value("t,a,b\n1,2,3\n") && !has_one_value("a\nb\n"));
        let own = rows(&[("gyro_x", x.clone()), ("b", y.replace('.', ","))]);
        assert!(
            own.starts_with("t=0.0;gyro_x [deg/s]=0;wy=0;\nt=0.1;gyro_x [deg/s]=1;wy=0.5;\n"),
            "{own}"
        );
        let named = rows(&[("a", y.clone()), ("b", y), ("c", "1;2\n2;3\n".to_owned())]);
        assert!(
            named.contains("t=0.1;a=0.5;b=0.5;\n") && named.ends_with("t=1;c=2;\nt=2;c=3;\n"),
            "{named}"
        );
    }

    #[test]
    fn tables_with_several_columns_are_named_by_their_files_too() {
        let table = |scale: f64| {
            let row = |k: usize| format!("2023-11-14 22:13:20.{k:02},{},2\n", scale * k as f64);
            "time,z,x\n".to_owned() + &(0..9).map(row).collect::<String>()
        };
        let text = rows(&[("Acc", table(1.0)), ("Gravity", table(9.0))]);
        let second = "time=2023-11-14 22:13:20.01;Acc.z=1;Acc.x=2;Gravity.z=9;Gravity.x=2;\n";
        assert!(text.contains(second), "{text}");
    }
}
