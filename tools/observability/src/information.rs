//! The share of each sensor in the information about each state, as a derived quantity of a run.

use crate::tracker::Tracker;
use navfuse_core::model::record::Derived;
use navfuse_core::prelude::*;
use navfuse_core::units::Duration;
use navfuse_core::units::time::Span;
use std::sync::Arc;

/// Derives the share of each sensor in the information about each state, from 0 to 1. Log, recording
/// and page have it as the quantity `information`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Information {
    /// Interval between two values; the last one is that of the end. Default: 10 s.
    #[serde(default = "ten_seconds")]
    pub every: Positive<Duration>,
}

fn ten_seconds() -> Positive<Duration> {
    Positive::from_si(10.0)
}

impl SinkType for Information {
    const TYPE: &'static str = "information";
    const DEFAULT: bool = false;

    fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let every = Span::from_seconds(self.every.value().si()).unwrap_or(Span::MAX);
        let [next, last] = [Time::MIN; 2];
        Ok(Box::new(Following { every, next, last, followed: None }))
    }
}

/// Follows a run.
struct Following {
    every: Span,
    /// Time at which the next value is due.
    next: Time,
    /// Time of the last value.
    last: Time,
    followed: Option<Followed>,
}

/// The tracker of a run, and the names of the quantity's rows and columns.
struct Followed {
    tracker: Tracker,
    states: Arc<[String]>,
    sensors: Arc<[String]>,
}

impl Followed {
    fn new(run: &RunInfo) -> Self {
        let tracker = Tracker::new(run, f64::INFINITY);
        let states = tracker.components().iter().map(|c| c.title(tracker.layout())).collect();
        let measuring = tracker.sensors().iter().filter(|s| s.measures);
        let sensors = measuring.map(|s| s.name.clone()).collect();
        Self { tracker, states, sensors }
    }

    /// Share of each measuring sensor in the bits about each component, row by row; zero where no
    /// sensor gave any.
    fn shares(&self) -> Vec<f64> {
        let measuring = || self.tracker.sensors().iter().filter(|s| s.measures);
        let row = |i: usize| {
            let sum: f64 = measuring().map(|s| s.bits[i]).sum();
            measuring().map(move |s| if sum > 0.0 { s.bits[i] / sum } else { 0.0 })
        };
        (0..self.states.len()).flat_map(row).collect()
    }
}

impl Sink for Following {
    fn wants(&self) -> Wants {
        Tracker::wants()
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.followed = Some(Followed::new(run));
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Some(followed) = &mut self.followed {
            followed.tracker.take(record);
        }
        Ok(())
    }

    fn derive(&mut self, end: bool) -> Option<Derived> {
        let followed = self.followed.as_ref().filter(|f| f.tracker.started())?;
        let time = followed.tracker.span().1;
        if time == self.last || (time < self.next && !end) {
            return None;
        }
        (self.last, self.next) = (time, time.next_multiple(self.every));
        let (name, unit) = ("information".into(), "".into());
        let (rows, columns) = (Arc::clone(&followed.states), Arc::clone(&followed.sensors));
        Some(Derived { time, name, unit, rows, columns, values: followed.shares() })
    }
}

/// Registers the sink type `information`.
#[derive(Clone, Copy, Debug)]
pub struct ObservabilityPlugin;

impl Plugin for ObservabilityPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sink::<Information>();
    }

    navfuse_core::named_after_crate!();
}
