//! Paths of the values of a record, and its length.

use std::io::{Error, ErrorKind, Result};

/// Bytes of a line that are read at once.
pub const PIECE: u64 = 1 << 16;
/// Deepest nesting of a record.
pub const DEEPEST: usize = 32;
/// Largest length of a record, in bytes.
const LONGEST: usize = 1 << 20;

/// Adds a name to a path.
pub fn join(path: &mut String, name: &str) {
    if !path.is_empty() {
        path.push('.');
    }
    path.push_str(name);
}

/// Refuses a record that is too long.
pub fn bounded(length: usize) -> Result<()> {
    let text = || format!("a record has more than {LONGEST} bytes");
    let error = || Error::new(ErrorKind::InvalidData, text());
    if length > LONGEST { Err(error()) } else { Ok(()) }
}
