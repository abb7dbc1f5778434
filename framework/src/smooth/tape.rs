//! Temporary files of the smoother: the samples of the run in the order of their use, and the
//! smoothed estimates. They are on disk since a long run exceeds the memory, and removed with the
//! program.

use crate::units::sample::{MAX_CHANNELS, Sample, SensorId, channels};
use crate::units::time::Time;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};

/// A step of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Entry {
    /// The filter takes a sample.
    Sample(Sample),
    /// The runner records the estimate.
    Epoch,
    /// The filter uses the samples that it holds.
    Finish,
}

/// Marks of the entries.
const SAMPLE: u8 = 0;
const EPOCH: u8 = 1;
const FINISH: u8 = 2;

/// Steps of the run, in order.
pub(super) struct Steps {
    file: BufWriter<File>,
    /// Length in bytes, and the length before the last entry.
    pub(super) end: u64,
    before: u64,
}

impl Steps {
    pub(super) fn new() -> io::Result<Self> {
        let file = BufWriter::with_capacity(1 << 16, tempfile::tempfile()?);
        Ok(Self { file, end: 0, before: 0 })
    }

    pub(super) fn push(&mut self, entry: &Entry) -> io::Result<()> {
        let mut bytes = [0; 13 + 8 * MAX_CHANNELS];
        let mut len = 1;
        match entry {
            Entry::Epoch => bytes[0] = EPOCH,
            Entry::Finish => bytes[0] = FINISH,
            Entry::Sample(sample) => {
                let sensor = u16::try_from(sample.sensor.0).map_err(io::Error::other)?;
                bytes[0] = SAMPLE;
                bytes[1..9].copy_from_slice(&sample.time.nanos().to_le_bytes());
                bytes[9..11].copy_from_slice(&sensor.to_le_bytes());
                bytes[11..13].copy_from_slice(&sample.present().to_le_bytes());
                len = 13;
                for value in (0..MAX_CHANNELS).filter_map(|c| sample.get(c)) {
                    bytes[len..len + 8].copy_from_slice(&value.to_le_bytes());
                    len += 8;
                }
            }
        }
        self.file.write_all(&bytes[..len])?;
        (self.before, self.end) = (self.end, self.end + len as u64);
        Ok(())
    }

    /// Forgets the last entry.
    pub(super) fn take_back(&mut self) -> io::Result<()> {
        self.end = self.before;
        self.file.seek(SeekFrom::Start(self.end)).map(drop)
    }

    /// Forgets all entries.
    pub(super) fn clear(&mut self) -> io::Result<()> {
        (self.before, self.end) = (0, 0);
        restart(&mut self.file)
    }

    /// Passes the entries between two places to `each`, with the place of each.
    pub(super) fn read<E: From<io::Error>>(
        &mut self,
        from: u64,
        to: u64,
        mut each: impl FnMut(u64, Entry) -> Result<(), E>,
    ) -> Result<(), E> {
        self.file.flush()?;
        let file = self.file.get_mut();
        file.seek(SeekFrom::Start(from))?;
        let mut bytes = BufReader::with_capacity(1 << 16, file.take(to - from));
        let mut mark = [0; 1];
        let mut at = from;
        while bytes.read(&mut mark)? == 1 {
            let (entry, length) = match mark[0] {
                EPOCH => (Entry::Epoch, 1),
                FINISH => (Entry::Finish, 1),
                _ => {
                    let sample = read_sample(&mut bytes)?;
                    (Entry::Sample(sample), 13 + 8 * u64::from(sample.present().count_ones()))
                }
            };
            each(at, entry)?;
            at += length;
        }
        Ok(())
    }
}

fn read_sample(bytes: &mut impl Read) -> io::Result<Sample> {
    let (mut time, mut two) = ([0; 8], [0; 2]);
    bytes.read_exact(&mut time)?;
    bytes.read_exact(&mut two)?;
    let sensor = SensorId(usize::from(u16::from_le_bytes(two)));
    bytes.read_exact(&mut two)?;
    let present = u16::from_le_bytes(two);
    let mut sample = Sample::empty(Time::from_nanos(i64::from_le_bytes(time)), sensor);
    for channel in channels(present) {
        let mut value = [0; 8];
        bytes.read_exact(&mut value)?;
        sample.set(channel, f64::from_le_bytes(value));
    }
    Ok(sample)
}

/// Empties a temporary file.
fn restart(file: &mut BufWriter<File>) -> io::Result<()> {
    file.seek(SeekFrom::Start(0))?;
    file.get_ref().set_len(0)
}

/// Rows of numbers of one length, of which the last one is taken first: the backward pass writes
/// them in the reverse order of time.
pub(crate) struct Rows {
    file: BufWriter<File>,
    bytes: Vec<u8>,
    count: u64,
}

impl Rows {
    pub(super) fn new(width: usize) -> io::Result<Self> {
        let file = BufWriter::with_capacity(1 << 16, tempfile::tempfile()?);
        Ok(Self { file, bytes: vec![0; 8 * width], count: 0 })
    }

    /// Forgets all rows.
    pub(super) fn clear(&mut self) -> io::Result<()> {
        self.count = 0;
        restart(&mut self.file)
    }

    pub(super) fn push(&mut self, row: &[f64]) -> io::Result<()> {
        for (bytes, value) in self.bytes.as_chunks_mut::<8>().0.iter_mut().zip(row) {
            *bytes = value.to_le_bytes();
        }
        self.file.write_all(&self.bytes)?;
        self.count += 1;
        Ok(())
    }

    /// The file and the number of rows.
    pub(super) fn into_file(self) -> io::Result<(File, u64)> {
        Ok((self.file.into_inner().map_err(io::IntoInnerError::into_error)?, self.count))
    }

    /// Takes the last row; `false` if there is none. No row may be added afterwards, unless all are
    /// forgotten.
    pub(super) fn pop(&mut self, row: &mut Vec<f64>) -> io::Result<bool> {
        row.clear();
        let Some(last) = self.count.checked_sub(1) else { return Ok(false) };
        self.count = last;
        self.file.seek(SeekFrom::Start(last * self.bytes.len() as u64))?;
        self.file.get_mut().read_exact(&mut self.bytes)?;
        row.extend(self.bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)));
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    fn sample(k: i64) -> Entry {
        let values: Vec<f64> = (0..k).map(|c| c as f64 + 0.5).collect();
        Entry::Sample(Sample::new(Time::from_nanos(k), SensorId(k as usize), &values))
    }

    #[test]
    fn the_steps_are_read_in_order_without_those_taken_back() {
        let mut steps = Steps::new().unwrap();
        let kept = [sample(3), Entry::Epoch, sample(1), sample(0), Entry::Finish];
        for (k, entry) in kept.iter().enumerate() {
            // a longer and a shorter one than what follows
            steps.push(&if k % 2 == 0 { sample(9) } else { Entry::Epoch }).unwrap();
            steps.take_back().unwrap();
            steps.push(entry).unwrap();
        }
        let (mut read, mut places) = (Vec::new(), Vec::new());
        let end = steps.end;
        steps
            .read::<io::Error>(0, end, |at, entry| {
                read.push(entry);
                places.push(at);
                Ok(())
            })
            .unwrap();
        assert_eq!(read, kept);
        // a mark; a sample has 12 bytes and 8 for each value more
        assert_eq!((places, end), (vec![0, 37, 38, 59, 72], 73));
    }
}
