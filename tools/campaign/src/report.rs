//! The result of a campaign in numbers.

use crate::campaign::Campaign;
use crate::columns::{Columns, Component};
use crate::statistics::{Judged, PointStatistics};
use crate::verdict::{PointVerdict, anees_band, nis_band, verdict};
use navfuse_core::model::chi_square::Band;
use serde::Serialize;

/// Result of a campaign.
#[derive(Clone, Debug, Serialize)]
pub struct CampaignReport {
    /// Name of the scenario.
    pub scenario: String,
    /// Keys that vary.
    pub keys: Vec<String>,
    /// Requested runs of each point.
    pub runs: usize,
    /// Set if the smoothed estimates of the runs were judged.
    pub smoothed: bool,
    /// Seed of the campaign.
    pub seed: u64,
    /// Results, one entry per point of the grid.
    pub points: Vec<PointReport>,
}

/// Result of one point of the grid.
#[derive(Clone, Debug, Serialize)]
pub struct PointReport {
    /// Value of each varied key.
    pub values: Vec<String>,
    /// Runs that reached their end.
    pub runs: usize,
    /// Runs that ended early.
    pub failed: usize,
    /// Time of the last epoch, s.
    pub end_s: f64,
    /// Every component: at the end, or over the run where the runs are smoothed.
    pub states: Vec<StateReport>,
    /// ANEES of the whole state, then of every block.
    pub anees: Vec<Anees>,
    /// NIS of every sensor that updates the state.
    pub nis: Vec<Nis>,
    /// Run to inspect: the first run that ended early, otherwise the run with the largest NEES at
    /// the end; `None` without runs.
    pub worst: Option<WorstRun>,
    /// Runs by the level of their own verdict, which does not know the errors.
    pub judged: Judged,
    /// Verdict on the consistency of errors and uncertainty; `None` without runs.
    pub verdict: Option<PointVerdict>,
}

/// One run of a campaign, with the arguments that repeat it.
#[derive(Clone, Debug, Serialize)]
pub struct WorstRun {
    /// Number of the run.
    pub run: usize,
    /// Seed of the run.
    pub seed: u64,
    /// NEES of the whole state at the end; null if the run ended early.
    pub nees: Option<f64>,
    /// Reason why the run ended early, if it did.
    pub failure: Option<String>,
    /// Arguments of `navfuse run SCENARIO` that repeat the run.
    pub again: String,
}

/// Component at the end, or over the whole run where the runs are smoothed: the smoothed estimate at
/// the end is that of the filter. Null if a value is not known.
#[derive(Clone, Debug, Serialize)]
pub struct StateReport {
    /// The component.
    #[serde(flatten)]
    pub component: Component,
    /// Root mean square error.
    pub rmse: Option<f64>,
    /// Mean error.
    pub mean_error: Option<f64>,
    /// Root of the mean variance that the filter reported.
    pub sigma: Option<f64>,
    /// RMSE over sigma.
    pub rmse_over_sigma: Option<f64>,
    /// Cramer-Rao bound of a filter, or of a smoother where the runs are smoothed.
    pub bound: Option<f64>,
    /// RMSE over bound.
    pub rmse_over_bound: Option<f64>,
    /// Cramer-Rao bound of a smoother, root mean square over the epochs.
    pub smoothed: Option<f64>,
}

/// Average normalised estimation error squared.
#[derive(Clone, Debug, Serialize)]
pub struct Anees {
    /// `whole state`, or the name of the block.
    pub of: String,
    /// Degrees of freedom, which are the expected value.
    pub dimension: usize,
    /// Value at the end.
    pub value: Option<f64>,
    /// Two-sided 95 % chi-square band.
    pub band: Option<Band>,
    /// Root mean square over the components of the ratio of RMSE to bound at the end.
    pub rmse_over_bound: Option<f64>,
    /// Share of the epochs at which the value is inside the band.
    pub inside: Option<f64>,
}

/// Normalised innovation squared.
#[derive(Clone, Debug, Serialize)]
pub struct Nis {
    /// Name of the sensor.
    pub sensor: String,
    /// Used samples.
    pub used: u64,
    /// Share of the samples that were gated.
    pub gated: f64,
    /// Mean NIS of the used samples.
    pub mean: Option<f64>,
    /// Expected NIS of samples that passed the gate.
    pub expected: Option<f64>,
    /// Two-sided 95 % chi-square band.
    pub band: Option<Band>,
}

/// Probability outside the reported bands.
const ALPHA: f64 = 0.05;

impl CampaignReport {
    /// Computes the report from the statistics of the points.
    pub fn new(campaign: &Campaign, points: &[PointStatistics]) -> Self {
        Self {
            scenario: campaign.scenario.clone(),
            keys: campaign.keys.clone(),
            runs: campaign.runs,
            smoothed: campaign.smooths,
            seed: campaign.seed,
            points: points
                .iter()
                .enumerate()
                .map(|(k, point)| PointReport::new(campaign, k, point))
                .collect(),
        }
    }
}

