//! The definition of a campaign: its points, its runs, and the part that a shard does.

use crate::columns::Columns;
use crate::error::{CampaignError, ShardError};
use crate::grid::interval;
use navfuse_core::document::Document;
use navfuse_core::plugin::{BuildError, Registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::time::{Span, Time};
use serde::{Deserialize, Serialize};

/// Largest number of runs of a point. Run seeds are `seed * MAX_RUNS + run`, so two campaigns with
/// different seeds share no run seed.
pub const MAX_RUNS: usize = 1_000_000;

/// Default number of recorded epochs of a run.
const EPOCHS: f64 = 300.0;

/// The quantities that are drawn at random for each run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum InitialErrors {
    /// Initial errors and true parameters, from the priors, and the measurement noise.
    #[default]
    Drawn,
    /// The measurement noise; all else is as the scenario gives it.
    Given,
}

/// Options of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Runs of each point; 0 computes the bound alone.
    pub runs: usize,
    /// Seed of the campaign; `None` takes the scenario's seed.
    pub seed: Option<u64>,
    /// Interval of the recorded epochs, s; `None` records about 300 epochs a run.
    pub every: Option<f64>,
    /// Time from which errors and uncertainties enter the statistics, s; `None` is the start.
    pub from: Option<f64>,
    /// Choice of the quantities drawn for each run.
    pub initial_errors: InitialErrors,
    /// Grid: each key with its values, see [`variation`].
    pub vary: Vec<(String, Vec<String>)>,
}

/// One point of the grid.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Point {
    /// Value of each varied key.
    pub values: Vec<String>,
}

/// A part of a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the part, from 1.
    pub index: usize,
    /// Number of parts.
    pub count: usize,
}

impl std::str::FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let numbers = text.split_once('/').map(|(i, n)| (i.trim().parse(), n.trim().parse()));
        match numbers {
            Some((Ok(index), Ok(count))) if (1..=count).contains(&index) => {
                Ok(Self { index, count })
            }
            _ => Err(ShardError { text: text.to_owned() }),
        }
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// One job: a run, or the bound of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Job {
    /// Index of the point in the grid.
    pub point: usize,
    /// Number of the run, from 1; 0 is the bound.
    pub run: usize,
}

/// Complete definition of a campaign. Two shards belong together if their campaigns have no
/// [`Campaign::difference`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Campaign {
    /// Version of the program.
    pub version: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Keys that vary.
    pub keys: Vec<String>,
    /// Points of the grid; the last key varies fastest.
    pub points: Vec<Point>,
    /// Runs of each point.
    pub runs: usize,
    /// Seed of the campaign.
    pub seed: u64,
    /// Interval of the recorded epochs, ns.
    pub every: i64,
    /// Time from which errors and uncertainties enter the statistics, s.
    pub from: Option<f64>,
    /// Choice of the quantities drawn for each run.
    #[serde(rename = "start")]
    pub initial_errors: InitialErrors,
    /// Set if the runs are smoothed, and their smoothed estimates judged.
    #[serde(default)]
    pub smooths: bool,
    /// Columns of the tables.
    pub columns: Columns,
    /// Changes of the scenario's file, as the user wrote them.
    pub overrides: Vec<String>,
    /// Scenario in TOML, with every change applied.
    pub text: String,
}

