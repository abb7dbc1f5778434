//! The planner: ranks candidate manoeuvres by the Cramer-Rao bound that they would reach.
//!
//! Each candidate is appended to the scenario's own segments and run at the truth, where the
//! filter's covariance is the bound ([`navfuse_core::run::scenario::Scenario::assemble_at_truth`]).
//! The planner compares it with straight motion of the same duration.

use crate::tracker::{Tracker, TrackerSink};
use crate::{Determination, words};
use navfuse_core::document::{Document, DocumentError, Node, key};
use navfuse_core::plugin::{BuildError, Registry};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::RunError;
use navfuse_core::units::{Duration, Speed};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Error of the planner.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The scenario, or the scenario with a candidate, does not compose.
    #[error(transparent)]
    Scenario(#[from] BuildError),
    /// The scenario is a recording, to which no manoeuvre can be added.
    #[error(
        "no manoeuvre can be suggested for a recording: --suggest needs the scenario, with \
         [source.simulation] and its segments"
    )]
    NotSimulated,
    /// An option does not fit.
    #[error("{option}: {message}")]
    Option {
        /// The option with its value.
        option: String,
        /// The reason and the remedy.
        message: String,
    },
    /// A run of the scenario failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A run recorded nothing.
    #[error("the run recorded nothing")]
    NothingRecorded,
}

impl PlanError {
    fn option(option: String, message: impl Into<String>) -> Self {
        Self::Option { option, message: message.into() }
    }
}

impl From<DocumentError> for PlanError {
    fn from(error: DocumentError) -> Self {
        Self::Scenario(error.into())
    }
}

/// Options of the planner.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Time at which the manoeuvre begins, s; later segments of the scenario are dropped. `None` is
    /// the end of the scenario.
    pub at: Option<f64>,
    /// States or components to improve, such as `dvl.misalignment` or `dvl.misalignment.roll`. If
    /// the list is empty, the components that are not determined when the manoeuvre begins.
    pub of: Vec<String>,
}

/// Ranked manoeuvres.
#[derive(Clone, Debug, Serialize)]
pub struct ManoeuvrePlan {
    /// Time at which the manoeuvre begins, s.
    pub at_s: f64,
    /// Forward speed at that time, m/s.
    pub speed: f64,
    /// Components to improve.
    pub of: Vec<String>,
    /// Candidates, the best first.
    pub suggestions: Vec<Suggestion>,
}

/// One manoeuvre.
#[derive(Clone, Debug, Serialize)]
pub struct Suggestion {
    /// Name of the manoeuvre.
    pub name: String,
    /// Segments, as in `source.simulation.segments`.
    pub segments: Vec<String>,
    /// Duration, s.
    pub duration_s: f64,
    /// Information gained over straight motion on the components to improve, bits: the sum of the
    /// additional halvings of their sigmas.
    pub bits: f64,
    /// Improved components, the largest gain first; also those not asked for.
    pub improves: Vec<Improvement>,
}

/// One component that a manoeuvre improves.
#[derive(Clone, Debug, Serialize)]
pub struct Improvement {
    /// Title of the component.
    pub title: String,
    /// Unit of the sigmas.
    pub unit: String,
    /// 1-sigma after straight motion.
    pub without: f64,
    /// 1-sigma after the manoeuvre.
    pub with: f64,
    /// Additional halvings of sigma.
    pub bits: f64,
    /// Determination after the manoeuvre.
    pub verdict: Determination,
}

/// Manoeuvre with its segments and their durations, s.
struct Candidate {
    name: &'static str,
    segments: Vec<(String, f64)>,
}

impl Candidate {
    fn duration(&self) -> f64 {
        self.segments.iter().map(|s| s.1).sum()
    }
}

fn segment(kind: &str, seconds: f64, rest: &str) -> (String, f64) {
    let comma = if rest.is_empty() { "" } else { ", " };
    (format!("{{ type = \"{kind}\", duration = \"{seconds} s\"{comma}{rest} }}"), seconds)
}

