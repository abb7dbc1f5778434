//! The rows of a table of an SQLite database, in the order of their numbers.
//!
//! The format is that of <https://www.sqlite.org/fileformat2.html>: a tree of pages, whose leaves
//! hold the rows, with the rest of a long row in a chain of pages. A page that is damaged or
//! missing costs the rows in it.

use super::faults::Faults;
use super::pages::Pages;
use navfuse_frames::mcap::LONGEST;
use std::io::Result;

/// Depth beyond which a tree is damaged: each inner page has at least two children.
const DEEPEST: usize = 32;
/// Number of the columns that are looked at.
const COLUMNS: usize = 16;

/// A value in a row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Value {
    /// Null or a real number, of which a bag has none.
    #[default]
    Other,
    Integer(i64),
    /// A text or blob, as its place in the row.
    Bytes(usize, usize),
}

/// A row: its number, its values, and its bytes as far as they were read.
#[derive(Debug, Default)]
pub struct Row {
    pub number: i64,
    pub values: Vec<Value>,
    pub bytes: Vec<u8>,
    /// Page and length of the rest that was not read yet.
    rest: Option<(u32, usize)>,
    /// Offset of the row in the file.
    pub offset: u64,
}

impl Row {
    /// The bytes of a text or blob.
    pub fn bytes(&self, column: usize) -> Option<&[u8]> {
        match self.values.get(column)? {
            Value::Bytes(from, length) => self.bytes.get(*from..from.checked_add(*length)?),
            _ => None,
        }
    }

    /// A text.
    pub fn text(&self, column: usize) -> Option<String> {
        Some(String::from_utf8_lossy(self.bytes(column)?).into_owned())
    }

    /// An integer; the number of the row stands for its own column.
    pub fn integer(&self, column: usize) -> Option<i64> {
        match self.values.get(column)? {
            Value::Integer(value) => Some(*value),
            _ => None,
        }
    }
}

/// A page of the tree that is being read.
struct Level {
    page: Vec<u8>,
    number: u32,
    /// The next cell, and the number of cells; one more child follows those of an inner page.
    next: usize,
    cells: usize,
    leaf: bool,
}

/// The place in a table.
pub struct Table {
    levels: Vec<Level>,
    /// Pages that were seen: a tree whose pages point back at each other has no end.
    seen: u64,
    root: Option<u32>,
}

/// An integer of variable length, and the bytes after it.
fn varint(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut value = 0_u64;
    for (k, byte) in bytes.iter().enumerate().take(9) {
        if k == 8 {
            return Some((value << 8 | u64::from(*byte), &bytes[9..]));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some((value, &bytes[k + 1..]));
        }
    }
    None
}

fn u16_at(bytes: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(u16::from_be_bytes(bytes.get(at..at + 2)?.try_into().ok()?)))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

impl Table {
    /// The table whose tree begins at a page.
    pub fn new(root: u32) -> Self {
        Self { levels: Vec::new(), seen: 0, root: Some(root) }
    }

    /// Reads the beginning of the next row; `false` at the end. [`Self::complete`] reads the rest.
    pub fn next(
        &mut self,
        pages: &mut Pages,
        base: u64,
        row: &mut Row,
        faults: &mut Faults,
    ) -> Result<bool> {
        if let Some(root) = self.root.take() {
            self.open(root, pages, base, faults)?;
        }
        loop {
            let Some(level) = self.levels.last_mut() else { return Ok(false) };
            let k = level.next;
            level.next += 1;
            if level.leaf {
                if k >= level.cells {
                    self.levels.pop();
                    continue;
                }
                let offset = base + u64::from(level.number - 1) * pages.size as u64;
                if leaf_cell(level, k, pages.usable, row).is_none() {
                    faults.records.add(offset);
                    continue;
                }
                row.offset = offset;
                return Ok(true);
            }
            if k > level.cells {
                self.levels.pop();
                continue;
            }
            match child(level, k) {
                Some(number) => self.open(number, pages, base, faults)?,
                None => faults.pages.add(base + u64::from(level.number - 1) * pages.size as u64),
            }
        }
    }