impl Campaign {
    /// Defines a campaign of a scenario. It composes every point, so that an error in the scenario
    /// is reported before the first run.
    ///
    /// # Errors
    /// Returns an error if a point does not compose, if a source is not simulated, or if no truth
    /// is known.
    pub fn new(
        registry: &Registry,
        document: &Document,
        options: &Options,
    ) -> Result<Self, CampaignError> {
        if options.runs > MAX_RUNS {
            return Err(CampaignError::option(
                format!("--runs {}", options.runs),
                format!("at most {MAX_RUNS}"),
            ));
        }
        check_keys(&options.vary, options.initial_errors)?;
        let base = Scenario::new(registry, document.clone(), &[]).map_err(BuildError::from)?;
        let seed = match options.seed {
            Some(seed) => seed,
            None => base.compose()?.seed,
        };
        if seed > i64::MAX as u64 / (MAX_RUNS as u64 + 1) {
            return Err(CampaignError::option(
                format!("--seed {seed}"),
                "the seed of a campaign is at most 9e12",
            ));
        }
        let mut campaign = Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scenario: base.name(),
            keys: options.vary.iter().map(|v| v.0.clone()).collect(),
            points: grid(&options.vary),
            runs: options.runs,
            seed,
            every: 1,
            from: None,
            initial_errors: options.initial_errors,
            smooths: false,
            columns: Columns::default(),
            overrides: document.overrides().to_vec(),
            text: document.to_toml(),
        };
        campaign.from = options.from;
        let (mut longest, mut last) = (0.0_f64, None);
        for point in 0..campaign.points.len() {
            let scenario = campaign.scenario(registry, document, Job { point, run: 1 })?;
            if !scenario.simulates().map_err(BuildError::from)? {
                return Err(CampaignError::Unsuitable(
                    "a recording has the noise of a single run: use a scenario with simulated \
                     sources, such as [source.simulation]",
                ));
            }
            let assembly = scenario.assemble(None)?;
            campaign.columns.add(&assembly.composition);
            let estimator = &assembly.composition.estimator;
            campaign.smooths |= estimator.smooths();
            let end = assembly.sources.iter().filter_map(|(_, s)| s.end()).max();
            let end = [end, estimator.stop()].into_iter().flatten().min();
            longest = longest
                .max(end.map_or(0.0, |end| end.since(estimator.start().max(Time::default()))));
            last = last.max(end);
        }
        if campaign.columns.known() == 0 {
            return Err(CampaignError::Unsuitable(
                "no error can be computed without the truth: simulate a reference, \
                 [sensor.reference.simulation]",
            ));
        }
        if let Some((from, end)) =
            campaign.from.zip(last).filter(|(from, end)| *from > end.seconds())
        {
            return Err(CampaignError::option(
                format!("--from {from} s"),
                format!("the runs end at {end}"),
            ));
        }
        campaign.every = match options.every {
            Some(every) if !(every > 0.0 && every < 1e9) => {
                return Err(CampaignError::option(
                    format!("--every {every} s"),
                    "give a positive time",
                ));
            }
            Some(every) => Span::from_seconds(every).map_or(1, Span::nanos),
            None => interval(longest, EPOCHS),
        };
        Ok(campaign)
    }

    /// Returns the scenario of a job.
    ///
    /// # Errors
    /// Returns an error if a varied key cannot be set.
    pub fn scenario<'a>(
        &self,
        registry: &'a Registry,
        document: &Document,
        job: Job,
    ) -> Result<Scenario<'a>, CampaignError> {
        let mut settings = self.settings(job.point);
        settings.push(format!("seed={}", self.seed_of(job.run)));
        if self.initial_errors == InitialErrors::Drawn && job.run > 0 {
            settings.push("estimator.draw=all".into());
        }
        Ok(Scenario::new(registry, document.clone(), &settings).map_err(BuildError::from)?)
    }

    /// Returns the seed of a run: the campaign's seed times `MAX_RUNS`, plus the number of the
    /// run.
    pub fn seed_of(&self, run: usize) -> u64 {
        self.seed * MAX_RUNS as u64 + run as u64
    }

    /// Returns the settings of a point.
    pub fn settings(&self, point: usize) -> Vec<String> {
        let values = &self.points[point].values;
        self.keys.iter().zip(values).map(|(key, value)| format!("{key}={value}")).collect()
    }

    /// Returns the arguments with which `navfuse run SCENARIO` repeats one run.
    pub fn again(&self, point: usize, run: usize) -> String {
        let mut settings = self.overrides.clone();
        settings.extend(self.settings(point));
        if self.initial_errors == InitialErrors::Drawn {
            settings.push("estimator.draw=all".into());
        }
        settings.push(format!("seed={}", self.seed_of(run)));
        let plain = |c: char| c.is_ascii_alphanumeric() || "._-+=/:,%".contains(c);
        let word = |s: &String| {
            if s.chars().all(plain) { format!("--set {s}") } else { format!("--set {s:?}") }
        };
        settings.iter().map(word).collect::<Vec<_>>().join(" ")
    }

    /// The campaign as it is read back from a file: a number with a fraction may differ in its last
    /// bit.
    pub(crate) fn read_back(&self) -> Self {
        let text = serde_json::to_string(self).ok();
        text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_else(|| self.clone())
    }

    /// Describes the first difference between two campaigns; `None` if their parts belong together.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let properties = |campaign: &Self| {
            [
                ("version", campaign.version.clone()),
                ("scenario", campaign.scenario.clone()),
                (
                    "--vary",
                    format!(
                        "{:?} {:?}",
                        campaign.keys,
                        campaign.points.iter().map(|p| &p.values).collect::<Vec<_>>()
                    ),
                ),
                ("--runs", campaign.runs.to_string()),
                ("--seed", campaign.seed.to_string()),
                ("--every", format!("{} s", Time::from_nanos(campaign.every).seconds())),
                ("--from", format!("{:?}", campaign.from)),
                ("--start", format!("{:?}", campaign.initial_errors).to_lowercase()),
            ]
        };
        let pairs = properties(self).into_iter().zip(properties(other));
        let differing = pairs.into_iter().find(|(a, b)| a != b);
        let text = (self.text != other.text || self.columns != other.columns)
            .then_some("the scenarios differ");
        differing
            .map(|((what, a), (_, b))| format!("{what} is {a} instead of {b}"))
            .or_else(|| text.map(Into::into))
    }

    /// Lists the jobs of a shard, or of the whole campaign, in order.
    pub fn jobs(&self, shard: Option<Shard>) -> Vec<Job> {
        let per_point = self.runs + 1;
        let count = self.points.len() * per_point;
        let range =
            shard.map_or(0..count, |s| (s.index - 1) * count / s.count..s.index * count / s.count);
        range.map(|k| Job { point: k / per_point, run: k % per_point }).collect()
    }
}