/// Lists the candidates for a vehicle at a forward speed, m/s. Candidates that need forward motion
/// begin by accelerating.
fn candidates(speed: f64) -> Vec<Candidate> {
    let under_way = speed.abs() >= 0.1;
    let cruise = if under_way { speed } else { 2.0 };
    let change = (0.3 * cruise.abs()).max(0.5);
    let side = cruise.abs().clamp(0.2, 1.0);
    let pulse = |by: f64| segment("pulse", 60.0, &format!("speed_change = \"{by} m/s\""));
    let turn = |seconds: f64, angle: f64, bank: f64, pitch: f64| {
        segment(
            "turn",
            seconds,
            &format!("angle = \"{angle} deg\", bank = \"{bank} deg\", pitch = \"{pitch} deg\""),
        )
    };
    let dive = segment("descend", 60.0, "rate = \"1 m/s\"");
    let climb = segment("ascend", 60.0, "rate = \"1 m/s\"");
    let leg = || segment("cruise", 60.0, "");
    let sway = |speed: f64| segment("sway", 60.0, &format!("speed = \"{speed} m/s\""));
    let moving = |name, segments: Vec<(String, f64)>| {
        let mut all = Vec::new();
        if !under_way {
            all.push(segment("surge", 30.0, &format!("speed = \"{cruise} m/s\"")));
        }
        all.extend(segments);
        Candidate { name, segments: all }
    };
    let still = |name, segments| Candidate { name, segments };
    vec![
        still("accelerate ahead and slow down again", vec![pulse(change)]),
        still("dive", vec![dive.clone()]),
        still("climb", vec![climb.clone()]),
        still("dive and climb", vec![dive, climb]),
        still("thrust to starboard", vec![sway(side)]),
        still("thrust to starboard and to port", vec![sway(side), sway(-side)]),
        still("roll to 15 deg and back", vec![turn(30.0, 0.0, 15.0, 0.0)]),
        still("pitch to 10 deg and back", vec![turn(30.0, 0.0, 0.0, 10.0)]),
        moving("turn by 90 deg, then straight", vec![turn(30.0, 90.0, 0.0, 0.0), leg()]),
        moving("turn by 180 deg, then straight", vec![turn(60.0, 180.0, 0.0, 0.0), leg()]),
        moving(
            "S-turn of 45 deg",
            vec![
                turn(20.0, 45.0, 0.0, 0.0),
                turn(40.0, -90.0, 0.0, 0.0),
                turn(20.0, 45.0, 0.0, 0.0),
            ],
        ),
        moving("circle", vec![turn(120.0, 360.0, 0.0, 0.0)]),
        moving("square with legs of 60 s", vec![segment("square", 360.0, "turn = \"30 s\"")]),
        moving(
            "stop and go",
            vec![
                segment("surge", 30.0, "speed = \"0 m/s\""),
                segment("surge", 30.0, &format!("speed = \"{cruise} m/s\"")),
            ],
        ),
    ]
}

/// Scenario up to the manoeuvre.
struct Base {
    /// Key path of the segments.
    key: String,
    segments: Vec<String>,
    end: f64,
    speed: f64,
}

