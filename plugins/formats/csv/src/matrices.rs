//! Matrices in a script of MATLAB or Octave, `imu = [ 0.01 0.2 ...; ... ];`, and lists of rows, `[0.01, [0.2, 0.3, 9.8]]`, as
//! Python and pandas write them.

use crate::number::number;
use crate::object::object;
use crate::transposed::{Cells, Group};

/// Least number of rows of a matrix.
const ROWS: usize = 10;
/// Share of the rows at which a column must increase that has the times.
const RISING: f64 = 0.99;

/// A matrix that is read.
struct Matrix {
    name: String,
    /// Names of its columns, where a comment has one for each.
    titles: Vec<String>,
    columns: Vec<Cells>,
    rows: usize,
}

/// The name of a matrix, and what follows its bracket.
fn opens(line: &str) -> Option<(&str, &str)> {
    let (name, rest) = line.split_once('=')?;
    let name = name.trim();
    let letter = |c: char| c.is_ascii_alphanumeric() || ['_', '.'].contains(&c);
    let named = name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(letter);
    let rest = rest.trim_start().strip_prefix('[')?;
    named.then_some((name, rest))
}

/// The numbers of a row, which commas or spaces separate.
fn numbers(row: &str) -> Option<Vec<&str>> {
    let cells: Vec<&str> =
        row.split([' ', ',', '\t']).filter(|cell| !cell.is_empty() && *cell != "...").collect();
    (!cells.is_empty() && cells.iter().all(|cell| number(cell).is_some())).then_some(cells)
}

/// Tests whether a text begins with a matrix of numbers.
pub fn begins(text: &str) -> bool {
    let mut lines =
        text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('%'));
    let Some((_, rest)) = lines.by_ref().take(ROWS * ROWS).find_map(opens) else { return false };
    let rows = std::iter::once(rest).chain(lines).flat_map(|line| line.split(';'));
    let rows = rows.map(|row| row.trim()).filter(|row| !row.is_empty() && *row != "...");
    let rows: Vec<bool> = rows.take(ROWS).map(|row| numbers(row).is_some()).collect();
    // the last one may be cut off
    rows.len() > 2 && rows[..rows.len() - 1].iter().all(|row| *row)
}

impl Matrix {
    fn new(name: &str, comments: &[&str]) -> Self {
        let titles = comments.last().map_or_else(Vec::new, |text| titles(text));
        Self { name: name.to_owned(), titles, columns: Vec::new(), rows: 0 }
    }

    fn add(&mut self, row: &str) {
        let Some(cells) = numbers(row) else { return };
        if self.columns.is_empty() {
            self.columns.resize_with(cells.len(), Cells::default);
        }
        if cells.len() == self.columns.len() {
            self.columns.iter_mut().zip(cells).for_each(|(column, cell)| column.push(cell));
            self.rows += 1;
        }
    }

    /// The name of a column.
    fn title(&self, k: usize) -> String {
        match self.titles.get(k).filter(|_| self.titles.len() == self.columns.len()) {
            Some(title) => format!("{}.{title}", self.name),
            None if self.columns.len() == 1 => self.name.clone(),
            None => format!("{}.{k}", self.name),
        }
    }

    /// Tests whether its first column has the times of the others.
    fn is_whole(&self) -> bool {
        let values: Vec<f64> =
            self.columns[0].all().iter().filter_map(|cell| number(cell)).collect();
        let rising = values.windows(2).filter(|v| v[1] > v[0]).count();
        self.columns.len() > 1 && rising as f64 >= RISING * (values.len() - 1) as f64
    }
}

/// The titles that a comment has, `% t wx wy wz` or `% imu: time [s], gyro x y z [rad/s]`.
fn titles(comment: &str) -> Vec<String> {
    let comment = comment.trim_start_matches(['%', '#', ' ']);
    let comment = comment.rsplit_once(':').map_or(comment, |(_, rest)| rest);
    let comment = comment
        .trim_matches(|c: char| ['[', ']', '(', ')', ' '].contains(&c) && !comment.contains(','));
    let mut titles = Vec::new();
    for group in comment.split(',') {
        let (words, unit) = match group.split_once(['[', '(']) {
            Some((words, unit)) => {
                (words, format!(" [{}]", unit.trim_end_matches([' ', ']', ')'])))
            }
            None => (group, String::new()),
        };
        let words: Vec<&str> = words.split_whitespace().collect();
        match words.as_slice() {
            // one name for three axes
            [name, "x", "y", "z"] => {
                titles.extend(["x", "y", "z"].map(|axis| format!("{name}_{axis}{unit}")));
            }
            words => titles.extend(words.iter().map(|word| format!("{word}{unit}"))),
        }
    }
    titles
}

