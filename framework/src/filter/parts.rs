//! The parts of a filter that own its state.

use super::estimate::Estimate;
use super::judge::branch::Branch;
use super::judge::signature::Signatures;
use super::judge::slot::SensorSlot;
use super::judge::watch::Watch;
use super::past::clones::Clones;
use super::past::delay::RecentStates;
use super::propagate::pace::Pace;
use super::propagate::propagation::Propagation;
use super::screen::screened::Screening;
use super::start::beginning::Beginning;
use super::start::truth::Known;
use super::transients::seen::Transients;
use crate::checkpoint::{Io, Saved};
use crate::compose::Composition;
use crate::compose::snapshot::Kept;
use crate::state::State;
use crate::state::covariance::Reach;
use crate::units::time::Time;

/// Everything that changes while the filter runs, in parts that own their state; a clone is a
/// snapshot.
#[derive(Clone)]
pub(super) struct Parts {
    pub(super) estimate: Estimate,
    /// Stage, initial draws and alignments.
    pub(super) start: Beginning,
    /// Truth that references and scenario give.
    pub(super) truth: Known,
    /// Cadence of the driving sensor, and the measurements that wait for it.
    pub(super) pace: Pace,
    /// Screening of the driving sensor.
    pub(super) screening: Screening,
    /// Processes, held inputs and the transition.
    pub(super) propagation: Propagation,
    /// Gate, lock-out and tests of each sensor.
    pub(super) sensors: Vec<SensorSlot>,
    /// The case that the filter does not follow, while the evidence decides for neither.
    pub(super) branch: Option<Branch>,
    /// For each sensor of which the first sample may be wrong, the case that it is.
    pub(super) firsts: Vec<Branch>,
    /// Sensor and time of the first samples that were wrong.
    pub(super) wrong: Vec<(usize, Time)>,
    /// Score tests for unmodelled errors; `None` where they do not hold, or no longer hold.
    pub(super) signatures: Option<Signatures>,
    /// Monitor and detectors.
    pub(super) watch: Watch,
    /// Past states that sensors read.
    pub(super) clones: Vec<Clones>,
    /// Recent states, kept where some sensor has a time offset.
    pub(super) history: Option<RecentStates>,
    /// Blocks that come and go.
    pub(super) transients: Transients,
}

impl Saved for Parts {
    fn saved(&mut self, io: &mut Io<'_>) {
        let Self {
            estimate,
            start,
            truth,
            pace,
            screening,
            propagation,
            sensors,
            branch,
            firsts,
            wrong,
            signatures,
            watch,
            clones,
            history,
            transients,
        } = self;
        io.part("estimate", |io| io.pass(estimate));
        io.part("start", |io| io.pass(start));
        io.part("truth", |io| io.pass(truth));
        io.part("driving sensor", |io| io.pass(pace));
        io.part("screening", |io| io.pass(screening));
        io.part("processes", |io| io.pass(propagation));
        sensors.iter_mut().for_each(|slot| io.part(slot.name.clone(), |io| io.pass(slot)));
        io.part("branch", |io| io.pass(branch));
        io.part("first samples", |io| {
            io.pass(firsts);
            io.pass(wrong);
        });
        io.part("signatures", |io| io.while_there(signatures));
        io.part("monitor and detectors", |io| io.pass(watch));
        io.part("past states", |io| io.each(clones));
        io.part("time offsets", |io| io.each(history));
        io.part("states that come and go", |io| io.pass(transients));
    }
}

impl Kept for Parts {
    fn boxed_clone(&self) -> Box<dyn Kept> {
        Box::new(self.clone())
    }

    fn state(&self) -> &State {
        &self.estimate.state
    }

    fn offset(&self) -> &[f64] {
        self.estimate.offset()
    }

    fn size(&self) -> usize {
        let Self { estimate, propagation, pace, history, .. } = self;
        let history = history.as_ref().map_or(0, RecentStates::size);
        let matrices = estimate.covariance.size() + propagation.size();
        size_of::<Self>() + matrices + history + pace.size()
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        io.pass(self);
    }
}

/// The errors that the filter follows from sample to sample.
pub(super) fn followed<'a>(
    sensors: &'a mut [SensorSlot],
    branch: &'a mut Option<Branch>,
    firsts: &'a mut [Branch],
) -> impl Iterator<Item = &'a mut Reach> {
    let reaches = sensors.iter_mut().map(|slot| &mut slot.reach);
    reaches.chain(branch.iter_mut().chain(firsts).map(|branch| &mut branch.effect))
}

impl Parts {
    pub(super) fn new(composition: &Composition) -> Self {
        let layout = &composition.layout;
        let propagation = Propagation::new(composition);
        let slot = |sensor| SensorSlot::new(sensor, layout.tangent);
        Self {
            estimate: Estimate::new(layout),
            start: Beginning::new(composition),
            truth: Known::new(composition),
            pace: Pace::new(),
            screening: Screening::new(composition),
            sensors: composition.sensors.iter().map(slot).collect(),
            branch: None,
            firsts: Vec::new(),
            wrong: Vec::new(),
            signatures: Signatures::new(composition, propagation.transition()),
            propagation,
            watch: Watch::new(composition),
            clones: Clones::of(composition),
            history: RecentStates::new(composition),
            transients: Transients::new(layout.labels),
        }
    }
}
