//! Reads parts of a file once more: its last lines, its last byte, the lines up to an error. The
//! functions read no more than they need, and none is called for every sample.

use navfuse_core::input;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Size in bytes of the end of the file in which the last complete line is searched.
const TAIL: u64 = 64 * 1024;

/// The last lines of a file in reverse order, without line ends, empty lines and comments. The
/// earliest of these lines may be incomplete.
pub fn last_lines(path: &Path) -> Option<Vec<Vec<u8>>> {
    let mut file = input::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).ok()?;
    let mut bytes = Vec::new();
    file.take(TAIL).read_to_end(&mut bytes).ok()?;
    let lines = bytes.split(|b| *b == b'\n').map(<[u8]>::trim_ascii_end);
    Some(
        lines.filter(|l| !l.is_empty() && !l.starts_with(b"#")).rev().map(<[u8]>::to_vec).collect(),
    )
}

/// Returns `true` if a file ends at a byte without a line end.
pub fn ends_within_line(path: &Path, byte: u64) -> bool {
    let last = || -> std::io::Result<bool> {
        let mut file = input::open(path)?;
        let mut last = [b'\n'];
        if file.metadata()?.len() == byte {
            file.seek(SeekFrom::End(-1))?;
            file.read_exact(&mut last)?;
        }
        Ok(!matches!(last, [b'\n' | b'\r']))
    };
    last().unwrap_or(false)
}

/// The number of the line, counted from 1, that holds the last byte before a position.
pub fn line_before(path: &Path, byte: u64) -> u64 {
    let count = || -> std::io::Result<u64> {
        // the line end itself, or the first of its two bytes, belongs to the line
        let mut reader = BufReader::new(input::open(path)?.take(byte.saturating_sub(1)));
        let mut line = 1;
        loop {
            let bytes = reader.fill_buf()?;
            if bytes.is_empty() {
                return Ok(line);
            }
            line += bytes.iter().filter(|b| **b == b'\n').count() as u64;
            let length = bytes.len();
            reader.consume(length);
        }
    };
    count().unwrap_or(0)
}
