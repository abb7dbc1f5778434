//! The estimator: the filter without the curved sensors until the place is decided, and the filter with
//! all of them from then on.

use crate::search::{LONGEST, Search};
use crate::trail::Following;
use navfuse_core::checkpoint::Io;
use navfuse_core::compose::Composition;
use navfuse_core::compose::estimator::{Estimator, EstimatorType, Linearised};
use navfuse_core::filter::{Ekf, EstimatorError};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::start::AlignmentReport;
use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::{Epoch, Event, Level, Observer, Rejection, Repetition, Truth};
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::{Block, State};
use navfuse_core::units::sample::Sample;
use std::borrow::Cow;
use std::sync::Arc;

/// An extended Kalman filter that begins with many hypotheses of the horizontal position.
pub struct PointMass {
    filter: Ekf,
    search: Option<Box<Search>>,
    /// Sensors that stay out after a search without a decision.
    left_out: Vec<bool>,
    /// Set when the place was decided, until the caller knows it.
    jumped: bool,
}

impl EstimatorType for PointMass {
    const TYPE: &'static str = "point-mass";

    fn check(composition: &Composition) -> Result<(), ComposeError> {
        let layout = &composition.layout;
        let estimated = layout.vehicle().position.is_some_and(|p| layout.block(p).estimated());
        if estimated {
            return Ok(());
        }
        let text = "\"point-mass\" searches for the position of a vehicle, and no process estimates \
                    one: add one, such as [process.ins], or choose type = \"ekf\"";
        Err(ComposeError::new("type", text))
    }

    fn create(composition: Composition) -> Box<dyn Estimator> {
        let filter = Ekf::new(composition);
        let first = Linearised::snapshot(&filter);
        let search = Search::new(filter.composition(), first).map(Box::new);
        let left_out = vec![false; filter.composition().sensors.len()];
        Box::new(Self { filter, search, left_out, jumped: false })
    }
}

impl PointMass {
    /// Takes a sample during the search.
    fn search(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let Self { filter, search: Some(search), .. } = self else { return Ok(()) };
        let ekf: &mut dyn Linearised = filter;
        if ekf.searching() {
            // the alignment gives its samples back when it ends
            ekf.take(sample, observer)?;
        } else {
            search.note(ekf, sample);
            if search.holds(ekf, sample) {
                return Ok(());
            }
            let trail = Arc::make_mut(&mut search.trail);
            ekf.take(sample, &mut Following { trail, observer })?;
        }
        if let Some(samples) = ekf.take_found() {
            search.begin(ekf.snapshot());
            return samples.iter().try_for_each(|sample| self.search(sample, observer));
        }
        search.weigh(ekf, ekf.state().time);
        self.decide(observer);
        Ok(())
    }

    /// Decides for a place if the samples do, and goes on from there.
    fn decide(&mut self, observer: &mut dyn Observer) {
        let Self { filter, search: place, jumped, .. } = self;
        let Some(search) = place.as_mut().filter(|search| search.is_due()) else { return };
        filter_settles(filter, observer, &mut search.trail);
        let ekf: &mut dyn Linearised = filter;
        let (here, before) = (ekf.state().clone(), ekf.snapshot());
        let decided = search.decide(ekf).and_then(|decided| {
            let adopted = search.adopt(ekf, &here, decided.best.offset, observer);
            if adopted.is_none() {
                observer.repetition(Repetition::Failed);
            }
            adopted.map(|adopted| (decided, adopted))
        });
        let Some((decided, adopted)) = decided else {
            ekf.leave_course();
            ekf.restore(&before);
            if search.start.is_some_and(|start| ekf.time().since(start) > LONGEST) {
                self.give_up(observer);
            }
            return;
        };
        let [north, east] = adopted.offset;
        let text = format!(
            "the place is decided by {} samples of {}: {north:.1} m north and {east:.1} m east of the \
             track without them, of {} places; the odds against the next one are {}",
            search.used,
            search.names(ekf.composition()),
            decided.places,
            odds(decided.odds),
        );
        let time = ekf.time();
        observer.event(Event { time, level: Level::Info, about: "estimator".into(), text });
        *jumped = true;
        *place = None;
    }

    /// Ends the search without a decision: the filter stays without the curved sensors.
    fn give_up(&mut self, observer: &mut dyn Observer) {
        let Some(search) = self.search.take() else { return };
        if !search.curved.contains(&true) {
            return;
        }
        self.left_out.clone_from(&search.curved);
        let names = search.names(self.filter.composition());
        let time = Estimator::time(&self.filter);
        observer.finding(Finding {
            time,
            about: "estimator".into(),
            severity: Severity::Doubtful,
            basis: Basis::Comparison,
            text: format!(
                "{} samples of {names} do not decide between places within the prior of the position; \
                 the estimate is without them",
                search.used
            ),
            remedy: "state a narrower prior of the position, or let the vehicle pass more of the map or \
                     around the beacon"
                .to_owned(),
        });
    }
}

/// Brings the covariance to the time of the estimate, with the trail.
fn filter_settles(
    filter: &mut Ekf,
    observer: &mut dyn Observer,
    trail: &mut Arc<crate::trail::Trail>,
) {
    let trail = Arc::make_mut(trail);
    Estimator::settle(filter, &mut Following { trail, observer });
}

/// Odds of a logarithm in words.
fn odds(log: f64) -> String {
    if log.is_infinite() { "those of a single place".to_owned() } else { format!("e^{log:.0}") }
}

impl Estimator for PointMass {
    fn composition(&self) -> &Composition {
        self.filter.composition()
    }

    fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        if self.search.is_some() {
            self.search(sample, observer)
        } else if self.left_out[sample.sensor.0] {
            self.filter.reject(sample, Rejection::Isolated, observer);
            Ok(())
        } else {
            self.filter.process(sample, observer)
        }
    }

    fn finish(&mut self, observer: &mut dyn Observer) {
        Estimator::finish(&mut self.filter, observer);
        self.give_up(observer);
    }

    fn running(&self) -> bool {
        self.filter.running()
    }

    fn state(&self) -> &State {
        self.filter.state()
    }

    fn covariance(&self) -> Cow<'_, Covariance> {
        self.filter.covariance()
    }

    fn settle(&mut self, observer: &mut dyn Observer) {
        match &mut self.search {
            Some(search) => filter_settles(&mut self.filter, observer, &mut search.trail),
            None => Estimator::settle(&mut self.filter, observer),
        }
    }

    fn epoch(&mut self) -> Epoch<'_> {
        self.filter.epoch()
    }

    fn truth(&self) -> Truth<'_> {
        self.filter.truth()
    }

    fn unfinished(&self) -> Vec<Event> {
        Estimator::unfinished(&self.filter)
    }

    fn lacking(&self) -> Option<&Block> {
        Estimator::lacking(&self.filter)
    }

    fn alignments(&self) -> Vec<(String, AlignmentReport)> {
        Estimator::alignments(&self.filter)
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        self.left_out.iter_mut().for_each(|out| io.pass(out));
        if io.restores() {
            self.search = None;
        } else if self.search.is_some() {
            io.refuse("it searches for the place of the vehicle");
        }
        self.filter.memory(io);
    }

    fn has_jumped(&mut self) -> bool {
        std::mem::take(&mut self.jumped)
    }
}
