//! Records: the results of jobs.

use crate::columns::Columns;
use navfuse_core::model::record::verdict::VerdictLevel;

/// Result of one job: the bound of a point, or one run.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// Bound of a point.
    Bound(BoundRecord),
    /// One run of a point.
    Run(RunRecord),
}

/// The Cramer-Rao bound of a point over time.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundRecord {
    /// Index of the point in the grid.
    pub point: usize,
    /// Rows of epoch number, time (s), filtered bound and smoothed bound. The bounds are the
    /// smallest possible 1-sigma of every component in its display unit; NaN if the point lacks the
    /// state.
    pub rows: Vec<(i64, f64, Vec<f64>, Vec<f64>)>,
}

impl BoundRecord {
    /// Returns the row of an epoch, or the last row before it.
    pub fn at(&self, epoch: i64) -> Option<&(i64, f64, Vec<f64>, Vec<f64>)> {
        self.rows.iter().rfind(|r| r.0 <= epoch)
    }
}

/// One run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunRecord {
    /// Index of the point in the grid.
    pub point: usize,
    /// Number of the run, from 1.
    pub run: usize,
    /// Seed of the run.
    pub seed: u64,
    /// Rows, one per epoch.
    pub rows: Vec<Row>,
    /// Reason why the run ended early, if it did.
    pub failure: Option<String>,
    /// Set if the run reports that its result must not be used.
    pub unusable: bool,
    /// Sensors and processes that the run's warnings name, in order of their names. The files of a
    /// campaign do not contain them.
    pub warned: Vec<String>,
    /// Sensor, state or process that the verdict of the run names first; none if it is consistent.
    /// The files of a campaign do not contain it.
    pub blamed: Option<String>,
    /// Level of the verdict of the run alone, which does not know the errors.
    pub judged: VerdictLevel,
}

/// State of a run at one epoch; [`Row::width`] gives the order of the numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the epoch on the campaign's grid.
    pub epoch: i64,
    /// Time, s.
    pub time: f64,
    /// Error and sigma of each component in turn, NEES of the whole state, NEES of each block, and
    /// the sums of each sensor since the previous row (see `SENSOR`).
    pub values: Vec<f64>,
}

/// Sums of a sensor: used samples, gated samples, and over the used samples the NIS, its
/// expectation and its variance, both of the chi-square distribution truncated at the gate.
pub const SENSOR: [&str; 5] = ["used", "gated", "nis_sum", "nis_expected", "nis_variance"];

impl Row {
    /// Returns the number of values.
    pub fn width(columns: &Columns) -> usize {
        2 * columns.components.len()
            + 1
            + columns.blocks.len()
            + SENSOR.len() * columns.sensors.len()
    }

    /// Returns the index of the whole state's NEES; the NEES of the blocks follow.
    pub fn nees_at(columns: &Columns) -> usize {
        2 * columns.components.len()
    }

    /// Returns the index of a sensor's first sum.
    pub fn sensor_at(columns: &Columns, sensor: usize) -> usize {
        Self::nees_at(columns) + 1 + columns.blocks.len() + SENSOR.len() * sensor
    }

    /// Returns the names of the values.
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