/// Rejects keys and values that give no point of their own.
fn check_keys(
    vary: &[(String, Vec<String>)],
    initial_errors: InitialErrors,
) -> Result<(), CampaignError> {
    for (k, (key, values)) in vary.iter().enumerate() {
        let refused = |why: &str| Err(CampaignError::option(format!("--vary {key}"), why));
        match key.as_str() {
            "seed" => {
                return refused(
                    "each run has a seed of its own; set the campaign's seed with --seed",
                );
            }
            "estimator.draw" if initial_errors == InitialErrors::Drawn => {
                return refused(
                    "every run draws all quantities; --start=given leaves the draw to the scenario",
                );
            }
            _ if vary[..k].iter().any(|(other, _)| other == key) => {
                return refused("the key is given twice; give all its values at once, KEY=V1,V2");
            }
            _ => {}
        }
        if let Some(value) = values.iter().enumerate().find(|(k, v)| values[..*k].contains(v)) {
            return refused(&format!("the value {} is given twice", value.1));
        }
    }
    Ok(())
}

/// Lists all combinations; the last key varies fastest.
fn grid(vary: &[(String, Vec<String>)]) -> Vec<Point> {
    vary.iter().fold(vec![Point::default()], |points, (_, values)| {
        let extended = points.iter().flat_map(|point| {
            values.iter().map(|value| Point {
                values: [point.values.as_slice(), std::slice::from_ref(value)].concat(),
            })
        });
        extended.collect()
    })
}