impl Base {
    fn of(document: &Document, at: Option<f64>) -> Result<Self, PlanError> {
        let root = document.root();
        let refuse = || PlanError::NotSimulated;
        let sources = root.get("source").ok_or_else(refuse)?;
        let simulated = |name: &str, node: &Node<'_>| {
            let kind = node.get("type").and_then(|t| t.parse::<String>().ok());
            kind.as_deref().unwrap_or(name) == "simulation"
        };
        let (name, source) = sources
            .entries()?
            .into_iter()
            .find(|(n, node)| simulated(n, node))
            .ok_or_else(refuse)?;
        let segments = source.get("segments").ok_or_else(refuse)?;
        let stop = root
            .get("estimator")
            .and_then(|e| e.get("stop"))
            .map(|s| s.parse::<Duration>())
            .transpose()?;
        let limit = at.or(stop.map(|s| s.si())).unwrap_or(f64::INFINITY);
        let start = source
            .get("start")
            .and_then(|s| s.get("speed"))
            .map(|s| s.parse::<Speed>())
            .transpose()?;
        let mut base = Self {
            key: format!("source.{}.segments", key(name)),
            segments: Vec::new(),
            end: 0.0,
            speed: start.map_or(0.0, |s| s.si()),
        };
        let rows = segments.value().as_array().map_or(0, Vec::len);
        let mut whole = true;
        for k in 0..rows {
            let Some(row) = segments.get(&k.to_string()) else { break };
            let kind: String = row.get("type").ok_or_else(refuse)?.parse()?;
            let duration = row.get("duration").ok_or_else(refuse)?.parse::<Duration>()?.si();
            let left = limit - base.end;
            if duration > left + 1e-9 {
                // uniform motion can be cut anywhere; the shortest part is 1 s
                if ["cruise", "static"].contains(&kind.as_str()) && left >= 1.0 {
                    base.segments.push(segment(&kind, left, "").0);
                    base.end = limit;
                }
                whole = false;
                break;
            }
            base.segments.push(row.value().to_string());
            base.end += duration;
            if let Some(speed) = row.get("speed").filter(|_| kind == "surge") {
                base.speed = speed.parse::<Speed>()?.si();
            }
        }
        if let Some(at) = at.filter(|at| whole && *at > base.end + 1e-9) {
            let end = base.end;
            return Err(PlanError::option(
                format!("--at {at} s"),
                format!("the segments end at {end} s; give an earlier time"),
            ));
        }
        if base.segments.is_empty() {
            return Err(PlanError::option(
                format!("--at {limit} s"),
                "the first segment has not ended by then; give a later time",
            ));
        }
        Ok(base)
    }

    /// Returns the settings of the scenario with segments appended to its own.
    fn settings(&self, more: &[(String, f64)]) -> Vec<String> {
        let all: Vec<&str> = self
            .segments
            .iter()
            .map(String::as_str)
            .chain(more.iter().map(|s| s.0.as_str()))
            .collect();
        vec![format!("{}=[{}]", self.key, all.join(", ")), "estimator.stop=1e8 s".into()]
    }
}

/// Ranks the candidates; `None` if it was stopped. `progress` receives the number of completed runs
/// and of all runs.
///
/// # Errors
/// Returns an error if the scenario is not a simulation of segments, or does not run.
pub fn suggest(
    registry: &Registry,
    document: &Document,
    options: &Options,
    stop: &AtomicBool,
    progress: impl Fn(usize, usize) + Sync,
) -> Result<Option<ManoeuvrePlan>, PlanError> {
    let base = Base::of(document, options.at)?;
    let candidates = candidates(base.speed);
    let longest = candidates.iter().map(Candidate::duration).fold(0.0, f64::max);
    let on = if base.speed == 0.0 { "static" } else { "cruise" };
    // the scenario as it is, straight motion, and the candidates
    let mut jobs: Vec<Vec<(String, f64)>> = vec![Vec::new(), vec![segment(on, longest, "")]];
    jobs.extend(candidates.iter().map(|c| c.segments.clone()));
    let done = AtomicUsize::new(0);
    let run = |job: &Vec<(String, f64)>| {
        let result = run(registry, document, &base.settings(job), stop);
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, jobs.len());
        result
    };
    // a stopped run is `None` and makes the whole result `None`
    let Some(trackers) = jobs.par_iter().map(run).collect::<Result<Option<Vec<Tracker>>, _>>()?
    else {
        return Ok(None);
    };
    let [before, straight, after @ ..] = trackers.as_slice() else { return Ok(None) };
    let counts = counting(before, &options.of)?;
    let mut suggestions: Vec<Suggestion> = candidates
        .iter()
        .zip(after)
        .map(|(c, tracker)| compare(c, tracker, straight, base.end, &counts))
        .collect();
    suggestions.sort_by(|a, b| b.bits.total_cmp(&a.bits));
    let title = |(c, counts): (&crate::Component, &bool)| counts.then(|| c.title(before.layout()));
    Ok(Some(ManoeuvrePlan {
        at_s: base.end,
        speed: base.speed,
        of: before.components().iter().zip(&counts).filter_map(title).collect(),
        suggestions,
    }))
}

