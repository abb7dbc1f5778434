//! What only the end of a file tells, or a second look at it: its last time, whether it was cut off, which line an error is
//! in. None of it reads more than it needs, and none of it is on the way of a sample.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes of the end in which the last complete line is looked for.
const TAIL: u64 = 64 * 1024;

/// The last lines of a file, the very last first, without line ends, empty lines and comments; the first may be cut off.
pub fn last_lines(path: &Path) -> Option<Vec<Vec<u8>>> {
    let mut file = File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).ok()?;
    let mut bytes = Vec::new();
    file.take(TAIL).read_to_end(&mut bytes).ok()?;
    let lines = bytes.split(|b| *b == b'\n').map(<[u8]>::trim_ascii_end);
    Some(
        lines.filter(|l| !l.is_empty() && !l.starts_with(b"#")).rev().map(<[u8]>::to_vec).collect(),
    )
}

/// Whether a file ends at that byte, without the end of a line.
pub fn ends_within_line(path: &Path, byte: u64) -> bool {
    let last = || -> std::io::Result<bool> {
        let mut file = File::open(path)?;
        let mut last = [b'\n'];
        if file.metadata()?.len() == byte {
            file.seek(SeekFrom::End(-1))?;
            file.read_exact(&mut last)?;
        }
        Ok(!matches!(last, [b'\n' | b'\r']))
    };
    last().unwrap_or(false)
}

/// The line, from 1, of the last byte before that one.
pub fn line_before(path: &Path, byte: u64) -> u64 {
    let count = || -> std::io::Result<u64> {
        // the line end itself, or the first of its two bytes, is in the line
        let mut reader = BufReader::new(File::open(path)?.take(byte.saturating_sub(1)));
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
