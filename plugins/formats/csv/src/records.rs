//! The records of a file whose rows name their values: objects of JSON, one after another or in an array, lines such as
//! `t=0.01 gx: 0.2`, YAML, and points of GPX, TCX and KML.

use crate::line::line;
use crate::object::object;
use crate::paths::bounded;
use crate::protobuf;
use crate::transposed::Columns;
use crate::whole::Whole;
use crate::wrapped;
use crate::xml;
use crate::yaml;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hasher};
use std::io::{BufRead, BufReader, Chain, Cursor, Read, Result};

/// Bytes by which the form is found.
const BEGINNING: u64 = 16 * 1024;
/// Number of records of each form by which a file is recognised, and of forms.
const EACH: usize = 4000;
const FORMS: usize = 100;
/// The form of the records.
pub enum Form {
    /// Objects of JSON, and lines.
    Plain,
    /// Objects in an array that an object of JSON has.
    Wrapped(wrapped::Array),
    /// Columns of a text that is read as a whole, with the first record.
    Columns(Whole, Option<Columns>),
    Yaml(yaml::Parts),
    Xml(xml::Points),
    Protobuf,
}

/// The records of a file: objects, lines, parts of YAML, or points of XML.
pub struct Records<R> {
    file: BufReader<Chain<Cursor<Vec<u8>>, R>>,
    record: Vec<u8>,
    pub form: Form,
}

impl<R: Read> Records<R> {
    pub fn new(mut file: R) -> Self {
        let mut beginning = Vec::new();
        // a file that cannot be read fails again at the first record
        let _ = (&mut file).take(BEGINNING).read_to_end(&mut beginning);
        let text = String::from_utf8_lossy(&beginning);
        let xml = || xml::Points::of(&text).map(Form::Xml);
        let wrapped = || wrapped::Array::of(&text).map(Form::Wrapped);
        let columns = || Whole::of(&text).map(|whole| Form::Columns(whole, None));
        let protobuf = || protobuf::begins(&text).then_some(Form::Protobuf);
        let form = columns().or_else(protobuf).or_else(|| yaml::Parts::of(&text).map(Form::Yaml));
        let form = form.or_else(xml).or_else(wrapped);
        let form = form.unwrap_or(Form::Plain);
        let file = BufReader::new(Cursor::new(beginning).chain(file));
        Self { file, record: Vec::new(), form }
    }

    /// The rows of columns that were read.
    pub fn of(columns: Columns, nothing: R) -> Self {
        let file = BufReader::new(Cursor::new(Vec::new()).chain(nothing));
        Self { file, record: Vec::new(), form: Form::Columns(Whole::Long, Some(columns)) }
    }

    /// Reads the next record; `false` at the end.
    pub fn advance(&mut self) -> Result<bool> {
        match &mut self.form {
            Form::Yaml(parts) => parts.next(&mut self.file, &mut self.record),
            Form::Xml(points) => points.next(&mut self.file, &mut self.record),
            Form::Wrapped(array) => {
                let inside = array.enter(&mut self.file)?;
                Ok(inside && next(&mut self.file, &mut self.record)? && self.record[0] == b'{')
            }
            Form::Columns(whole, columns) => {
                if columns.is_none() {
                    *columns = Some(whole.read(&mut self.file)?);
                }
                Ok(columns.as_mut().is_some_and(Columns::advance))
            }
            Form::Protobuf => protobuf::next(&mut self.file, &mut self.record),
            Form::Plain => next(&mut self.file, &mut self.record),
        }
    }

    /// Calls `found` with the path and the text of each value of the record.
    pub fn values(&self, found: impl FnMut(&str, &str)) {
        if let Form::Columns(_, columns) = &self.form {
            if let Some(columns) = columns {
                columns.values(found);
            }
            return;
        }
        let record = String::from_utf8_lossy(&self.record);
        match &self.form {
            Form::Yaml(_) => yaml::values(&record, found),
            Form::Xml(_) => xml::values(&record, found),
            Form::Protobuf => protobuf::values(&record, found),
            _ if record.starts_with('{') => object(&record, found),
            _ => line(&record, found),
        }
    }
}

/// Reads the next record: an object, or a line; `false` at the end.
fn next(file: &mut impl BufRead, record: &mut Vec<u8>) -> Result<bool> {
    record.clear();
    let (mut depth, mut quoted, mut escaped) = (0_usize, false, false);
    loop {
        let bytes = file.fill_buf()?;
        let blank = |b: &u8| matches!(b, b'[' | b']' | b',' | b' ' | b'\r' | b'\n' | b'\t');
        let begin = match record.is_empty() {
            true => bytes.iter().position(|b| !blank(b)).unwrap_or(bytes.len()),
            false => 0,
        };
        let json = record.first().or(bytes.get(begin)) == Some(&b'{');
        let mut end = begin;
        let mut whole = bytes.is_empty();
        while end < bytes.len() && !whole {
            let rest = &bytes[end..];
            if !json {
                let at = rest.iter().position(|b| *b == b'\n');
                (end, whole) = at.map_or((bytes.len(), false), |at| (end + at + 1, true));
                continue;
            }
            if std::mem::take(&mut escaped) {
                end += 1;
                continue;
            }
            let mark = |b: &u8| matches!(b, b'"' | b'{' | b'}' | b'\\');
            let Some(at) = rest.iter().position(mark) else {
                end = bytes.len();
                continue;
            };
            match rest[at] {
                b'"' => quoted = !quoted,
                b'{' if !quoted => depth += 1,
                b'}' if !quoted => depth = depth.saturating_sub(1),
                b'\\' => escaped = true,
                _ => {}
            }
            end += at + 1;
            whole = depth == 0 && !escaped;
        }
        record.extend_from_slice(&bytes[begin..end]);
        file.consume(end);
        if whole {
            return Ok(!record.is_empty());
        }
        bounded(record.len())?;
    }
}

/// The records at the beginning of a text, each with the paths and the texts of its values; empty
/// where more than `most` of them have less than `least` values.
#[must_use]
pub fn records(text: &str, least: usize, most: usize) -> Vec<Vec<(String, String)>> {
    let (mut file, mut records) = (Records::new(text.as_bytes()), Vec::new());
    let mut short = 0;
    while let Ok(true) = file.advance() {
        let mut row = Vec::new();
        file.values(|name, value| row.push((name.to_owned(), value.to_owned())));
        short += usize::from(row.len() < least);
        if short > most {
            return Vec::new();
        }
        records.push(row);
    }
    // the last one may be cut off
    if records.len() > 1 {
        records.pop();
    }
    records
}

/// The first records of JSON of each form, which their paths make, in at most so many bytes: the records of a second array
/// may begin anywhere.
///
/// # Errors
/// When the file cannot be read.
pub fn of_all_forms(file: impl Read, most: usize) -> Result<Vec<u8>> {
    let (mut file, mut text) = (Records::new(file), Vec::new());
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    while file.advance()? {
        let mut form = DefaultHasher::new();
        file.values(|name, _| form.write(name.as_bytes()));
        let form = form.finish();
        let known = counts.contains_key(&form) || counts.len() < FORMS;
        let count = counts.entry(if known { form } else { 0 }).or_default();
        *count += 1;
        if *count <= EACH && text.len() + file.record.len() < most {
            text.extend(file.record.iter().map(|b| if *b == b'\n' { b' ' } else { *b }));
            text.push(b'\n');
        }
    }
    Ok(text)
}
