//! The bytes of a file: unpacked, as UTF-8, with spaces joined where they separate cells, with decimal
//! points, and in rows of a bounded length. A file without line ends, or with a quotation mark that is
//! never closed, would otherwise fill the memory with one row.

use crate::beside;
use crate::folder::{Folder, is_folder};
use crate::labelled::Labelled;
use crate::lines::{Backwards, Change, Lines};
use crate::records::of_all_forms;
use crate::text::text;
use crate::transposed::Columns;
use crate::utf16::{self, Utf16};
use crate::whole::{LARGEST, Whole};
use flate2::read::MultiGzDecoder;
use navfuse_core::input::{self, Input};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Largest length of a row, in bytes.
const LONGEST_ROW: usize = 1 << 20;
/// Bytes of zero in one piece that are no text, as a recorder without power leaves them, and the largest number of them.
const HOLE: usize = 4096;
const EMPTY: u64 = 1 << 30;
/// Bytes by which a file with an array for each column is recognised.
const BUFFER: usize = 16 * 1024;
/// First bytes of a file that gzip packed.
const GZIP: [u8; 2] = [0x1f, 0x8b];
/// First bytes of a file that zstd packed.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// The form of the text of a file. The default changes nothing.
#[derive(Clone, Debug, Default)]
pub struct Form {
    /// Any number of spaces and tabs becomes one space, and none at the ends of a line.
    pub joined: bool,
    /// A comma becomes a point.
    pub decimal_comma: bool,
    /// Number of lines at the beginning that become comments, by this character.
    pub skipped: (u64, u8),
    /// Number of lines after which the table ends.
    pub until: Option<u64>,
    /// Headings of rows that name their values.
    pub labels: Option<Vec<String>>,
    /// Arrays whose elements are rows each.
    pub each: Vec<String>,
    /// Files whose columns stand beside those of the file.
    pub beside: Vec<PathBuf>,
    /// The mark that ends the stamp before each line, and the separator of the cells.
    pub stamps: Option<(String, char)>,
    /// Widths of columns without a separator.
    pub widths: Vec<u16>,
    /// Number of lines before rows that run from the newest to the oldest.
    pub backwards: Option<u64>,
}

/// A file, of which at most [`LONGEST_ROW`] bytes and a buffer are read for one row.
pub struct Bounded {
    file: Box<dyn Read + Send>,
    buffer: usize,
    left: usize,
    form: Form,
    spaces: Spaces,
    /// Set at the beginning of a line.
    line_begins: bool,
    /// Set if the bytes are not those of the file on the disk.
    changed: bool,
    /// Number of bytes of zero that were left out.
    zeros: u64,
    /// Number of bytes that were given, and the last of them.
    given: u64,
    last: u8,
}