/// Parses `key.path=v1,v2,...`. Commas outside brackets, braces and quotes separate the values.
///
/// # Errors
/// Returns an error if the key or a value is missing.
pub fn variation(text: &str) -> Result<(String, Vec<String>), CampaignError> {
    let refused = |message: &str| CampaignError::option(format!("--vary {text:?}"), message);
    let (key, values) =
        text.split_once('=').ok_or_else(|| refused("give values too, key.path=v1,v2,..."))?;
    let (mut depth, mut quote, mut parts) = (0_i32, None, vec![String::new()]);
    for c in values.chars() {
        match (quote, c) {
            (None, '"' | '\'') => quote = Some(c),
            (Some(q), _) if c == q => quote = None,
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth -= 1,
            (None, ',') if depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(part) = parts.last_mut() {
            part.push(c);
        }
    }
    let parts: Vec<String> = parts.iter().map(|p| p.trim().to_owned()).collect();
    if key.trim().is_empty() || parts.iter().any(String::is_empty) {
        return Err(refused("give a key and values that are not empty, key.path=v1,v2,..."));
    }
    Ok((key.trim().to_owned(), parts))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn values_are_split_at_commas_outside_brackets_and_quotes() {
        let (key, values) = variation("a.b=1 cm/s, [\"0 m\", \"1 m\"],\"x,y\",{ s = 1, t = 2 }")
            .expect("a variation");
        assert_eq!(key, "a.b");
        assert_eq!(values, ["1 cm/s", "[\"0 m\", \"1 m\"]", "\"x,y\"", "{ s = 1, t = 2 }"]);
        assert!(
            variation("a.b").is_err() && variation("a=1,,2").is_err() && variation("=1").is_err()
        );
    }

    #[test]
    fn shards_are_the_jobs_in_order_once_each() {
        let campaign = Campaign {
            version: String::new(),
            scenario: String::new(),
            keys: vec!["a".into(), "b".into()],
            points: grid(&[
                ("a".into(), vec!["1".into(), "2".into()]),
                ("b".into(), vec!["x".into(), "y".into()]),
            ]),
            runs: 5,
            seed: 1,
            every: 1,
            from: None,
            initial_errors: InitialErrors::Drawn,
            smooths: false,
            columns: Columns::default(),
            overrides: vec!["sensor.dvl.noise=5 mm/s".into()],
            text: String::new(),
        };
        assert_eq!(
            campaign.again(1, 5),
            "--set \"sensor.dvl.noise=5 mm/s\" --set a=1 --set b=y --set estimator.draw=all --set \
             seed=1000005"
        );
        assert_eq!(campaign.settings(1), ["a=1", "b=y"]);
        let all = campaign.jobs(None);
        assert_eq!(
            (all.len(), all[0], all[23]),
            (24, Job { point: 0, run: 0 }, Job { point: 3, run: 5 })
        );
        for count in [1, 2, 7, 40] {
            let parts = (1..=count).flat_map(|index| campaign.jobs(Some(Shard { index, count })));
            assert_eq!(parts.collect::<Vec<_>>(), all);
        }
    }

    #[test]
    fn a_value_of_a_key_that_makes_no_point_of_its_own_is_refused() {
        let refused = |vary: &[(&str, &[&str])], start| {
            let vary: Vec<_> = vary
                .iter()
                .map(|(k, v)| ((*k).to_owned(), v.iter().map(|v| (*v).to_owned()).collect()))
                .collect();
            check_keys(&vary, start).is_err()
        };
        assert!(!refused(&[("a", &["1", "2"]), ("b", &["1", "2"])], InitialErrors::Drawn));
        assert!(refused(&[("a", &["1"]), ("a", &["2"])], InitialErrors::Drawn));
        assert!(refused(&[("a", &["1", "2", "1"])], InitialErrors::Drawn));
        assert!(refused(&[("seed", &["1", "2"])], InitialErrors::Given));
        assert!(refused(&[("estimator.draw", &["none"])], InitialErrors::Drawn));
        assert!(!refused(&[("estimator.draw", &["none", "start"])], InitialErrors::Given));
    }

    #[test]
    fn a_shard_has_a_number_and_a_count() {
        assert_eq!("3/7".parse(), Ok(Shard { index: 3, count: 7 }));
        assert!(["0/7", "8/7", "7", "a/b", "1/0"].iter().all(|t| t.parse::<Shard>().is_err()));
    }
}
