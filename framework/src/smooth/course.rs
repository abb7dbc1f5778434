//! The smoothed trajectory at every step of the filter, at which a further pass linearises.

use super::adjoint::Adjoint;
use super::change::Change;
use super::tape::Rows;
use crate::compose::course::Course;
use crate::state::covariance::Covariance;
use crate::state::{Layout, State};
use crate::units::time::Time;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Number of states that are read at once.
const CHUNK: u64 = 256;

/// Length of the record of a step: time, values, lower triangle of the covariance, and the offset
/// of a further pass.
pub(super) fn length(layout: &Layout) -> usize {
    let n = layout.tangent;
    1 + layout.ambient + n * (n + 1) / 2 + n
}

/// Adds the record of a step to a row of numbers.
pub(super) fn write(state: &State, covariance: &Covariance, offset: &[f64], out: &mut Vec<f64>) {
    out.push(f64::from_bits(state.time.nanos().cast_unsigned()));
    out.extend_from_slice(&state.values);
    covariance.rows().enumerate().for_each(|(i, row)| out.extend_from_slice(&row[..=i]));
    out.extend_from_slice(offset);
}

/// Writes the smoothed trajectory during a backward pass, the last state first.
pub(super) struct Writer {
    layout: Arc<Layout>,
    rows: Rows,
    /// State at which the filter linearised, the smoothed one, and the error between them.
    from: State,
    to: State,
    delta: Vec<f64>,
    row: Vec<f64>,
    last: Option<Time>,
    /// Largest change by this pass.
    pub(super) change: Change,
}

impl Writer {
    pub(super) fn new(layout: &Arc<Layout>) -> io::Result<Self> {
        Ok(Self {
            rows: Rows::new(1 + layout.ambient)?,
            from: layout.initial_state(),
            to: layout.initial_state(),
            delta: vec![0.0; layout.tangent],
            row: Vec::with_capacity(1 + layout.ambient),
            last: None,
            change: Change::default(),
            layout: Arc::clone(layout),
        })
    }

    /// Writes the smoothed state of a step, `x [+] (d + P lambda)`. `sigmas` are those of the
    /// smoothed estimate that is recorded next, or zero at the end of the run.
    pub(super) fn push(
        &mut self,
        adjoint: &Adjoint,
        numbers: &[f64],
        sigmas: &[f64],
    ) -> io::Result<()> {
        let n = self.layout.tangent;
        let (time, rest) = numbers.split_at(1);
        let (values, rest) = rest.split_at(self.layout.ambient);
        let (triangle, offset) = rest.split_at(n * (n + 1) / 2);
        let now = Time::from_nanos(time[0].to_bits().cast_signed());
        // the smoothed state before and after a clone of one time is the same
        if self.last.replace(now) == Some(now) {
            return Ok(());
        }
        adjoint.project(triangle, &mut self.delta);
        for (i, (delta, d)) in self.delta.iter_mut().zip(offset).enumerate() {
            *delta += d;
            if sigmas[i] > 0.0 {
                self.change.take(delta.abs() / sigmas[i], i, now);
            }
        }
        self.from.values.copy_from_slice(values);
        self.layout.displace(&self.from, &mut self.delta, &mut self.to);
        self.row.clear();
        self.row.extend_from_slice(time);
        self.row.extend_from_slice(&self.to.values);
        self.rows.push(&self.row)
    }

    /// The trajectory in order of time.
    pub(super) fn finish(self) -> io::Result<Trajectory> {
        let (file, count) = self.rows.into_file()?;
        Ok(Trajectory { file, count, width: self.row.len(), chunk: Vec::new(), first: 0 })
    }
}

/// A trajectory in a temporary file, whose last state is the first one in the file.
pub(super) struct Trajectory {
    file: File,
    count: u64,
    width: usize,
    /// States from `first` on, the last one first.
    chunk: Vec<f64>,
    first: u64,
}

impl Trajectory {
    /// Reads the state of a place; the chunk stays in memory.
    fn row(&mut self, place: u64) -> io::Result<&[f64]> {
        let held = (self.chunk.len() / self.width.max(1)) as u64;
        if !(self.first..self.first + held).contains(&place) {
            let end = (place + CHUNK).min(self.count);
            let mut bytes = vec![0; (end - place) as usize * 8 * self.width];
            self.file.seek(SeekFrom::Start((self.count - end) * 8 * self.width as u64))?;
            self.file.read_exact(&mut bytes)?;
            self.chunk.clear();
            self.chunk.extend(bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)));
            self.first = place;
        }
        let held = self.chunk.len() / self.width;
        let row = held - 1 - (place - self.first) as usize;
        Ok(&self.chunk[row * self.width..][..self.width])
    }
}

impl Course for Trajectory {
    fn read(&mut self, mut place: u64, time: Time, values: &mut [f64]) -> io::Result<Option<u64>> {
        while place < self.count {
            let row = self.row(place)?;
            let at = Time::from_nanos(row[0].to_bits().cast_signed());
            if at > time {
                break;
            }
            if at == time {
                values.copy_from_slice(&row[1..]);
                return Ok(Some(place + 1));
            }
            place += 1;
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::smooth::means::Points;

    /// States at 1, 2 and 3 s with the values 10, 20 and 30.
    fn reads(course: &mut dyn Course) {
        let mut values = [0.0];
        let mut read = |place, time: f64| {
            let at = course.read(place, Time::from_seconds(time).unwrap(), &mut values).unwrap();
            at.map(|at| (at, values[0]))
        };
        assert_eq!(read(0, 1.0), Some((1, 10.0)));
        assert_eq!(read(1, 1.5), None);
        assert_eq!(read(1, 3.0), Some((3, 30.0)));
        assert_eq!(read(3, 4.0), None);
    }

    #[test]
    fn a_trajectory_is_read_forwards_and_has_no_state_between_its_own() {
        let times = [3, 2, 1].map(|s| Time::from_nanos(s * 1_000_000_000));
        reads(&mut Points { width: 1, times: times.to_vec(), values: vec![30.0, 20.0, 10.0] });
        let mut rows = Rows::new(2).unwrap();
        for (time, value) in times.into_iter().zip([30.0, 20.0, 10.0]) {
            rows.push(&[f64::from_bits(time.nanos().cast_unsigned()), value]).unwrap();
        }
        let (file, count) = rows.into_file().unwrap();
        reads(&mut Trajectory { file, count, width: 2, chunk: Vec::new(), first: 0 });
    }
}
