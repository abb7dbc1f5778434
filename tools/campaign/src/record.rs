//! What a job leaves.

use crate::columns::Columns;

/// What one job leaves: a bound or a run of one point of the grid.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// The bound of a point.
    Bound(BoundRecord),
    /// One run of a point.
    Run(RunRecord),
}

/// The Cramer-Rao bound of a point over time.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundRecord {
    /// The point of the grid.
    pub point: usize,
    /// One row an epoch: the epoch's number, its time (s), the least 1-sigma of every component of a filter and of a smoother
    /// in its display unit; NaN where the point has no such state.
    pub rows: Vec<(i64, f64, Vec<f64>, Vec<f64>)>,
}

impl BoundRecord {
    /// The row of an epoch: of its number, or the last before.
    pub fn at(&self, epoch: i64) -> Option<&(i64, f64, Vec<f64>, Vec<f64>)> {
        self.rows.iter().rfind(|r| r.0 <= epoch)
    }
}

/// One run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunRecord {
    /// The point of the grid.
    pub point: usize,
    /// The number of the run, from 1.
    pub run: usize,
    /// Its seed.
    pub seed: u64,
    /// One row an epoch.
    pub rows: Vec<Row>,
    /// Why it ended early, if it did.
    pub failure: Option<String>,
}

/// A run at one epoch: see [`Row::width`] for the order of the numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The number of the epoch on the campaign's grid.
    pub epoch: i64,
    /// Its time, s.
    pub time: f64,
    /// Errors and sigmas of the components in turn, NEES of the whole state, NEES of each block, and for each sensor since
    /// the row before: samples used, samples gated, sum of the NIS, of its expectation and of its variance.
    pub values: Vec<f64>,
}

/// What is summed for a sensor: samples used, samples gated, and of the used ones the NIS, what the chi-square distribution,
/// cut at the gate, expects of it, and its variance.
pub const SENSOR: [&str; 5] = ["used", "gated", "nis_sum", "nis_expected", "nis_variance"];

impl Row {
    /// The number of values.
    pub fn width(columns: &Columns) -> usize {
        2 * columns.components.len()
            + 1
            + columns.blocks.len()
            + SENSOR.len() * columns.sensors.len()
    }

    /// Where the whole state's NEES stands; those of the blocks follow.
    pub fn nees_at(columns: &Columns) -> usize {
        2 * columns.components.len()
    }

    /// Where a sensor's sums begin.
    pub fn sensor_at(columns: &Columns, sensor: usize) -> usize {
        Self::nees_at(columns) + 1 + columns.blocks.len() + SENSOR.len() * sensor
    }

    /// The names of the values.
    pub fn names(columns: &Columns) -> Vec<String> {
        let mut names = Vec::with_capacity(Self::width(columns));
        for c in &columns.components {
            names.extend([format!("{}.error", c.name()), format!("{}.sigma", c.name())]);
        }
        names.push("nees".into());
        names.extend(columns.blocks.iter().map(|b| format!("{}.nees", b.name)));
        names.extend(columns.sensors.iter().flat_map(|s| SENSOR.map(|what| format!("{s}.{what}"))));
        names
    }
}
