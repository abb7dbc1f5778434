//! The report of a run: the verdict on each state, its time, and what is missing.

use crate::component::Determination;
use crate::share::Shares;
use crate::theorem::{self, SegmentView};
use crate::tracker::Tracker;
use crate::words;
use navfuse_core::units::time::Time;
use navfuse_figures::{Axis, Curve, Figure, Look, Panel};
use navfuse_segments::{Recording, SegmentError};
use serde::Serialize;
use std::collections::BTreeMap;

/// Largest number of rows of a history in a report.
const ROWS: usize = 400;

/// Observability report. Times are of the run's clock.
#[derive(Clone, Debug, Serialize)]
pub struct ObservabilityReport {
    /// Name of the scenario.
    pub scenario: String,
    /// Time of the first epoch, s.
    pub start_s: f64,
    /// Time of the last epoch, s.
    pub end_s: f64,
    /// Every component of every uncertain state.
    pub states: Vec<StateReport>,
    /// Sensors that update the state.
    pub sensors: Vec<SensorReport>,
    /// Directions of the initial error in which more than a half of the prior variance remains, the
    /// largest first.
    pub undetermined: Vec<DirectionReport>,
    /// Evaluation of the recording's segments (Pan & Wu 2016, Theorem 1); `None` before
    /// [`ObservabilityReport::judge`].
    pub segments: Option<SegmentView>,
    /// Reason why the segments could not be evaluated.
    pub no_segments: Option<String>,
    /// Normalised sigma of each component over time.
    pub history: SigmaHistory,
    /// Share of each sensor in the information about each component over time.
    #[serde(skip)]
    pub shares: Shares,
}

/// One component.
#[derive(Clone, Debug, Serialize)]
pub struct StateReport {
    /// Name of the block.
    pub state: String,
    /// Name of the component.
    pub component: String,
    /// Name of block and component for display.
    pub title: String,
    /// Unit of the sigmas; empty for a ratio.
    pub unit: String,
    /// Set if the errors of other states drive the component; its verdict then depends on its
    /// remaining initial error.
    pub driven: bool,
    /// 1-sigma at the start.
    pub prior: f64,
    /// 1-sigma at the end.
    pub sigma: f64,
    /// 1-sigma at the end without measurements, from the state's own dynamics.
    pub reference: f64,
    /// `sigma / reference`.
    pub normalised: f64,
    /// Number of times that sigma was halved; negative if sigma has grown.
    pub bits: f64,
    /// Share of the estimate that is still prior, 0 to 1.
    pub prior_weight: f64,
    /// How far the run determines it.
    pub verdict: Determination,
    /// Time since which the component is determined, s.
    pub since_s: Option<f64>,
    /// Last time at which the component ceased to be determined, s.
    pub lost_s: Option<f64>,
    /// Information of each sensor on the component's initial error, bits.
    #[serde(rename = "told_by")]
    pub information: BTreeMap<String, f64>,
    /// Reason why the component is not determined.
    pub missing: Option<String>,
}

/// One sensor.
#[derive(Clone, Debug, Serialize)]
pub struct SensorReport {
    /// Name of the sensor.
    pub name: String,
    /// Used samples.
    pub used: u64,
    /// Components that the sensor's model reads.
    pub reads: Vec<String>,
}

/// One direction.
#[derive(Clone, Debug, Serialize)]
pub struct DirectionReport {
    /// Remaining share of its prior variance.
    pub left: f64,
    /// Components of the direction, with weights in units of their priors.
    pub parts: Vec<(String, f64)>,
    /// Direction in terms of states.
    pub text: String,
}

/// Normalised sigmas over time.
#[derive(Clone, Debug, Serialize)]
pub struct SigmaHistory {
    /// Times, s.
    pub time_s: Vec<f64>,
    /// Components, named by [`StateReport::title`], with one number per time.
    pub normalised: Vec<(String, Vec<f64>)>,
}