    /// Reads the rest of a row; `false` if a page of it is missing.
    pub fn complete(&self, pages: &mut Pages, row: &mut Row, faults: &mut Faults) -> Result<bool> {
        let Some((mut number, mut left)) = row.rest.take() else { return Ok(true) };
        // a chain within the file cannot be longer than the file
        if left as u64 > u64::from(pages.count) * pages.size as u64 {
            faults.records.add(row.offset);
            return Ok(false);
        }
        while left > 0 {
            let usable = pages.usable;
            let Some(page) = pages.page(number)? else {
                faults.records.add(row.offset);
                return Ok(false);
            };
            let take = left.min(usable - 4);
            row.bytes.extend_from_slice(&page[4..4 + take]);
            left -= take;
            number = u32_at(page, 0).unwrap_or(0);
        }
        Ok(true)
    }

    /// Goes down to a page.
    fn open(
        &mut self,
        number: u32,
        pages: &mut Pages,
        base: u64,
        faults: &mut Faults,
    ) -> Result<()> {
        self.seen += 1;
        let offset = base + u64::from(number.saturating_sub(1)) * pages.size as u64;
        if self.levels.len() >= DEEPEST || self.seen > u64::from(pages.count) {
            faults.pages.add(offset);
            return Ok(());
        }
        let Some(page) = pages.page(number)? else {
            faults.pages.add(offset);
            return Ok(());
        };
        // the first page begins with the header of the file
        let head = if number == 1 { 100 } else { 0 };
        let leaf = match page.get(head) {
            Some(0x0d) => true,
            Some(0x05) => false,
            _ => {
                faults.pages.add(offset);
                return Ok(());
            }
        };
        let cells = u16_at(page, head + 3).unwrap_or(0);
        let page = page.to_vec();
        self.levels.push(Level { page, number, next: 0, cells, leaf });
        Ok(())
    }
}

/// The place of a cell in its page.
fn cell(level: &Level, k: usize) -> Option<&[u8]> {
    let head = if level.number == 1 { 100 } else { 0 };
    let pointers = head + if level.leaf { 8 } else { 12 };
    level.page.get(u16_at(&level.page, pointers + 2 * k)?..)
}

/// The child of an inner page; the last one stands in its head.
fn child(level: &Level, k: usize) -> Option<u32> {
    if k == level.cells {
        return u32_at(&level.page, if level.number == 1 { 108 } else { 8 });
    }
    u32_at(cell(level, k)?, 0)
}

/// Reads a row as far as it stands in its leaf.
fn leaf_cell(level: &Level, k: usize, usable: usize, row: &mut Row) -> Option<()> {
    let (size, rest) = varint(cell(level, k)?)?;
    let (number, rest) = varint(rest)?;
    let size = usize::try_from(size).ok().filter(|n| *n <= LONGEST)?;
    row.number = number as i64;
    let (most, least) = (usable - 35, (usable - 12) * 32 / 255 - 23);
    let here = if size <= most {
        size
    } else {
        let fits = least + (size - least) % (usable - 4);
        if fits <= most { fits } else { least }
    };
    row.bytes.clear();
    row.bytes.extend_from_slice(rest.get(..here)?);
    row.rest = match size - here {
        0 => None,
        left => Some((u32_at(rest, here)?, left)),
    };
    values(row, size)
}

/// Reads the head of a row: the types of its values, and with them their places.
fn values(row: &mut Row, size: usize) -> Option<()> {
    row.values.clear();
    let (head, mut types) = varint(&row.bytes)?;
    let head = usize::try_from(head).ok()?;
    let mut left = head.checked_sub(row.bytes.len() - types.len())?;
    types = types.get(..left)?;
    let mut at = head;
    while left > 0 && row.values.len() < COLUMNS {
        let (kind, rest) = varint(types)?;
        left = rest.len();
        types = rest;
        let length = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind as usize,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            n => usize::try_from((n - 12) / 2).ok()?,
        };
        let value = match kind {
            8 => Value::Integer(0),
            9 => Value::Integer(1),
            1..=6 => {
                let bytes = row.bytes.get(at..at.checked_add(length)?)?;
                let sign = if bytes[0] & 0x80 == 0 { 0 } else { -1 };
                Value::Integer(bytes.iter().fold(sign, |v, b| v << 8 | i64::from(*b)))
            }
            0 | 7 => Value::Other,
            _ => Value::Bytes(at, length),
        };
        row.values.push(value);
        at = at.checked_add(length)?;
        if at > size {
            return None;
        }
    }
    Some(())
}