/// Runs a scenario at the truth; `None` if it was stopped.
fn run(
    registry: &Registry,
    document: &Document,
    settings: &[String],
    stop: &AtomicBool,
) -> Result<Option<Tracker>, PlanError> {
    let scenario = Scenario::new(registry, document.clone(), settings)?;
    let mut assembly = scenario.assemble_at_truth()?;
    assembly.sinks.push(("plan".into(), Box::new(TrackerSink::new(1.0))));
    let mut finished = runner::run(assembly, stop, |_| {});
    if finished.interrupted {
        return Ok(None);
    }
    if let Some(error) = finished.error {
        return Err(error.into());
    }
    TrackerSink::take(&mut finished).map_or(Err(PlanError::NothingRecorded), |t| Ok(Some(t)))
}

/// Selects the components to improve.
fn counting(before: &Tracker, of: &[String]) -> Result<Vec<bool>, PlanError> {
    let components = before.components();
    if of.is_empty() {
        let open: Vec<bool> = before
            .status()
            .iter()
            .map(|n| matches!(n.verdict, Determination::InPart | Determination::NotDetermined))
            .collect();
        let all = components.iter().map(|c| !c.considered).collect();
        return Ok(if open.contains(&true) { open } else { all });
    }
    let is = |c: &crate::Component, asked: &String| {
        c.state == *asked || format!("{}.{}", c.state, c.name) == *asked
    };
    if let Some(unknown) = of.iter().find(|asked| !components.iter().any(|c| is(c, asked))) {
        let mut names: Vec<&str> = components.iter().map(|c| c.state.as_str()).collect();
        names.dedup();
        return Err(PlanError::option(
            format!("--for {unknown}"),
            format!("there is no such state; the states are {}", names.join(", ")),
        ));
    }
    Ok(components.iter().map(|c| of.iter().any(|asked| is(c, asked))).collect())
}

fn compare(
    candidate: &Candidate,
    with: &Tracker,
    straight: &Tracker,
    from: f64,
    counts: &[bool],
) -> Suggestion {
    let n = counts.len();
    let end = from + candidate.duration();
    let (times, values) = straight.history();
    let row = times.partition_point(|t| *t <= end + 1e-6).saturating_sub(1);
    let without = &values[row * n..(row + 1) * n];
    let mut improves: Vec<(usize, Improvement)> =
        (with.components().iter().zip(with.status()).enumerate())
            .map(|(i, (c, now))| {
                let improvement = Improvement {
                    title: c.title(with.layout()),
                    unit: c.unit.to_owned(),
                    without: without[i] * now.reference,
                    with: now.sigma,
                    bits: (without[i] / now.normalised()).log2(),
                    verdict: now.verdict,
                };
                (i, improvement)
            })
            .collect();
    let bits = improves.iter().filter(|(i, _)| counts[*i]).map(|(_, m)| m.bits).sum();
    improves.retain(|(_, m)| m.bits > 0.1);
    improves.sort_by(|a, b| b.1.bits.total_cmp(&a.1.bits));
    Suggestion {
        name: candidate.name.to_owned(),
        segments: candidate.segments.iter().map(|s| s.0.clone()).collect(),
        duration_s: candidate.duration(),
        bits,
        improves: improves.into_iter().map(|m| m.1).collect(),
    }
}

impl Improvement {
    /// Formats as `dvl.misalignment roll 0.4 to 0.09 deg`.
    pub fn text(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!(
            "{} {} to {}{unit}",
            self.title,
            words::short(self.without),
            words::short(self.with)
        )
    }
}
