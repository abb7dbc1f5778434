//! Quantities that are derived from the records of a run.

use crate::units::time::Time;
use std::sync::Arc;

/// A table of numbers at one time, such as the share of each sensor in the information about each
/// state. Log, recording and page take any such table: see [`crate::model::stream::Sink::derive`].
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// Time, on the run's clock.
    pub time: Time,
    /// Name of the quantity.
    pub name: Arc<str>,
    /// Unit of the values; empty for a ratio.
    pub unit: Arc<str>,
    /// Names of the rows.
    pub rows: Arc<[String]>,
    /// Names of the columns.
    pub columns: Arc<[String]>,
    /// Values, row by row.
    pub values: Vec<f64>,
}

impl Derived {
    /// The rows, each with its name and its values.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[f64])> {
        let values = self.values.chunks_exact(self.columns.len().max(1));
        self.rows.iter().map(String::as_str).zip(values)
    }
}