impl Bounded {
    /// The file at a path, or the rows of a folder.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(path: &Path, buffer: usize, form: Form) -> io::Result<Self> {
        if !form.beside.is_empty() {
            let paths: Vec<PathBuf> =
                std::iter::once(path.to_owned()).chain(form.beside.iter().cloned()).collect();
            let columns = Columns::new(beside::read(&texts(&paths, LARGEST)?));
            let rows = Labelled::of_columns(columns, form.labels.clone().unwrap_or_default());
            return Self::new(rows, true, buffer, Form { labels: None, ..form });
        }
        match is_folder(path) {
            true => Self::new(Folder::open(path)?, true, buffer, form),
            false => Self::file(input::open(path)?, buffer, form),
        }
    }

    /// A file that is read through a buffer of this size in bytes.
    ///
    /// # Errors
    /// When the file cannot be read.
    fn file(mut file: Input, buffer: usize, form: Form) -> io::Result<Self> {
        let mut magic = Vec::new();
        (&mut file).take(ZSTD.len() as u64).read_to_end(&mut magic)?;
        let zipped = magic.starts_with(&GZIP) || magic == ZSTD;
        if zipped {
            file.seek(SeekFrom::Start(0))?;
        }
        if magic.starts_with(&GZIP) {
            Self::new(MultiGzDecoder::new(file), true, buffer, form)
        } else if zipped {
            Self::new(zstd::Decoder::new(file)?, true, buffer, form)
        } else {
            // a pipe has no beginning to go back to
            Self::new(io::Cursor::new(magic).chain(file), false, buffer, form)
        }
    }

    /// Bytes; `changed` if they are not those of the file on the disk.
    fn new(
        bytes: impl Read + Send + 'static,
        changed: bool,
        buffer: usize,
        form: Form,
    ) -> io::Result<Self> {
        let (file, decoded) = in_utf8(Box::new(bytes))?;
        let lines = form.stamps.is_some() || form.backwards.is_some() || !form.widths.is_empty();
        let changes = form.joined || form.labels.is_some() || lines;
        let changed = changed || decoded || changes;
        let file: Box<dyn Read + Send> = match (form.labels.clone(), form.stamps.clone()) {
            (Some(headings), _) => Box::new(Labelled::new(file, headings, form.each.clone())),
            (None, Some((mark, delimiter))) => {
                Box::new(Lines::new(file, Change::Stamp(mark, delimiter)))
            }
            (None, None) if !form.widths.is_empty() => {
                Box::new(Lines::new(file, Change::Widths(form.widths.clone())))
            }
            (None, None) => file,
        };
        let file = match form.backwards {
            Some(above) => Box::new(Backwards::new(file, above)),
            None => file,
        };
        Ok(Self {
            file,
            buffer,
            left: LONGEST_ROW + buffer,
            form,
            spaces: Spaces::default(),
            line_begins: true,
            changed,
            zeros: 0,
            given: 0,
            last: b'\n',
        })
    }

    /// Changes bytes to the form that the rows are read in, in their places.
    fn reform(&mut self, bytes: &mut [u8]) {
        if self.form.decimal_comma {
            bytes.iter_mut().filter(|b| **b == b',').for_each(|b| *b = b'.');
        }
        let (lines, comment) = &mut self.form.skipped;
        for byte in bytes {
            if *lines == 0 {
                return;
            }
            if *byte == b'\n' {
                *lines -= 1;
            } else if self.line_begins && *byte != b'\r' {
                *byte = *comment;
            }
            self.line_begins = *byte == b'\n';
        }
    }

    /// The number of bytes before the end of the table.
    fn within(&mut self, bytes: &[u8]) -> usize {
        let Some(lines) = &mut self.form.until else { return bytes.len() };
        for (at, _) in bytes.iter().enumerate().filter(|(_, b)| **b == b'\n') {
            *lines -= 1;
            if *lines == 0 {
                return at + 1;
            }
        }
        bytes.len()
    }

    /// Begins a row.
    pub fn begin_row(&mut self) {
        self.left = LONGEST_ROW + self.buffer;
    }

    /// True if the bytes are not those of the file on the disk, so that offsets differ.
    pub fn is_changed(&self) -> bool {
        self.changed
    }

    /// True if these are all bytes that were given, and the last is no line end.
    pub fn ends_within_line(&self, byte: u64) -> bool {
        byte == self.given && !matches!(self.last, b'\n' | b'\r')
    }
}

/// Decodes UTF-16; `true` if it was.
fn in_utf8(mut file: Box<dyn Read + Send>) -> io::Result<(Box<dyn Read + Send>, bool)> {
    // more bytes than the mark of UTF-8, which the reader of the rows wants in one piece
    let mut mark = Vec::new();
    (&mut file).take(4).read_to_end(&mut mark)?;
    let marked = utf16::MARKS.iter().position(|known| mark.starts_with(known));
    let order = marked.or_else(|| utf16::without_mark(&mark));
    let rest = mark.split_off(if marked.is_some() { 2 } else { 0 });
    let file = Box::new(io::Cursor::new(rest).chain(file));
    Ok(match order {
        Some(k) => (Box::new(Utf16::new(file, k == 0)), true),
        None => (file, false),
    })
}

/// The first bytes of a file, at most this many, unpacked as the source unpacks them.
///
/// # Errors
/// When the file cannot be read.
pub fn beginning(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let most = usize::try_from(most).unwrap_or(usize::MAX / 2);
    let mut file = Bounded::open(path, most.max(BUFFER), Form::default())?;
    let mut bytes = Vec::new();
    (&mut file).take(BUFFER as u64).read_to_end(&mut bytes)?;
    if let Some(whole) = Whole::of(&String::from_utf8_lossy(&bytes)) {
        // the first records, as objects of JSON
        let columns = whole.read(&mut io::Cursor::new(bytes).chain(Unbounded(file)))?;
        return Ok(columns.beginning(most).into_bytes());
    }
    let rest = most.saturating_sub(bytes.len());
    file.take(rest as u64).read_to_end(&mut bytes)?;
    bytes.truncate(most);
    Ok(bytes)
}

