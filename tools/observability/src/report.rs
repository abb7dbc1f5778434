//! The report of a run: per state, what is determined, when it became so, and what is missing.

use crate::component::Verdict;
use crate::theorem::{self, SegmentView};
use crate::tracker::Tracker;
use crate::words;
use navfuse_core::units::time::Time;
use navfuse_figures::{Axis, Curve, Figure, Look, Panel};
use navfuse_segments::{Recording, SegmentError};
use serde::Serialize;
use std::collections::BTreeMap;

/// The most rows of a history in a report.
const ROWS: usize = 400;

/// The report. Times are of the run's clock.
#[derive(Clone, Debug, Serialize)]
pub struct ObservabilityReport {
    /// Name of the scenario.
    pub scenario: String,
    /// When the filter started, s.
    pub start_s: f64,
    /// The last estimate, s.
    pub end_s: f64,
    /// Every component of every uncertain state.
    pub states: Vec<StateReport>,
    /// The sensors that correct the state.
    pub sensors: Vec<SensorReport>,
    /// The directions of the error at the start of which more than a half of the prior is left, the worst first.
    pub undetermined: Vec<DirectionReport>,
    /// What the segments of the recording say (Pan & Wu 2016, Theorem 1); none before [`ObservabilityReport::judge`].
    pub segments: Option<SegmentView>,
    /// Why there are none.
    pub no_segments: Option<String>,
    /// Sigma over what it would be without measurements, over time.
    pub history: History,
}

/// One component.
#[derive(Clone, Debug, Serialize)]
pub struct StateReport {
    /// Its block.
    pub state: String,
    /// Its name.
    pub component: String,
    /// Both as a person reads them.
    pub title: String,
    /// Unit of the sigmas; empty for a ratio.
    pub unit: String,
    /// Whether the errors of other states flow into it: then it is judged by what is left of its error at the start.
    pub driven: bool,
    /// 1-sigma at the start.
    pub prior: f64,
    /// 1-sigma at the end.
    pub sigma: f64,
    /// 1-sigma at the end if nothing had been measured, by the state's own dynamics.
    pub reference: f64,
    /// `sigma / reference`.
    pub normalised: f64,
    /// How many times sigma was halved; below zero where it has grown.
    pub bits: f64,
    /// The share of the estimate that is still prior, 0 to 1.
    pub prior_weight: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// Since when it is determined, s.
    pub since_s: Option<f64>,
    /// When it ceased to be determined, the last time it did, s.
    pub lost_s: Option<f64>,
    /// Bits that each sensor told of what it was at the start.
    pub told_by: BTreeMap<String, f64>,
    /// What is missing, in words.
    pub missing: Option<String>,
}

/// One sensor.
#[derive(Clone, Debug, Serialize)]
pub struct SensorReport {
    /// Its name.
    pub name: String,
    /// Samples used.
    pub used: u64,
    /// The components that its model reads.
    pub reads: Vec<String>,
}

/// One direction.
#[derive(Clone, Debug, Serialize)]
pub struct DirectionReport {
    /// The share of its prior variance that is left.
    pub left: f64,
    /// The components that it is made of, with weights in units of their priors.
    pub parts: Vec<(String, f64)>,
    /// In words.
    pub text: String,
}

/// Normalised sigmas over time.
#[derive(Clone, Debug, Serialize)]
pub struct History {
    /// Times, s.
    pub time_s: Vec<f64>,
    /// The components, as [`StateReport::title`], and one number a time.
    pub normalised: Vec<(String, Vec<f64>)>,
}

impl ObservabilityReport {
    /// The report of a run that was tracked.
    pub fn new(scenario: &str, tracker: &Tracker) -> Self {
        let (start, end) = tracker.span();
        let titles: Vec<String> =
            tracker.components().iter().map(|c| c.title(tracker.layout())).collect();
        let seconds = |t: Time| t.seconds();
        let states =
            tracker.components().iter().zip(tracker.status()).enumerate().map(|(i, (c, now))| {
                let told = tracker
                    .sensors()
                    .iter()
                    .filter(|s| s.used > 0)
                    .map(|s| (s.name.clone(), s.told[i]));
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
                    told_by: told.collect(),
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
            history: History::new(tracker, &titles),
        }
    }

    /// Adds what the segments of the run's samples say, and what that says of the states. Where there is no IMU among them, or
    /// no attitude to begin from, it says that.
    pub fn judge(&mut self, recording: Result<Recording, SegmentError>, tracker: &Tracker) {
        let view = recording.and_then(|r| theorem::judge(&r, tracker, &mut self.states));
        match view {
            Ok(view) => self.segments = Some(view),
            Err(error) => self.no_segments = Some(error.to_string()),
        }
    }

    /// The component of that title.
    pub fn state(&self, title: &str) -> Option<&StateReport> {
        self.states.iter().find(|s| s.title == title)
    }

    /// Normalised sigmas over time, one panel a state (Pan & Wu, Figure 12).
    pub fn figure(&self) -> Figure {
        let mut panels: Vec<(String, Panel)> = Vec::new();
        for (state, (_, values)) in self.states.iter().zip(&self.history.normalised) {
            if panels.last().is_none_or(|(name, _)| *name != state.state) {
                let y = Axis::logarithmic("sigma / prior");
                let limit = |w: f64| Curve {
                    name: "determined".into(),
                    look: Look::Bound,
                    points: [self.start_s, self.end_s].map(|t| [t, w]).to_vec(),
                };
                // of what others drive, this sigma does not decide
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
            title: format!("{}: sigma over what it would be without measurements", self.scenario),
            columns: 2,
            panels: panels.into_iter().map(|p| p.1).collect(),
        }
    }
}

impl History {
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
