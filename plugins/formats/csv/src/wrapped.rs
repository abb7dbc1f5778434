//! Objects of JSON in arrays that one object has: `{"name": "dive", "samples": [{...}, {...}], "fixes": [{...}]}`.

use std::io::{BufRead, Result};

/// Least number of objects of an array whose object ends at the beginning of a file.
const SEVERAL: usize = 2;
/// Depths of such arrays, the least first.
const LEVELS: [usize; 3] = [2, 3, 4];

/// The brackets of JSON that are open.
#[derive(Clone, Debug, Default)]
struct Brackets {
    depth: usize,
    quoted: bool,
    escaped: bool,
    /// Depth of an array that begins, until its first value.
    array: Option<usize>,
    /// Depth of the arrays whose objects are the records.
    level: usize,
}

impl Brackets {
    /// Takes a byte; `true` where the first object of an array with records begins.
    fn take(&mut self, byte: u8) -> bool {
        if self.quoted {
            self.quoted = byte != b'"' || self.escaped;
            self.escaped = byte == b'\\' && !self.escaped;
            return false;
        }
        let array = if byte.is_ascii_whitespace() { self.array } else { self.array.take() };
        match byte {
            b'"' => self.quoted = true,
            b'{' | b'[' => {
                self.depth += 1;
                self.array = (byte == b'[').then_some(self.depth);
            }
            b'}' | b']' => self.depth = self.depth.saturating_sub(1),
            _ => {}
        }
        byte == b'{' && array == Some(self.level)
    }
}

/// The array of an object, whose objects are the records.
#[derive(Clone, Debug, Default)]
pub struct Array {
    brackets: Brackets,
    inside: bool,
}

impl Array {
    /// The array of a text that begins with one object, if this object is all there is: it goes on at the end of the
    /// text, or nothing follows.
    pub fn of(text: &str) -> Option<Self> {
        let text = text.trim_start();
        // the arrays nearest to the outermost object
        let begins = |level: usize| {
            let mut brackets = Brackets { level, ..Brackets::default() };
            let at = text.bytes().position(|b| brackets.take(b))?;
            Some((brackets, at))
        };
        let (mut brackets, begins) =
            text.starts_with('{').then(|| LEVELS.into_iter().find_map(begins))??;
        let level = brackets.level;
        let (mut objects, mut end) = (1, None);
        for (at, byte) in text.bytes().enumerate().skip(begins + 1) {
            let before = brackets.depth;
            brackets.take(byte);
            objects += usize::from(byte == b'{' && before == level && brackets.depth == level + 1);
            if brackets.depth == 0 {
                end = Some(at);
                break;
            }
        }
        let alone = end.is_none_or(|at| text[at + 1..].trim().is_empty());
        let brackets = Brackets { level, ..Brackets::default() };
        (alone && (end.is_none() || objects >= SEVERAL)).then_some(Self { brackets, inside: false })
    }

    /// Reads up to the next object of the array, or of one that follows; `false` at the end of the file.
    pub fn enter(&mut self, file: &mut impl BufRead) -> Result<bool> {
        loop {
            let bytes = file.fill_buf()?;
            if bytes.is_empty() {
                return Ok(false);
            }
            if self.inside {
                let between = |b: &u8| b.is_ascii_whitespace() || *b == b',';
                let used = bytes.iter().take_while(|b| between(b)).count();
                match bytes.get(used) {
                    Some(b'{') => {
                        file.consume(used);
                        return Ok(true);
                    }
                    // the end of the array
                    Some(_) => {
                        self.inside = false;
                        let level = self.brackets.level;
                        self.brackets = Brackets { depth: level, level, ..Brackets::default() };
                    }
                    None => {}
                }
                file.consume(used);
                continue;
            }
            let begins = bytes.iter().position(|byte| self.brackets.take(*byte));
            // the object itself is still to be read
            let used = begins.unwrap_or(bytes.len());
            file.consume(used);
            self.inside = begins.is_some();
        }
    }
}