/// The names and the texts of files, of each at most this many bytes.
fn texts(paths: &[PathBuf], each: u64) -> io::Result<Vec<(String, String)>> {
    let (mut texts, mut left) = (Vec::new(), LARGEST);
    for path in paths {
        let mut bytes = Vec::new();
        let file = Unbounded(Bounded::open(path, BUFFER, Form::default())?);
        file.take(each.min(left + 1)).read_to_end(&mut bytes)?;
        left = left.checked_sub(bytes.len() as u64).ok_or_else(|| {
            let text =
                format!("files whose columns stand beside each other may have {LARGEST} bytes");
            io::Error::new(ErrorKind::InvalidData, text)
        })?;
        let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        texts.push((stem, text(&bytes).into_owned()));
    }
    Ok(texts)
}

/// The first rows of files whose columns stand beside each other, as objects of JSON in at most this many bytes.
///
/// # Errors
/// When a file cannot be read.
pub fn beginning_of_files(paths: &[PathBuf], most: usize) -> io::Result<String> {
    Ok(Columns::new(beside::read(&texts(paths, most as u64)?)).beginning(most))
}

/// The first records of each form of a file of JSON with objects, in at most this many bytes.
///
/// # Errors
/// When the file cannot be read.
pub fn records_of_all_forms(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut file = Bounded::open(path, BUFFER, Form::default())?;
    let mut bytes = Vec::new();
    (&mut file).take(BUFFER as u64).read_to_end(&mut bytes)?;
    if Whole::of(&String::from_utf8_lossy(&bytes)).is_some() {
        return beginning(path, most);
    }
    let most = usize::try_from(most).unwrap_or(usize::MAX / 2);
    of_all_forms(io::Cursor::new(bytes).chain(Unbounded(file)), most)
}

/// A file that has no rows, of any length.
struct Unbounded(Bounded);

impl Read for Unbounded {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.begin_row();
        self.0.read(bytes)
    }
}

impl Read for Bounded {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let length = bytes.len().min(self.left);
        if length == 0 && !bytes.is_empty() {
            return Err(io::Error::new(
                ErrorKind::InvalidData,
                format!(
                    "a row has more than {LONGEST_ROW} bytes; check the line ends and the \
                     quotation marks"
                ),
            ));
        }
        if self.form.until == Some(0) {
            return Ok(0);
        }
        let count = loop {
            let count = if self.form.joined && length > 1 {
                self.spaces.read(&mut self.file, &mut bytes[..length])?
            } else {
                self.file.read(&mut bytes[..length])?
            };
            let zeros = count >= HOLE && bytes[..count].iter().all(|b| *b == 0);
            if !zeros {
                break count;
            }
            self.changed = true;
            self.zeros += count as u64;
            if self.zeros > EMPTY {
                let text =
                    format!("it has more than {EMPTY} bytes of zero, and no row behind them");
                return Err(io::Error::new(ErrorKind::InvalidData, text));
            }
        };
        let count = self.within(&bytes[..count]);
        self.reform(&mut bytes[..count]);
        self.left -= count;
        self.given += count as u64;
        if let Some(last) = bytes[..count].last() {
            self.last = *last;
        }
        Ok(count)
    }
}

/// Joins spaces and tabs.
#[derive(Default)]
struct Spaces {
    /// Set if a space was read and not yet given.
    pending: bool,
    /// Set once a line has a character that is no space.
    within_line: bool,
}

impl Spaces {
    /// Reads at least one byte, unless the file ends.
    fn read(&mut self, file: &mut dyn Read, bytes: &mut [u8]) -> io::Result<usize> {
        loop {
            // a space from before may precede the bytes
            let read = file.read(&mut bytes[1..])?;
            let mut length = 0;
            for k in 1..=read {
                match bytes[k] {
                    b' ' | b'\t' => {
                        self.pending = true;
                        continue;
                    }
                    b'\n' | b'\r' => self.within_line = false,
                    _ => {
                        if self.pending && self.within_line {
                            bytes[length] = b' ';
                            length += 1;
                        }
                        self.within_line = true;
                    }
                }
                self.pending = false;
                bytes[length] = bytes[k];
                length += 1;
            }
            if length > 0 || read == 0 {
                return Ok(length);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_of_zeros_without_an_end_is_an_error() {
        let endless = Bounded::new(io::repeat(0), false, BUFFER, Form::default());
        let read = endless.and_then(|mut file| io::copy(&mut file, &mut io::sink()));
        assert!(read.is_err_and(|error| error.to_string().contains("bytes of zero")));
    }
}
