//! The results of a run in numbers.

use crate::checkpoint::{Io, Saved, saved};
use crate::compose::estimator::Estimator;
use crate::model::record::answers::Answers;
use crate::model::record::verdict::Verdict;
use crate::model::record::{
    Epoch, Event, InPart, Level, Outcome, Outcomes, Rejection, UpdateRecord,
};
use crate::model::sensor::Purpose;
use crate::model::sensor::Role;
use crate::model::stream::RunInfo;
use crate::session::comparison::{Compared, Comparison};
use crate::smooth::QualityReport;
use crate::state::Mode;
use crate::state::manifold::{MAX_TANGENT, Position};
use crate::units::sample::{Channel, Sample};
use crate::units::time::Time;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::any::TypeId;

pub use crate::session::comparison::HorizontalError;

/// The place that a sink wrote to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// The sink's name in the scenario.
    pub sink: String,
    /// Path or address.
    pub place: String,
}

/// The result of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Name of the scenario.
    pub scenario: String,
    /// Version of the program.
    pub version: String,
    /// Seed of a run whose samples are simulated; null for a recording.
    pub seed: Option<u64>,
    /// From the filter's start to its end, s.
    pub duration_s: f64,
    /// Horizontal path length, m: of the reference, or of the estimate where no reference reaches
    /// the end.
    pub distance_m: f64,
    /// Computing time of the run, s.
    pub wall_s: f64,
    /// Verdict on the run, with its reasons.
    pub verdict: Verdict,
    /// The three questions that the verdict answers.
    pub answers: Answers,
    /// Numbers of each sensor's samples: read, accepted, gated, rejected, and rejected for each
    /// reason; placed, where samples placed a block; excluded, where the scenario excludes any.
    pub samples: Map<String, Value>,
    /// Initial alignments by the name of their process; left out where there is none.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub starts: Map<String, Value>,
    /// The final estimate of every block, by name.
    pub states: Map<String, Value>,
    /// Estimated against true position at the times of the reference; null without a reference.
    pub horizontal_error_m: Option<HorizontalError>,
    /// The filter's own error in a run that is smoothed; left out otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filtered_horizontal_error_m: Option<HorizontalError>,
    /// Quality of a run that is smoothed; left out otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothing: Option<QualityReport>,
    /// The same states as rows to print.
    #[serde(skip)]
    pub rows: Vec<StateRow>,
}

/// A block's final estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct StateRow {
    /// `owner.name`.
    pub name: String,
    /// Unit of sigma and error.
    pub unit: &'static str,
    /// Names of the components.
    pub components: &'static [&'static str],
    /// Mode: estimated, fixed or considered.
    pub mode: Mode,
    /// The estimate at the end.
    pub estimate: Vec<f64>,
    /// Its 1-sigma; zero for a fixed block that is not estimated.
    pub sigma: Vec<f64>,
    /// Time since when a fixed block is estimated, which was found to be wrong.
    pub since: Option<Time>,
    /// Estimate minus reference at the last time of the reference; none if that time precedes the
    /// end by more than 2 s and by more than twice the last interval of the reference.
    pub error: Option<Vec<f64>>,
    /// 1-sigma at the time of the error, or at the end where there is no error.
    pub error_sigma: Vec<f64>,
}

#[derive(Clone, Debug, Default)]
struct Counts {
    read: u64,
    outcomes: Outcomes,
    excluded: u64,
    in_part: InPart,
    nis: f64,
}

saved!(Counts { read, outcomes, excluded, in_part, nis });

impl Counts {
    /// Counts a sample that the filter did not use.
    fn unused(&mut self, why: Rejection) {
        match why {
            Rejection::Excluded => self.excluded += 1,
            _ => self.outcomes.reject(why),
        }
    }

    /// The rejected samples by their reasons in words.
    fn rejected_for(&self, channels: &[Channel]) -> Value {
        let names: Vec<String> = channels.iter().map(Channel::words).collect();
        let reasons = self.outcomes.rejected.iter();
        let reasons = reasons.map(|(why, count)| (why.reason(&names), json!(count)));
        Value::Object(reasons.collect())
    }
}

