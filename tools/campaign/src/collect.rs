//! Recording of one run.

use crate::campaign::Job;
use crate::columns::{Columns, Places};
use crate::grid::Grid;
use crate::record::{Row, RunRecord, SENSOR};
use navfuse_core::model::chi_square::gated_moments;
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::model::record::{Epoch, Level, Outcome, Record, Truth, UpdateRecord, Wants};
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::manifold::MAX_TANGENT;
use navfuse_core::state::{Layout, State};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Runs an assembly and records errors, sigmas and innovations every `every` ns; `None` if it was
/// stopped.
pub fn run(
    mut assembly: Assembly,
    columns: &Arc<Columns>,
    Job { point, run }: Job,
    every: i64,
    stop: &AtomicBool,
) -> Option<RunRecord> {
    let seed = assembly.composition.seed;
    let sensors = assembly.composition.sensors.iter().map(|s| s.info.name.as_str());
    let places = columns.places(&assembly.composition.layout, sensors);
    assembly.sinks.push((
        "campaign".into(),
        Box::new(Collector {
            columns: Arc::clone(columns),
            sums: vec![[0.0; SENSOR.len()]; columns.sensors.len()],
            moments: vec![Vec::new(); columns.sensors.len()],
            grid: Grid::new(every),
            smoothed: None,
            every,
            places,
            rows: Vec::new(),
            last: None,
        }),
    ));
    let mut finished = runner::run(assembly, stop, |_| {});
    if finished.interrupted {
        return None;
    }
    let rows = finished.take_sink::<Collector>().map_or_else(Vec::new, |c| c.rows);
    let unseen =
        || rows.is_empty().then(|| "the truth was never known while the filter ran".to_owned());
    let failure = finished.error.map(|e| e.to_string()).or_else(unseen);
    let verdict = finished.summary.verdict.without_reference();
    let judged = verdict.level;
    let unusable = judged == VerdictLevel::DoNotUse;
    let doubt = verdict.reasons.first().filter(|reason| reason.severity > Severity::Note);
    let blamed = doubt.map(|reason| reason.about.clone());
    let warnings = finished.events.into_iter().filter(|e| e.level >= Level::Warning);
    let warned: BTreeSet<String> = warnings.map(|event| event.about).collect();
    let warned = warned.into_iter().collect();
    Some(RunRecord { point, run, seed, rows, failure, unusable, judged, warned, blamed })
}

/// Copy of an epoch, recorded if it turns out to be the last one.
struct Copied {
    layout: Arc<Layout>,
    state: State,
    covariance: Covariance,
    truth: State,
    known: Vec<bool>,
}

struct Collector {
    columns: Arc<Columns>,
    places: Places,
    grid: Grid,
    /// Interval of the rows, ns.
    every: i64,
    /// Grid of the smoothed estimates, in a run that is smoothed.
    smoothed: Option<Grid>,
    rows: Vec<Row>,
    /// Sums of each sensor since the previous row.
    sums: Vec<[f64; SENSOR.len()]>,
    /// Expectation and variance of the NIS for each sensor and number of channels, computed on
    /// first use.
    moments: Vec<Vec<Option<(f64, f64)>>>,
    /// Last epoch with a truth, and a flag that is set if it is in the rows.
    last: Option<(Copied, bool)>,
}

impl Collector {
    /// Adds a row with the sums of the sensors, and with the errors unless smoothed estimates follow.
    fn row(&mut self, number: i64, epoch: &Epoch<'_>, truth: &Truth<'_>, judged: bool) {
        let columns = &self.columns;
        let mut values = vec![f64::NAN; Row::width(columns)];
        for (k, sums) in self.sums.iter_mut().enumerate() {
            let at = Row::sensor_at(columns, k);
            values[at..at + SENSOR.len()].copy_from_slice(sums);
            *sums = [0.0; SENSOR.len()];
        }
        if judged {
            self.judge(epoch, truth, &mut values);
        }
        self.rows.push(Row { epoch: number, time: epoch.state.time.seconds(), values });
    }