/// The columns of the matrices, those without times of their own beside others of their length.
pub fn read(text: &str) -> Vec<Group> {
    let (mut matrices, mut comments, mut open) = (Vec::<Matrix>::new(), Vec::new(), false);
    for line in text.lines().map(str::trim) {
        if let Some(comment) = line.strip_prefix(['%', '#']) {
            comments.push(comment);
            continue;
        }
        let mut rest = line;
        if let Some((name, inner)) = opens(line).filter(|_| !open) {
            matrices.push(Matrix::new(name, &comments));
            comments.clear();
            (rest, open) = (inner, true);
        }
        let Some(matrix) = matrices.last_mut().filter(|_| open) else { continue };
        let inner = rest.split(']').next().unwrap_or_default();
        inner.split(';').for_each(|row| matrix.add(row));
        open = inner.len() == rest.len();
    }
    let mut groups: Vec<Group> = Vec::new();
    let mut shared: Vec<(String, Group)> = Vec::new();
    for mut matrix in matrices.into_iter().filter(|m| m.rows > 1) {
        let (whole, rows) = (matrix.is_whole(), matrix.rows);
        let titles: Vec<String> = (0..matrix.columns.len()).map(|k| matrix.title(k)).collect();
        let stem = matrix.name.rsplit_once('.').map_or("", |(stem, _)| stem).to_owned();
        let columns = titles.into_iter().zip(matrix.columns.drain(..));
        if whole {
            groups.push(Group::of(columns, rows));
            continue;
        }
        let same = |(name, group): &&mut (String, Group)| *name == stem && group.rows() == rows;
        match shared.iter_mut().find(same) {
            Some((_, group)) => group.extend(columns),
            None => shared.push((stem, Group::of(columns, rows))),
        }
    }
    groups.extend(shared.into_iter().map(|(_, group)| group));
    groups
}

/// The text of lists of rows as one list; `None` for another text. Brackets of Python are round, too.
fn list(text: &str) -> Option<String> {
    let text = text.trim_start();
    let first = text.strip_prefix(['[', '('])?.trim_start();
    let whole = first.starts_with(['[', '(']);
    let inner = if whole { first.get(1..)?.trim_start() } else { first };
    let cell = inner.split([',', ']', ')']).next()?;
    // a stamp in brackets has no comma behind it
    let fits = number(cell.trim()).is_some() && inner[cell.len()..].starts_with(',');
    let squared = || text.replace('(', "[").replace(')', "]");
    let one = |text: String| if whole { text } else { format!("[{text}]") };
    fits.then(|| one(squared()))
}

/// Tests whether a text begins with lists of numbers.
pub fn lists(text: &str) -> bool {
    let Some(list) = list(text) else { return false };
    // the last row may be cut off
    let numbers = |c: char| c.is_ascii_digit() || "+-.eE, \t\r\n[]".contains(c);
    list.contains("],") && list.chars().all(numbers) || {
        let lines: Vec<&str> = text.lines().collect();
        lines.len() > ROWS
            && lines[..lines.len() - 1].iter().all(|l| l.ends_with([']', ')', ',']))
            && list.chars().all(numbers)
    }
}

/// The columns of lists of rows, by their places.
pub fn read_lists(text: &str) -> Vec<Group> {
    let Some(list) = list(text) else { return Vec::new() };
    let mut columns: Vec<(String, Cells)> = Vec::new();
    let mut rows = 0;
    object(&list, |path, value| {
        let Some((row, column)) = path.split_once('.') else { return };
        let Ok(row) = row.parse::<usize>() else { return };
        let place = columns.iter().position(|(name, _)| name == column);
        let place = place.unwrap_or_else(|| {
            columns.push((column.to_owned(), Cells::default()));
            columns.len() - 1
        });
        let cells = &mut columns[place].1;
        if row == cells.count() {
            cells.push(value);
        }
        rows = row + 1;
    });
    columns.retain(|(_, cells)| cells.count() + 1 >= rows);
    vec![Group::of(columns.into_iter(), rows)]
}
