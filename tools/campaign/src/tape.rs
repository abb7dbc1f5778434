//! Storage for the backward pass of the smoothed bound, on disk since a long run exceeds the
//! memory.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

/// Records of numbers, written forward and read backward.
pub struct Tape<K> {
    file: BufWriter<File>,
    index: Vec<(K, u64, usize)>,
    end: u64,
}

impl<K: Copy> Tape<K> {
    /// Creates an empty tape in the folder for temporary files. The file is removed when the tape
    /// is dropped.
    pub fn new() -> io::Result<Self> {
        Ok(Self {
            file: BufWriter::with_capacity(1 << 20, tempfile::tempfile()?),
            index: Vec::new(),
            end: 0,
        })
    }

    /// Appends a record.
    pub fn push<'a>(
        &mut self,
        kind: K,
        parts: impl IntoIterator<Item = &'a [f64]>,
    ) -> io::Result<()> {
        let mut count = 0;
        for part in parts {
            for value in part {
                self.file.write_all(&value.to_le_bytes())?;
            }
            count += part.len();
        }
        self.index.push((kind, self.end, count));
        self.end += 8 * count as u64;
        Ok(())
    }

    /// Passes every record to `each`, the last one first.
    pub fn backward(self, mut each: impl FnMut(K, &[f64])) -> io::Result<()> {
        let mut file = self.file.into_inner().map_err(io::IntoInnerError::into_error)?;
        let (mut bytes, mut values) = (Vec::new(), Vec::new());
        for (kind, at, count) in self.index.into_iter().rev() {
            bytes.resize(8 * count, 0);
            file.seek(SeekFrom::Start(at))?;
            file.read_exact(&mut bytes)?;
            values.clear();
            values.extend(bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)));
            each(kind, &values);
        }
        Ok(())
    }
}
