//! Outcome of the runs of a point for a user who does not know the truth: errors that fit their
//! sigma, or a run that warns.

use crate::columns::Columns;
use crate::record::RunRecord;
use crate::statistics::PointStatistics;
use navfuse_core::model::record::verdict::VerdictLevel;
use serde::Serialize;
use std::collections::BTreeMap;

/// Largest error of a state at the end of a run, in sigma, that counts as fitting its sigma.
/// Among 20 Gaussian errors one is larger in 1 of 108 runs.
pub const LIMIT: f64 = 3.5;

/// Runs by what a user learns from them alone.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Outcomes {
    /// Runs whose errors are all within [`LIMIT`] sigma at the end.
    pub within: usize,
    /// Runs that ended early, or reported that their result must not be used.
    pub refused: usize,
    /// Runs that reported that their result is doubtful.
    pub doubtful: usize,
    /// Runs with a larger error that did not report that their result must not be used.
    pub missed: usize,
    /// Sensors and processes that warnings name, with the number of runs that name them.
    pub warned: BTreeMap<String, usize>,
    /// Sensors, states and processes that the verdicts name first, with the number of runs.
    pub blamed: BTreeMap<String, usize>,
}

impl Outcomes {
    /// Adds a run.
    pub(crate) fn add(&mut self, columns: &Columns, run: &RunRecord) {
        let refused = run.failure.is_some() || run.unusable;
        let within = run.failure.is_none()
            && run.rows.last().is_some_and(|row| {
                (0..columns.components.len()).all(|k| {
                    let (error, sigma) = (row.values[2 * k], row.values[2 * k + 1]);
                    error.is_nan() || sigma.is_nan() || error.abs() <= LIMIT * sigma
                })
            });
        self.within += usize::from(within);
        self.refused += usize::from(refused);
        self.doubtful += usize::from(!refused && run.judged == VerdictLevel::Doubtful);
        self.missed += usize::from(!within && !refused);
        for name in &run.warned {
            *self.warned.entry(name.clone()).or_default() += 1;
        }
        if let Some(name) = &run.blamed {
            *self.blamed.entry(name.clone()).or_default() += 1;
        }
    }
}

/// The component with the largest error relative to its sigma.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstState {
    /// Name of the component.
    pub name: String,
    /// Root mean square of error over sigma, over the runs; 1 for a consistent filter.
    pub ratio: f64,
    /// Time, s.
    pub time_s: f64,
}

impl PointStatistics {
    /// The worst component at the end of the runs.
    pub fn worst_at_end(&self, columns: &Columns) -> Option<WorstState> {
        self.worst_of(columns, true)
    }

    /// The worst component at any epoch that enters the verdict.
    pub fn worst_ever(&self, columns: &Columns) -> Option<WorstState> {
        self.worst_of(columns, false)
    }

    fn worst_of(&self, columns: &Columns, at_end: bool) -> Option<WorstState> {
        let count = if at_end { 1 } else { usize::MAX };
        let all = self.judged().rev().take(count).flat_map(|epoch| {
            let of = |k: usize| epoch.normalised(k).map(|ratio| (k, ratio, epoch.time));
            (0..columns.components.len()).filter_map(of)
        });
        let (k, ratio, time_s) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(WorstState { name: columns.components[k].name(), ratio, time_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::{BlockColumns, Component};
    use crate::record::Row;

    /// Campaign of one scalar state without sensors.
    fn columns() -> Columns {
        let text = |text: &str| text.to_owned();
        let (state, component, unit) = (text("depth"), text("bias"), text("m"));
        let block = BlockColumns { name: state.clone(), dimension: 1, known: true };
        let components = vec![Component { state, component, unit }];
        Columns { components, blocks: vec![block], sensors: Vec::new() }
    }

    /// Run of two epochs with these errors and a sigma of 1.
    fn run(errors: [f64; 2]) -> RunRecord {
        let row = |(epoch, error): (i64, f64)| {
            let (time, nees) = (epoch as f64, error * error);
            Row { epoch, time, values: vec![error, 1.0, nees, nees] }
        };
        let rows = (0..).zip(errors).map(row).collect();
        RunRecord { rows, ..RunRecord::default() }
    }

    #[test]
    fn a_run_is_within_its_sigma_or_refused_or_missed() {
        let (columns, mut point) = (columns(), PointStatistics::new(None));
        let (warned, blamed) = (vec!["depth".to_owned()], Some("imu".to_owned()));
        point.add(&columns, &run([9.0, 3.0]));
        point.add(&columns, &RunRecord { judged: VerdictLevel::Doubtful, ..run([0.0, -4.0]) });
        point.add(&columns, &RunRecord { unusable: true, warned, blamed, ..run([0.0, 4.0]) });
        point.add(&columns, &RunRecord { failure: Some("cut".to_owned()), ..run([0.0, 0.0]) });
        let [warned, blamed] = ["depth", "imu"].map(|name| BTreeMap::from([(name.to_owned(), 1)]));
        let (within, refused, doubtful, missed) = (1, 2, 1, 1);
        let expected = Outcomes { within, refused, doubtful, missed, warned, blamed };
        assert_eq!(point.outcomes, expected);
    }

    #[test]
    fn the_worst_state_has_the_largest_ratio_at_the_end_or_at_any_time() {
        let (columns, mut point) = (columns(), PointStatistics::new(None));
        point.add(&columns, &run([9.0, 3.0]));
        point.add(&columns, &run([0.0, -4.0]));
        let rms = |a: f64, b: f64| f64::midpoint(a * a, b * b).sqrt();
        let name = "depth.bias".to_owned();
        let end = WorstState { name: name.clone(), ratio: rms(3.0, 4.0), time_s: 1.0 };
        let ever = WorstState { name, ratio: rms(9.0, 0.0), time_s: 0.0 };
        assert_eq!(point.worst_at_end(&columns), Some(end));
        assert_eq!(point.worst_ever(&columns), Some(ever));
    }
}
