//! Error-free readings of a trajectory, which the runs of a campaign share.
//!
//! A run of a campaign differs from the others in its noise and in the values that it draws. The
//! trajectory is the same, and so are the motion at the time of a sample and the increments over its
//! interval. The first run that computes them publishes them for the others.

use crate::Trajectory;
use nalgebra::Vector3;
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::units::time::Time;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Memory of the readings of one trajectory, bytes: 2.6 hours of an IMU of 100 Hz. Later readings
/// are computed in each run.
const LIMIT: usize = 64 << 20;
/// Readings that are published at once.
const CHUNK: usize = 1024;

/// Readings of every sensor on one trajectory.
#[derive(Debug)]
pub(crate) struct Ideal {
    pub(crate) trajectory: Trajectory,
    sensors: Vec<(Arc<Increments>, Arc<Motions>)>,
}

/// Integrals of angular rate and specific force, by the interval.
type Increments = Table<(Time, Time), (Vector3<f64>, Vector3<f64>)>;
/// Motions, by their time.
type Motions = Table<Time, Motion>;

impl Ideal {
    /// No readings yet, of that many sensors.
    pub(crate) fn new(trajectory: Trajectory, sensors: usize) -> Self {
        Self::limited(trajectory, sensors, LIMIT)
    }

    fn limited(trajectory: Trajectory, sensors: usize, limit: usize) -> Self {
        let left = Arc::new(AtomicUsize::new(limit));
        let tables = || (Arc::new(Table::new(limit, &left)), Arc::new(Table::new(limit, &left)));
        Self { trajectory, sensors: (0..sensors).map(|_| tables()).collect() }
    }

    /// Reader for one sensor in one run.
    pub(crate) fn reader(&self, sensor: usize) -> Option<IdealReader> {
        let (increments, motions) = self.sensors.get(sensor)?;
        Some(IdealReader {
            increments: Reader::new(Arc::clone(increments)),
            motions: Reader::new(Arc::clone(motions)),
        })
    }
}

/// Reads and extends the readings of one sensor.
#[derive(Debug)]
pub(crate) struct IdealReader {
    pub(crate) increments: Reader<(Time, Time), (Vector3<f64>, Vector3<f64>)>,
    pub(crate) motions: Reader<Time, Motion>,
}

/// Values of one chunk with their keys; `None` where the run that published them had no sample.
type Values<K, V> = Box<[Option<(K, V)>]>;

/// Values by the number of the sample, in chunks that never change once they are published.
#[derive(Debug)]
struct Table<K, V> {
    chunks: Vec<OnceLock<Values<K, V>>>,
    /// Memory left for all tables of the trajectory, bytes.
    left: Arc<AtomicUsize>,
}

impl<K, V> Table<K, V> {
    const BYTES: usize = CHUNK * size_of::<Option<(K, V)>>();

    fn new(limit: usize, left: &Arc<AtomicUsize>) -> Self {
        let chunks = (0..limit / Self::BYTES).map(|_| OnceLock::new()).collect();
        Self { chunks, left: Arc::clone(left) }
    }
}

/// Reader of a table, which collects the values of a chunk that no run has published.
#[derive(Debug)]
pub(crate) struct Reader<K: Copy, V: Copy> {
    table: Arc<Table<K, V>>,
    /// Number of the collected chunk.
    chunk: usize,
    collected: Vec<Option<(K, V)>>,
}

impl<K: Copy + PartialEq, V: Copy> Reader<K, V> {
    fn new(table: Arc<Table<K, V>>) -> Self {
        Self { table, chunk: 0, collected: Vec::new() }
    }

    /// Value of sample `number`, published for the same key or else computed. A sample that asks
    /// for several values shares the first.
    pub(crate) fn value(&mut self, number: usize, key: K, compute: impl FnOnce() -> V) -> V {
        let (chunk, place) = (number / CHUNK, number % CHUNK);
        match self.table.chunks.get(chunk).map(OnceLock::get) {
            None => compute(),
            Some(Some(values)) => match values[place] {
                Some((found, value)) if found == key => value,
                _ => compute(),
            },
            Some(None) => {
                if chunk != self.chunk {
                    self.publish();
                    self.chunk = chunk;
                }
                self.collected.resize(CHUNK, None);
                let value = compute();
                self.collected[place].get_or_insert((key, value));
                value
            }
        }
    }
}

impl<K: Copy, V: Copy> Reader<K, V> {
    /// Publishes the collected values, unless another run has, or the memory is used up.
    fn publish(&mut self) {
        if self.collected.is_empty() {
            return;
        }
        let Table { chunks, left } = &*self.table;
        let bytes = Table::<K, V>::BYTES;
        let take = |left: usize| left.checked_sub(bytes);
        if chunks[self.chunk].get().is_none()
            && left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, take).is_ok()
            && chunks[self.chunk].set(self.collected.as_slice().into()).is_err()
        {
            left.fetch_add(bytes, Ordering::Relaxed);
        }
        self.collected.clear();
    }
}

impl<K: Copy, V: Copy> Drop for Reader<K, V> {
    fn drop(&mut self) {
        self.publish();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table of numbers for `chunks` chunks.
    fn table(chunks: usize) -> Arc<Table<usize, f64>> {
        let limit = chunks * Table::<usize, f64>::BYTES;
        Arc::new(Table::new(limit, &Arc::new(AtomicUsize::new(limit))))
    }

    /// Reads the numbers `range` as their square roots, and returns how many were computed.
    fn read(table: &Arc<Table<usize, f64>>, range: std::ops::Range<usize>) -> usize {
        let (mut reader, mut computed) = (Reader::new(Arc::clone(table)), 0);
        for k in range {
            let value = reader.value(k, k, || {
                computed += 1;
                (k as f64).sqrt()
            });
            assert_eq!(value, (k as f64).sqrt());
        }
        computed
    }

    #[test]
    fn a_second_run_computes_only_what_exceeds_the_memory() {
        let table = table(3);
        assert_eq!(read(&table, 0..5 * CHUNK), 5 * CHUNK);
        assert_eq!(read(&table, 0..5 * CHUNK), 2 * CHUNK);
        assert_eq!(table.left.load(Ordering::Relaxed), 0);
    }

    #[test]
    fn several_tables_have_one_limit() {
        let a = table(3);
        let b = Arc::new(Table::new(3 * Table::<usize, f64>::BYTES, &a.left));
        read(&a, 0..2 * CHUNK);
        read(&b, 0..3 * CHUNK);
        assert_eq!((read(&a, 0..2 * CHUNK), read(&b, 0..3 * CHUNK)), (0, 2 * CHUNK));
    }

    #[test]
    fn a_value_is_shared_for_the_same_key_alone() {
        let table = table(1);
        let value =
            |number, key, made: f64| Reader::new(Arc::clone(&table)).value(number, key, || made);
        assert_eq!(value(7, 70, 1.0), 1.0); // published when the reader is dropped
        assert_eq!(value(7, 70, 2.0), 1.0);
        assert_eq!(value(7, 71, 3.0), 3.0); // another time, such as that of another lag
        assert_eq!(value(8, 70, 4.0), 4.0); // a sample that the first run lost
    }
}