/// Collects the numbers of a run while it goes on.
#[derive(Debug)]
pub(crate) struct Statistics {
    pub(crate) last_epoch: Option<Time>,
    name: String,
    version: String,
    seed: Option<u64>,
    sensors: Vec<(String, Purpose, Counts)>,
    first: Option<Time>,
    comparison: Comparison,
    /// Smoothed estimates, in a run that is smoothed.
    smoothed: Option<Comparison>,
}

impl Saved for Statistics {
    fn saved(&mut self, io: &mut Io<'_>) {
        let Self {
            last_epoch,
            name: _,
            version: _,
            seed: _,
            sensors,
            first,
            comparison,
            smoothed: _,
        } = self;
        io.pass(last_epoch);
        sensors.iter_mut().for_each(|(_, _, counts)| io.pass(counts));
        io.pass(first);
        io.pass(comparison);
    }
}

impl Statistics {
    pub(crate) fn new(info: &RunInfo) -> Self {
        Self {
            last_epoch: None,
            name: info.name.clone(),
            version: info.version.clone(),
            seed: info.simulated.then_some(info.seed),
            sensors: info
                .sensors
                .iter()
                .map(|s| (s.name.clone(), s.purpose, Counts::default()))
                .collect(),
            first: None,
            comparison: Comparison::new(&info.layout),
            smoothed: None,
        }
    }

    pub(crate) fn read(&mut self, sample: &Sample) {
        self.sensors[sample.sensor.0].2.read += 1;
    }

