//! The file that the key `file` of a source names.

use navfuse_core::input::{self, Input};
use navfuse_core::model::stream::StreamError;
use std::io::Read;
use std::path::Path;

/// Size in bytes of the beginning of a file by which its format is recognised.
const BEGINNING: u64 = 256 * 1024;

/// Opens the file.
///
/// # Errors
/// When it cannot be opened, with its absolute path and the key.
pub fn open(path: &Path) -> Result<Input, StreamError> {
    input::open(path).map_err(|e| {
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        StreamError::open(absolute, e).at_key("file")
    })
}

/// Recognises the format of the file, one of the formats with the given `names`, by its beginning.
///
/// # Errors
/// When the file cannot be read, or has none of the formats.
pub fn recognise<F>(
    path: &Path,
    names: &[&str],
    by: impl Fn(&[u8]) -> Option<F>,
) -> Result<F, StreamError> {
    let mut beginning = Vec::new();
    let read = open(path)?.take(BEGINNING).read_to_end(&mut beginning);
    read.map_err(|e| StreamError::read(path, e))?;
    by(&beginning).ok_or_else(|| {
        let text = match beginning.len() {
            0 => "the file is empty".to_owned(),
            n => format!("no known format has enough intact records in its first {n} bytes"),
        };
        StreamError::format(text)
            .in_file(path)
            .with_remedy(format!("name the format with `format`: {}", names.join(", ")))
    })
}