    /// Computes the errors of an estimate, its sigmas and its NEES.
    fn judge(&self, epoch: &Epoch<'_>, truth: &Truth<'_>, values: &mut [f64]) {
        let columns = &self.columns;
        let nees_at = Row::nees_at(columns);
        let mut indices = Vec::with_capacity(epoch.layout.tangent);
        let mut errors = vec![0.0; epoch.layout.tangent];
        epoch.layout.error(truth.state, epoch.state, truth.known, &mut errors);
        for &(slot, at, first) in &self.places.blocks {
            let block = &epoch.layout.blocks[slot];
            let n = block.operations.tangent;
            let (mut error, mut sigma) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
            block.show_sigma(&epoch.state.values, epoch.covariance, &mut sigma);
            (0..n).for_each(|k| values[2 * (first + k) + 1] = sigma[k]);
            // the number of degrees of freedom of a campaign is that of the states that stay
            if !truth.known[slot] || epoch.layout.is_transient(slot) {
                continue;
            }
            truth.show_error(epoch.layout, slot, epoch.state, &mut error);
            (0..n).for_each(|k| values[2 * (first + k)] = error[k]);
            let range = block.tangent_range();
            let own: Vec<usize> = range.collect();
            values[nees_at + 1 + at] = nees(&errors, epoch.covariance, &own);
            indices.extend(own);
        }
        if !indices.is_empty() {
            values[nees_at] = nees(&errors, epoch.covariance, &indices);
        }
    }

    /// Adds a row if one is due, and keeps the estimate, which may be the last.
    fn take(&mut self, epoch: &Epoch<'_>, judged: bool) {
        let Some(truth) = epoch.truth else { return };
        let number = self.grid.due(epoch.state.time);
        if let Some(number) = number {
            self.row(number, epoch, &truth, judged);
        }
        let (last, recorded) = self.last.get_or_insert_with(|| {
            let copied = Copied {
                layout: Arc::new(epoch.layout.clone()),
                state: epoch.state.clone(),
                covariance: epoch.covariance.clone(),
                truth: truth.state.clone(),
                known: truth.known.to_vec(),
            };
            (copied, true)
        });
        *recorded = number.is_some();
        if !*recorded {
            last.state.clone_from(epoch.state);
            last.covariance.clone_from(epoch.covariance);
            last.truth.clone_from(truth.state);
            last.known.copy_from_slice(truth.known);
        }
    }
}

/// NEES of the components in `indices`. It is infinite if their covariance is not positive definite,
/// so that the verdict reports such a filter.
fn nees(errors: &[f64], covariance: &Covariance, indices: &[usize]) -> f64 {
    covariance.nees(errors, indices).unwrap_or(f64::INFINITY)
}

impl Sink for Collector {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::COMPARISONS | Wants::FILTERED | Wants::UPDATES
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Filtered(filtered) => self.filtered(filtered),
            Record::Update(update) => self.update(update),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        if let Some((c, false)) = self.last.take() {
            let truth = Truth { state: &c.truth, known: &c.known };
            let (layout, state, covariance) = (&*c.layout, &c.state, &c.covariance);
            self.row(
                self.grid.end(),
                &Epoch { layout, state, covariance, truth: Some(truth) },
                &truth,
                true, // the last estimate has no later sample
            );
        }
        Ok(None)
    }
}

impl Collector {
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let Some(smoothed) = &mut self.smoothed else {
            self.take(epoch, true);
            return Ok(());
        };
        let Some(truth) = epoch.truth else { return Ok(()) };
        if let Some(number) = smoothed.due(epoch.state.time)
            && let Ok(at) = self.rows.binary_search_by_key(&number, |row| row.epoch)
        {
            let mut values = std::mem::take(&mut self.rows[at].values);
            self.judge(epoch, &truth, &mut values);
            self.rows[at].values = values;
        }
        Ok(())
    }

    fn filtered(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.smoothed.get_or_insert_with(|| Grid::new(self.every));
        self.take(epoch, false);
        Ok(())
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        let Some(k) = self.places.sensors[update.sensor.0] else { return Ok(()) };
        let sums = &mut self.sums[k];
        match update.outcome {
            Outcome::Rejected(_) | Outcome::Placed => {}
            Outcome::Gated => sums[1] += 1.0,
            Outcome::Accepted => {
                let m = update.innovation.len();
                let moments = &mut self.moments[k];
                if moments.len() <= m {
                    moments.resize(m + 1, None);
                }
                let (mean, variance) =
                    *moments[m].get_or_insert_with(|| gated_moments(m, update.threshold));
                sums[0] += 1.0;
                sums[2] += update.nis;
                sums[3] += mean;
                sums[4] += variance;
            }
        }
        Ok(())
    }
}
