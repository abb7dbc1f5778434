//! Statistics over the runs of a point, as functions of time.

use crate::columns::Columns;
use crate::outcome::Outcomes;
use crate::record::{BoundRecord, Row, RunRecord, SENSOR};
use navfuse_core::model::record::verdict::VerdictLevel;
use serde::Serialize;
use std::collections::BTreeMap;

/// Sums of one point. Records are added in order, so every sum is the same to the bit for any
/// number of threads or shards.
#[derive(Clone, Debug)]
pub struct PointStatistics {
    from: f64,
    /// Runs that reached their end.
    pub runs: usize,
    /// Runs that ended early: number and reason.
    pub failures: Vec<(usize, String)>,
    /// Runs that reached their end, each with the NEES of the whole state there.
    pub nees: Vec<(usize, f64)>,
    /// Runs by what a user learns from them alone.
    pub outcomes: Outcomes,
    /// Runs by the level of their own verdict.
    pub judged: Judged,
    /// Cramer-Rao bound.
    pub bound: Option<BoundRecord>,
    epochs: BTreeMap<i64, EpochStatistics>,
}

/// Number of runs at each level of their own verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Judged {
    /// Consistent runs.
    pub consistent: usize,
    /// Doubtful runs.
    pub doubtful: usize,
    /// Runs whose result must not be used.
    pub do_not_use: usize,
}

impl Judged {
    fn add(&mut self, level: VerdictLevel) {
        *match level {
            VerdictLevel::Consistent => &mut self.consistent,
            VerdictLevel::Doubtful => &mut self.doubtful,
            VerdictLevel::DoNotUse => &mut self.do_not_use,
        } += 1;
    }
}

/// Sums of one epoch.
#[derive(Clone, Debug)]
pub struct EpochStatistics {
    /// Time, s.
    pub time: f64,
    components: Vec<Moments>,
    /// Mean NEES of the whole state, then of each block.
    nees: Vec<Mean>,
    sensors: Vec<[f64; SENSOR.len()]>,
}

/// Sums of the errors and variances of a component.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    count: usize,
    error: f64,
    error_squared: f64,
    known: usize,
    variance: f64,
    /// Sum of squares of error over sigma, and its number of terms.
    normalised_squared: f64,
    normalised: usize,
}

impl Moments {
    /// Returns the root mean square error, in the display unit.
    pub fn rmse(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.error_squared / self.count as f64).sqrt())
    }

    /// Returns the mean error.
    pub fn mean_error(&self) -> Option<f64> {
        (self.count > 0).then(|| self.error / self.count as f64)
    }

    /// Returns the root of the mean variance.
    pub fn sigma(&self) -> Option<f64> {
        (self.known > 0).then(|| (self.variance / self.known as f64).sqrt())
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.error += other.error;
        self.error_squared += other.error_squared;
        self.known += other.known;
        self.variance += other.variance;
        self.normalised_squared += other.normalised_squared;
        self.normalised += other.normalised;
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    count: usize,
    sum: f64,
}

/// Sums of a sensor's NIS over many samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NisSums {
    /// Used samples.
    pub used: f64,
    /// Gated samples.
    pub gated: f64,
    /// Sum of the NIS.
    pub nis: f64,
    /// Expectation of that sum.
    pub expected: f64,
    /// Variance of that sum.
    pub variance: f64,
}

impl NisSums {
    fn new([used, gated, nis, expected, variance]: [f64; SENSOR.len()]) -> Self {
        Self { used, gated, nis, expected, variance }
    }
}

impl PointStatistics {
    /// Creates empty statistics; epochs from the time `from` on (s) enter the verdict.
    pub fn new(from: Option<f64>) -> Self {
        Self {
            from: from.unwrap_or(f64::NEG_INFINITY),
            runs: 0,
            failures: Vec::new(),
            nees: Vec::new(),
            outcomes: Outcomes::default(),
            judged: Judged::default(),
            bound: None,
            epochs: BTreeMap::new(),
        }
    }

    /// Adds a run. A run that failed counts up to its failure.
    pub fn add(&mut self, columns: &Columns, run: &RunRecord) {
        self.outcomes.add(columns, run);
        self.judged.add(run.judged);
        match &run.failure {
            None => {
                self.runs += 1;
                let nees =
                    run.rows.last().map_or(f64::NAN, |row| row.values[Row::nees_at(columns)]);
                if !nees.is_nan() {
                    self.nees.push((run.run, nees));
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

    /// Returns the runs that reached their end, in order of the NEES there, the largest first.
    pub fn worst(&self) -> Vec<(usize, f64)> {
        let mut runs = self.nees.clone();
        runs.sort_by(|a, b| b.1.total_cmp(&a.1));
        runs
    }

    /// Iterates over the epochs in order of time, each with its number.
    pub fn epochs(&self) -> impl DoubleEndedIterator<Item = (i64, &EpochStatistics)> {
        self.epochs.iter().map(|(number, epoch)| (*number, epoch))
    }

    /// Iterates over the epochs that enter the verdict.
    pub fn judged(&self) -> impl DoubleEndedIterator<Item = &EpochStatistics> {
        self.epochs.values().filter(|e| e.time >= self.from)
    }

    /// Returns the errors of a component over all epochs that enter the verdict.
    pub fn over_run(&self, component: usize) -> Moments {
        let mut all = Moments::default();
        self.judged().for_each(|epoch| all.add(&epoch.components[component]));
        all
    }

    /// Returns the bound of a smoother, root mean square over the epochs that enter the verdict and
    /// have a known error.
    pub fn smoothed_bound(&self, component: usize) -> Option<f64> {
        let bound = self.bound.as_ref()?;
        let (mut count, mut squares) = (0.0, 0.0);
        let epochs = self.epochs.iter().filter(|(_, epoch)| epoch.time >= self.from);
        for (number, _) in epochs.filter(|(_, epoch)| epoch.components[component].count > 0) {
            let row = bound.at(*number)?;
            count += 1.0;
            squares += row.3[component] * row.3[component];
        }
        Some((squares / count).sqrt()).filter(|bound| bound.is_finite())
    }

    /// Returns the NIS of a sensor over all epochs that enter the verdict.
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
            let ratio = error / sigma;
            if ratio.is_finite() {
                m.normalised += 1;
                m.normalised_squared += ratio * ratio;
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

    /// Returns the root mean square error of a component, in its display unit.
    pub fn rmse(&self, component: usize) -> Option<f64> {
        self.components[component].rmse()
    }

    /// Returns the mean error of a component.
    pub fn mean_error(&self, component: usize) -> Option<f64> {
        self.components[component].mean_error()
    }

    /// Returns the root of the mean variance of a component, which a consistent filter's RMSE
    /// equals on average.
    pub fn sigma(&self, component: usize) -> Option<f64> {
        self.components[component].sigma()
    }

    /// Returns the root mean square of the error over its sigma, which is 1 for a consistent filter.
    pub fn normalised(&self, component: usize) -> Option<f64> {
        let m = &self.components[component];
        (m.normalised > 0).then(|| (m.normalised_squared / m.normalised as f64).sqrt())
    }

    /// Returns the mean NEES of the whole state (0) or of a block (from 1), and the number of runs
    /// in it.
    pub fn anees(&self, of: usize) -> Option<(f64, usize)> {
        let m = &self.nees[of];
        (m.count > 0).then(|| (m.sum / m.count as f64, m.count))
    }

    /// Returns the NIS of a sensor since the previous epoch.
    pub fn nis(&self, sensor: usize) -> NisSums {
        NisSums::new(self.sensors[sensor])
    }
}
