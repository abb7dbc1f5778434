//! What the runs of a point say together, over time.

use crate::columns::Columns;
use crate::record::{BoundRecord, Row, RunRecord, SENSOR};
use std::collections::BTreeMap;

/// The sums of one point; records are added in order, so that every sum is the same however they were made.
#[derive(Clone, Debug)]
pub struct PointStatistics {
    from: f64,
    /// Runs that went to their end.
    pub runs: usize,
    /// Runs that ended early: number and reason.
    pub failures: Vec<(usize, String)>,
    /// The run that went to its end with the largest NEES of the whole state there, and that.
    pub worst: Option<(usize, f64)>,
    /// The bound.
    pub bound: Option<BoundRecord>,
    epochs: BTreeMap<i64, EpochStatistics>,
}

/// The sums of one epoch.
#[derive(Clone, Debug)]
pub struct EpochStatistics {
    /// Its time, s.
    pub time: f64,
    components: Vec<Moments>,
    /// Of the whole state, then of each block.
    nees: Vec<Mean>,
    sensors: Vec<[f64; SENSOR.len()]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: usize,
    error: f64,
    error_squared: f64,
    known: usize,
    variance: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    count: usize,
    sum: f64,
}

/// The NIS of a sensor over many samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NisSums {
    /// Samples used.
    pub used: f64,
    /// Samples gated.
    pub gated: f64,
    /// Sum of the NIS.
    pub nis: f64,
    /// Its expectation.
    pub expected: f64,
    /// Its variance.
    pub variance: f64,
}

impl NisSums {
    fn new([used, gated, nis, expected, variance]: [f64; SENSOR.len()]) -> Self {
        Self { used, gated, nis, expected, variance }
    }
}

impl PointStatistics {
    /// No runs yet; they are judged from that time on, s.
    pub fn new(from: Option<f64>) -> Self {
        Self {
            from: from.unwrap_or(f64::NEG_INFINITY),
            runs: 0,
            failures: Vec::new(),
            worst: None,
            bound: None,
            epochs: BTreeMap::new(),
        }
    }

    /// Adds a run. One that failed counts as far as it went.
    pub fn add(&mut self, columns: &Columns, run: &RunRecord) {
        match &run.failure {
            None => {
                self.runs += 1;
                let nees =
                    run.rows.last().map_or(f64::NAN, |row| row.values[Row::nees_at(columns)]);
                if !nees.is_nan() && self.worst.is_none_or(|(_, worst)| nees > worst) {
                    self.worst = Some((run.run, nees));
                }
            }
            Some(reason) => {
                self.failures.push((run.run, reason.clone()));
                self.failures.sort_by_key(|f| f.0);
            }
        }
        for row in &run.rows {
            self.epochs
                .entry(row.epoch)
                .or_insert_with(|| EpochStatistics::new(columns, row.time))
                .add(columns, row);
        }
    }

    /// The epochs in order of time, each with its number.
    pub fn epochs(&self) -> impl DoubleEndedIterator<Item = (i64, &EpochStatistics)> {
        self.epochs.iter().map(|(number, epoch)| (*number, epoch))
    }

    /// The epochs that are judged.
    pub fn judged(&self) -> impl DoubleEndedIterator<Item = &EpochStatistics> {
        self.epochs.values().filter(|e| e.time >= self.from)
    }

    /// The NIS of a sensor over all epochs that are judged.
    pub fn nis(&self, sensor: usize) -> NisSums {
        let mut sums = [0.0; SENSOR.len()];
        for epoch in self.judged() {
            sums.iter_mut().zip(epoch.sensors[sensor]).for_each(|(s, x)| *s += x);
        }
        NisSums::new(sums)
    }
}

impl EpochStatistics {
    fn new(columns: &Columns, time: f64) -> Self {
        Self {
            time,
            components: vec![Moments::default(); columns.components.len()],
            nees: vec![Mean::default(); 1 + columns.blocks.len()],
            sensors: vec![[0.0; SENSOR.len()]; columns.sensors.len()],
        }
    }

    fn add(&mut self, columns: &Columns, row: &Row) {
        for (k, m) in self.components.iter_mut().enumerate() {
            let (error, sigma) = (row.values[2 * k], row.values[2 * k + 1]);
            if !error.is_nan() {
                m.count += 1;
                m.error += error;
                m.error_squared += error * error;
            }
            if !sigma.is_nan() {
                m.known += 1;
                m.variance += sigma * sigma;
            }
        }
        let nees = &row.values[Row::nees_at(columns)..];
        for (mean, value) in self.nees.iter_mut().zip(nees).filter(|(_, v)| !v.is_nan()) {
            mean.count += 1;
            mean.sum += value;
        }
        for (k, sums) in self.sensors.iter_mut().enumerate() {
            let values = &row.values[Row::sensor_at(columns, k)..];
            sums.iter_mut().zip(values).for_each(|(s, x)| *s += x);
        }
    }

    /// Root mean square error of a component, in its display unit.
    pub fn rmse(&self, component: usize) -> Option<f64> {
        let m = &self.components[component];
        (m.count > 0).then(|| (m.error_squared / m.count as f64).sqrt())
    }

    /// Mean error of a component.
    pub fn mean_error(&self, component: usize) -> Option<f64> {
        let m = &self.components[component];
        (m.count > 0).then(|| m.error / m.count as f64)
    }

    /// The root of the mean variance of a component: what its RMSE should be.
    pub fn sigma(&self, component: usize) -> Option<f64> {
        let m = &self.components[component];
        (m.known > 0).then(|| (m.variance / m.known as f64).sqrt())
    }

    /// Mean NEES of the whole state (0) or of a block (from 1), and of how many runs.
    pub fn anees(&self, of: usize) -> Option<(f64, usize)> {
        let m = &self.nees[of];
        (m.count > 0).then(|| (m.sum / m.count as f64, m.count))
    }

    /// The NIS of a sensor since the epoch before.
    pub fn nis(&self, sensor: usize) -> NisSums {
        NisSums::new(self.sensors[sensor])
    }
}
