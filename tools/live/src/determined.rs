//! What the samples so far determine, and how much each sensor has to do with it.

use crate::status::{SensorStatus, StateStatus};
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_observability::{Tracker, words};
use std::sync::{Arc, Mutex, PoisonError};

/// The tracker of a run, which the filter fills and the driver reads.
#[derive(Clone, Default)]
pub struct Determined {
    tracker: Arc<Mutex<Option<Tracker>>>,
    /// Set for a run that goes on from a checkpoint.
    resumed: bool,
}

impl Determined {
    /// A tracker, of a run that goes on from a checkpoint or not.
    pub fn new(resumed: bool) -> Self {
        Self { tracker: Arc::default(), resumed }
    }

    fn look<T>(&self, look: impl FnOnce(&mut Option<Tracker>) -> T) -> T {
        // a sum is a sum, whatever happened to a thread that held it
        look(&mut self.tracker.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The components of the state, once they are judged.
    pub fn states(&self) -> Vec<StateStatus> {
        self.look(|tracker| {
            let Some(tracker) = tracker.as_ref().filter(|tracker| tracker.started()) else {
                return Vec::new();
            };
            let state = |(i, component): (usize, &navfuse_observability::Component)| {
                let now = &tracker.status()[i];
                StateStatus {
                    title: component.title(tracker.layout()),
                    sigma: now.sigma,
                    unit: component.unit.to_owned(),
                    verdict: now.verdict,
                    missing: words::missing(tracker, i),
                    manoeuvre: words::manoeuvre(tracker, i).map(str::to_owned),
                }
            };
            let all = tracker.components().iter().enumerate().map(state);
            all.filter(|state| state.sigma.is_finite()).collect()
        })
    }

    /// Gives each sensor its share in the information about the states.
    pub fn share(&self, sensors: &mut [SensorStatus]) {
        self.look(|tracker| {
            let Some(tracker) = tracker else { return };
            let bits = |k: usize| tracker.sensors()[k].bits.iter().sum::<f64>();
            let all: f64 = (0..tracker.sensors().len()).map(bits).sum();
            for (k, sensor) in sensors.iter_mut().enumerate().take(tracker.sensors().len()) {
                let measures = tracker.sensors()[k].measures && all > 0.0;
                sensor.share = measures.then(|| bits(k) / all);
            }
        });
    }
}

impl Sink for Determined {
    fn wants(&self) -> Wants {
        Tracker::wants()
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        let mut tracker = Tracker::new(run, f64::INFINITY);
        if self.resumed {
            tracker.begin_with_prior();
        }
        self.look(|shared| *shared = Some(tracker));
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        self.look(|tracker| tracker.as_mut().map(|tracker| tracker.take(record)));
        Ok(())
    }
}
