//! Sink that keeps the estimates and innovations of a run in memory, a column for each number.

use crate::names::{Names, index};
use navfuse_core::model::record::{Outcome, Record, UpdateRecord, Wants};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::state::Block;
use navfuse_core::state::manifold::Reading;
use navfuse_csv::{Axes, EstimateColumns};
use serde_json::{Value, json};

/// Columns of the innovations before those of the channels: time, NIS, threshold, outcome.
const BEFORE: usize = 4;

/// Innovations of a sensor.
pub struct Innovations {
    info: SensorInfo,
    /// Time, NIS, threshold and outcome; then innovation and 1-sigma of each channel.
    pub columns: Vec<Vec<f64>>,
    /// Outcomes in words; the column of the outcome has their indices.
    outcomes: Vec<String>,
}

impl Innovations {
    fn new(info: &SensorInfo) -> Self {
        let columns = vec![Vec::new(); BEFORE + 2 * info.channels.len()];
        Self { info: info.clone(), columns, outcomes: Vec::new() }
    }

    fn push(&mut self, update: &UpdateRecord<'_>) {
        let outcome = self.outcome(update.outcome) as f64;
        let head = [update.time.seconds(), update.nis, update.threshold, outcome];
        let (before, channels) = self.columns.split_at_mut(BEFORE);
        before.iter_mut().zip(head).for_each(|(column, value)| column.push(value));
        channels.iter_mut().for_each(|column| column.push(f64::NAN));
        for (channel, innovation, sigma) in update.channels() {
            for (k, value) in [innovation, sigma].into_iter().enumerate() {
                if let Some(last) = channels[2 * channel + k].last_mut() {
                    *last = value;
                }
            }
        }
    }

    /// Index of an outcome among those in words.
    fn outcome(&mut self, outcome: Outcome) -> usize {
        let names = || self.info.channels.iter().map(|c| c.column()).collect::<Vec<_>>();
        let words = match outcome {
            Outcome::Accepted => "accepted".to_owned(),
            Outcome::Placed => "placed".to_owned(),
            Outcome::Gated => "gated".to_owned(),
            Outcome::Rejected(why) => format!("rejected: {}", why.reason(&names())),
        };
        index(&mut self.outcomes, &words)
    }

    /// Set for a sensor without a record, such as the driving one.
    pub fn is_empty(&self) -> bool {
        self.outcomes.is_empty()
    }

    /// Names, units and outcomes, for Python.
    pub fn describe(&self) -> Value {
        let channels = &self.info.channels;
        json!({
            "sensor": self.info.name,
            "channels": channels.iter().map(|c| &*c.name).collect::<Vec<_>>(),
            "units": channels.iter().map(|c| c.unit.symbol()).collect::<Vec<_>>(),
            "outcomes": self.outcomes,
        })
    }
}

/// Keeps estimates and innovations.
#[derive(Default)]
pub struct Recorder {
    covariance: bool,
    /// The estimate as a row of numbers.
    pub estimate: EstimateColumns,
    blocks: Vec<Value>,
    /// Time, then the columns of the estimate.
    pub columns: Vec<Vec<f64>>,
    /// Innovations of each sensor.
    pub innovations: Vec<Innovations>,
}

impl Recorder {
    /// A recorder, which also keeps the covariance between all states if it is wanted.
    pub fn new(covariance: bool) -> Self {
        Self { covariance, ..Self::default() }
    }

    /// Headings of the columns, and the blocks that they belong to, for Python.
    pub fn describe(&self) -> Value {
        json!({ "headings": self.estimate.headings(), "blocks": self.blocks })
    }
}

/// Names and units of a block.
fn names(block: &Block) -> Names {
    let (n, display) = (block.operations.tangent, &block.spec.display);
    let name = |k: usize| display.components.get(k).map_or_else(|| k.to_string(), |n| (*n).into());
    Names {
        name: block.name.clone(),
        unit: display.unit.to_owned(),
        mode: block.spec.mode,
        components: (0..n).map(name).collect(),
        geodetic: block.operations.reading == Reading::Tangent,
        rotation: block.operations.reading == Reading::Angles && n == 3,
    }
}

impl Sink for Recorder {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::UPDATES
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.estimate = EstimateColumns::new(run, self.covariance, Axes::Ned);
        self.columns = vec![Vec::new(); self.estimate.headings().len()];
        self.innovations = run.sensors.iter().map(Innovations::new).collect();
        let reference = run.sensors.iter().any(|s| s.purpose == Purpose::Reference);
        let mut first = 1; // after the time
        for block in &run.layout.blocks {
            let error = reference || block.spec.truth.is_some();
            self.blocks.push(names(block).describe(first, error));
            first += (2 + usize::from(error)) * block.operations.tangent;
        }
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match record {
            Record::Epoch(epoch) => {
                let row = std::iter::once(epoch.state.time.seconds());
                let row = row.chain(self.estimate.row(epoch).iter().copied());
                self.columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
            }
            Record::Update(update) => self.innovations[update.sensor.0].push(update),
            _ => {}
        }
        Ok(())
    }
}