impl PointReport {
    fn new(campaign: &Campaign, number: usize, point: &PointStatistics) -> Self {
        let columns = &campaign.columns;
        let last = point.epochs().next_back();
        let bound = point.bound.as_ref();
        let bound_row = bound.and_then(|b| last.map_or(b.rows.last(), |(number, _)| b.at(number)));
        let states: Vec<StateReport> = (columns.components.iter().enumerate())
            .map(|(k, component)| {
                let known = |v: f64| Some(v).filter(|v| v.is_finite());
                let over = |a: Option<f64>, b: Option<f64>| {
                    a.zip(b.filter(|b| *b > 0.0)).map(|(a, b)| a / b)
                };
                let (rmse, mean_error, sigma) = if campaign.smooths {
                    let all = point.over_run(k);
                    (all.rmse(), all.mean_error(), all.sigma())
                } else {
                    last.map_or((None, None, None), |(_, e)| {
                        (e.rmse(k), e.mean_error(k), e.sigma(k))
                    })
                };
                let least = if campaign.smooths {
                    point.smoothed_bound(k)
                } else {
                    bound_row.and_then(|row| known(row.2[k]))
                };
                let smoothed = bound.map(|b| {
                    (b.rows.iter().map(|r| r.3[k] * r.3[k]).sum::<f64>() / b.rows.len() as f64)
                        .sqrt()
                });
                StateReport {
                    component: component.clone(),
                    rmse,
                    mean_error,
                    sigma,
                    rmse_over_sigma: over(rmse, sigma),
                    bound: least,
                    rmse_over_bound: over(rmse, least),
                    smoothed: smoothed.and_then(known),
                }
            })
            .collect();
        let anees =
            (0..=columns.blocks.len()).map(|of| Anees::new(columns, point, of, &states)).collect();
        let nis = (0..columns.sensors.len()).map(|k| Nis::new(columns, point, k)).collect();
        let end_s = last.map_or_else(|| bound_row.map_or(f64::NAN, |r| r.1), |(_, e)| e.time);
        let any = point.runs + point.failures.len() > 0;
        Self {
            values: campaign.points[number].values.clone(),
            runs: point.runs,
            failed: point.failures.len(),
            end_s,
            states,
            anees,
            nis,
            worst: WorstRun::new(campaign, number, point),
            judged: point.judged,
            verdict: any.then(|| verdict(columns, point)),
        }
    }
}

impl WorstRun {
    fn new(campaign: &Campaign, number: usize, point: &PointStatistics) -> Option<Self> {
        let (run, nees, failure) = match (point.failures.first(), point.worst().first()) {
            (Some((run, reason)), _) => (*run, None, Some(reason.clone())),
            (None, Some((run, nees))) => (*run, Some(*nees), None),
            (None, None) => return None,
        };
        Some(Self {
            run,
            seed: campaign.seed_of(run),
            nees,
            failure,
            again: campaign.again(number, run),
        })
    }
}

impl Anees {
    fn new(columns: &Columns, point: &PointStatistics, of: usize, states: &[StateReport]) -> Self {
        let (name, dimension, range) = match of.checked_sub(1) {
            None => ("whole state".to_owned(), columns.known(), 0..states.len()),
            Some(k) => {
                (columns.blocks[k].name.clone(), columns.blocks[k].dimension, columns.of_block(k))
            }
        };
        let band = |runs: usize| anees_band(dimension, runs, ALPHA);
        let last = point.epochs().next_back().and_then(|(_, e)| e.anees(of));
        let over_time = point.judged().filter_map(|e| e.anees(of));
        let (mut count, mut inside, mut known) = (0, 0, None);
        for (value, runs) in over_time {
            // the number of runs hardly changes over time, and a band takes long to compute
            let limits =
                known.filter(|(r, _)| *r == runs).map_or_else(|| band(runs), |(_, limits)| limits);
            known = Some((runs, limits));
            count += 1;
            inside += usize::from(limits.holds(value));
        }
        let ratios: Vec<f64> = states[range].iter().filter_map(|s| s.rmse_over_bound).collect();
        let mean = ratios.iter().map(|r| r * r).sum::<f64>() / ratios.len() as f64;
        Self {
            of: name,
            dimension,
            value: last.map(|l| l.0),
            band: last.map(|l| band(l.1)),
            rmse_over_bound: (!ratios.is_empty()).then(|| mean.sqrt()),
            inside: (count > 0).then(|| inside as f64 / count as f64),
        }
    }
}

impl Nis {
    fn new(columns: &Columns, point: &PointStatistics, sensor: usize) -> Self {
        let sums = point.nis(sensor);
        let used = sums.used > 0.0;
        Self {
            sensor: columns.sensors[sensor].clone(),
            used: sums.used as u64,
            gated: if sums.used + sums.gated > 0.0 {
                sums.gated / (sums.used + sums.gated)
            } else {
                0.0
            },
            mean: used.then(|| sums.nis / sums.used),
            expected: used.then(|| sums.expected / sums.used),
            band: nis_band(&sums, ALPHA),
        }
    }
}