    pub(crate) fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        let counts = &mut self.sensors[sample.sensor.0].2;
        match rejected {
            Some(why) => counts.unused(why),
            None if self.first.is_some_and(|f| sample.time > f) => counts.outcomes.accepted += 1,
            None => {}
        }
    }

    pub(crate) fn update(&mut self, update: &UpdateRecord<'_>) {
        let counts = &mut self.sensors[update.sensor.0].2;
        match update.outcome {
            Outcome::Rejected(why) => counts.unused(why),
            outcome => counts.outcomes.add(outcome),
        }
        counts.in_part.add(update.time, update.outcome);
        if update.outcome == Outcome::Accepted {
            counts.nis += update.nis;
        }
    }

    pub(crate) fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.first.get_or_insert(epoch.state.time);
        self.last_epoch = Some(epoch.state.time);
        self.comparison.epoch(epoch);
    }

    /// Forgets the comparisons of another time: the estimate has changed since.
    pub(crate) fn forget_comparisons(&mut self, time: Time) {
        let others = self.comparison.compared.iter_mut();
        others.for_each(|compared| compared.forget_unless_at(time));
    }

    /// Takes a smoothed estimate.
    pub(crate) fn smoothed(&mut self, epoch: &Epoch<'_>) {
        self.smoothed.get_or_insert_with(|| Comparison::new(epoch.layout)).epoch(epoch);
    }

    /// The last comparison of each block with its truth, of the smoothed estimates where there are
    /// any.
    pub(crate) fn compared(&self) -> &[Compared] {
        &self.smoothed.as_ref().unwrap_or(&self.comparison).compared
    }

    /// Time of the last epoch.
    pub(crate) fn last_epoch(&self) -> Option<Time> {
        self.last_epoch
    }

    /// A warning for each sensor that gave no sample.
    pub(crate) fn silent(&self, estimator: &dyn Estimator) -> Vec<Event> {
        let sensors = self.sensors.iter().zip(&estimator.composition().sensors);
        sensors
            .filter(|((_, _, counts), sensor)| counts.read == 0 && !sensor.constraint)
            .map(|((name, _, _), _)| {
                let text = format!(
                    "no sample of [sensor.{name}] in any source: check the source's files and \
                     columns, or remove the sensor"
                );
                Event { time: estimator.time(), level: Level::Warning, about: name.clone(), text }
            })
            .collect()
    }

    pub(crate) fn summary(&mut self, estimator: &dyn Estimator, verdict: Verdict) -> Summary {
        let layout = &*estimator.composition().layout;
        let (state, covariance) = (estimator.state(), estimator.covariance());
        let (truth, end) = (estimator.truth(), state.time);
        let filtered = self.smoothed.as_ref().and(self.comparison.horizontal_error());
        let last = self.smoothed.as_ref().unwrap_or(&self.comparison);
        let corrected = estimator.corrected();
        let mut rows = Vec::new();
        let mut states = Map::new();
        for (slot, block) in layout.blocks.iter().enumerate() {
            let n = block.operations.tangent;
            let (mut estimate, mut sigma, mut error) =
                ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
            block.show(&state.values, &mut estimate);
            block.show_sigma(&state.values, &covariance, &mut sigma);
            let found = corrected.iter().find(|corrected| corrected.block == block.name);
            if let Some(corrected) = found {
                sigma[..n].copy_from_slice(&corrected.sigma);
            }
            // a truth that the scenario states also holds at the end; a reference holds at its last
            // time
            let holds = (block.spec.truth.is_some() && !block.wanders) || truth.state.time == end;
            let before = Some(&last.compared[slot]).filter(|c| c.holds_at(end));
            let (error, error_sigma) = match before {
                _ if holds && truth.known[slot] => {
                    truth.show_error(layout, slot, state, &mut error);
                    (Some(error[..n].to_vec()), sigma[..n].to_vec())
                }
                Some(compared) => (Some(compared.error()), compared.sigma()),
                None => (None, sigma[..n].to_vec()),
            };
            let row = StateRow {
                name: block.name.clone(),
                unit: block.spec.display.unit,
                components: block.spec.display.components,
                mode: block.spec.mode,
                estimate: estimate[..n].to_vec(),
                sigma: sigma[..n].to_vec(),
                since: found.map(|corrected| corrected.since),
                error,
                error_sigma,
            };
            let mut value = json!({
                "unit": row.unit,
                "components": row.components,
                "estimate": row.estimate,
                "sigma": row.sigma,
                "error": row.error,
            });
            if block.operations.kind == TypeId::of::<Position>() {
                value["estimate_unit"] = json!(["deg", "deg", "m"]);
                value["error_components"] = json!(["north", "east", "down"]);
            }
            if row.mode != Mode::Estimate {
                value["mode"] = json!(row.mode);
            }
            if let Some(since) = row.since {
                value["estimated_since_s"] = json!(since.seconds());
            }
            states.insert(block.name.clone(), value);
            rows.push(row);
        }
        let mut samples = Map::new();
        for ((name, _, c), sensor) in self.sensors.iter().zip(&estimator.composition().sensors) {
            let Outcomes { accepted, placed, gated, .. } = c.outcomes;
            let rejected = c.outcomes.all_rejected();
            let mean_nis = if accepted > 0 { json!(c.nis / accepted as f64) } else { Value::Null };
            // no source gives the samples of a constraint
            let applied = accepted + placed + gated + rejected + c.excluded;
            let read = if sensor.constraint { applied } else { c.read };
            let mut value = match sensor.role {
                Role::Input(_) => json!({ "read": c.read, "used": accepted, "rejected": rejected }),
                Role::Reference(_) => json!({ "read": c.read }),
                Role::Measurement(_) => json!({ "read": read, "accepted": accepted, "gated": gated,
                    "rejected": rejected, "mean_nis": mean_nis }),
            };
            if rejected > 0 {
                value["rejected_for"] = c.rejected_for(&sensor.info.channels);
            }
            if c.in_part.count > 0 {
                value["used_in_part"] = json!(c.in_part.count);
            }
            if placed > 0 {
                value["placed"] = json!(placed);
            }
            if !sensor.exclude.is_empty() {
                value["excluded"] = json!(c.excluded);
            }
            samples.insert(name.clone(), value);
        }
        let starts = estimator.alignments().into_iter().map(|(name, report)| {
            let mut values = report.values;
            values["text"] = json!(report.text);
            (name, values)
        });
        let starts = starts.collect();
        Summary {
            scenario: self.name.clone(),
            version: self.version.clone(),
            seed: self.seed,
            duration_s: self.first.zip(self.last_epoch).map_or(0.0, |(a, b)| b.since(a)),
            distance_m: last.distance(end),
            wall_s: 0.0,
            answers: verdict.answers(),
            verdict,
            samples,
            starts,
            states,
            horizontal_error_m: last.horizontal_error(),
            filtered_horizontal_error_m: filtered,
            smoothing: None,
            rows,
        }
    }
}