impl ObservabilityReport {
    /// Creates the report of a tracked run.
    pub fn new(scenario: &str, tracker: &Tracker) -> Self {
        let (start, end) = tracker.span();
        let titles: Vec<String> =
            tracker.components().iter().map(|c| c.title(tracker.layout())).collect();
        let seconds = |t: Time| t.seconds();
        let states =
            tracker.components().iter().zip(tracker.status()).enumerate().map(|(i, (c, now))| {
                let information = tracker
                    .sensors()
                    .iter()
                    .filter(|s| s.used > 0)
                    .map(|s| (s.name.clone(), s.bits[i]));
                StateReport {
                    state: c.state.clone(),
                    component: c.name.clone(),
                    title: titles[i].clone(),
                    unit: c.unit.to_owned(),
                    driven: tracker.driven(c.slot),
                    prior: now.prior,
                    sigma: now.sigma,
                    reference: now.reference,
                    normalised: now.normalised(),
                    bits: now.bits(),
                    prior_weight: now.weight,
                    verdict: now.verdict,
                    since_s: now.since.map(seconds),
                    lost_s: now.lost.map(seconds),
                    information: information.collect(),
                    missing: words::missing(tracker, i),
                }
            });
        let sensors = tracker.sensors().iter().filter(|s| s.measures).map(|s| SensorReport {
            name: s.name.clone(),
            used: s.used,
            reads: titles
                .iter()
                .zip(&s.reads)
                .filter(|(_, r)| **r)
                .map(|(title, _)| title.clone())
                .collect(),
        });
        let undetermined = tracker.undetermined();
        let directions = undetermined.iter().map(|d| DirectionReport {
            left: d.left,
            parts: d.parts.iter().map(|&(k, weight)| (titles[k].clone(), weight)).collect(),
            text: words::direction(tracker, d),
        });
        Self {
            scenario: scenario.to_owned(),
            start_s: start.seconds(),
            end_s: end.seconds(),
            states: states.collect(),
            sensors: sensors.collect(),
            undetermined: directions.collect(),
            segments: None,
            no_segments: None,
            history: SigmaHistory::new(tracker, &titles),
            shares: tracker.shares(),
        }
    }

    /// Adds the evaluation of the segments of the run's samples, and its consequences for the
    /// states. Without an IMU or an initial attitude, it adds the reason instead.
    pub fn judge(&mut self, recording: Result<Recording, SegmentError>, tracker: &Tracker) {
        let view = recording.and_then(|r| theorem::judge(&r, tracker, &mut self.states));
        match view {
            Ok(view) => self.segments = Some(view),
            Err(error) => self.no_segments = Some(error.to_string()),
        }
    }

    /// Finds a component by its title.
    pub fn state(&self, title: &str) -> Option<&StateReport> {
        self.states.iter().find(|s| s.title == title)
    }

    /// Plots normalised sigmas over time, one panel per state (Pan & Wu, Figure 12).
    pub fn figure(&self) -> Figure {
        let mut panels: Vec<(String, Panel)> = Vec::new();
        for (state, (_, values)) in self.states.iter().zip(&self.history.normalised) {
            if panels.last().is_none_or(|(name, _)| *name != state.state) {
                let y = Axis::logarithmic("relative sigma");
                let limit = |w: f64| Curve {
                    name: "determined".into(),
                    look: Look::Bound,
                    points: [self.start_s, self.end_s].map(|t| [t, w]).to_vec(),
                };
                // for a driven state this sigma does not decide the verdict, so its panel has no
                // limit
                let curves =
                    if state.driven { Vec::new() } else { vec![limit(crate::DETERMINED.sqrt())] };
                let panel = Panel {
                    title: state.state.clone(),
                    x: Axis::time(),
                    y,
                    curves,
                    bands: Vec::new(),
                };
                panels.push((state.state.clone(), panel));
            }
            let Some((_, panel)) = panels.last_mut() else { continue };
            let k = panel.curves.iter().filter(|c| matches!(c.look, Look::Data(_))).count();
            let points = self.history.time_s.iter().zip(values).map(|(&t, &v)| [t, v]).collect();
            panel.curves.push(Curve { name: state.component.clone(), look: Look::Data(k), points });
        }
        Figure {
            name: "normalised-sigma".into(),
            title: format!("{}: sigma relative to that without measurements", self.scenario),
            columns: 2,
            panels: panels.into_iter().map(|p| p.1).collect(),
        }
    }
}

impl SigmaHistory {
    fn new(tracker: &Tracker, titles: &[String]) -> Self {
        let (times, values) = tracker.history();
        let n = titles.len();
        let step = times.len().div_ceil(ROWS).max(1);
        let rows: Vec<usize> =
            (0..times.len()).filter(|&k| k % step == 0 || k + 1 == times.len()).collect();
        let column = |i: usize| rows.iter().map(|&k| values[k * n + i]).collect();
        Self {
            time_s: rows.iter().map(|&k| times[k]).collect(),
            normalised: titles
                .iter()
                .enumerate()
                .map(|(i, title)| (title.clone(), column(i)))
                .collect(),
        }
    }
}
