//! The error-state extended Kalman filter.
//!
//! The filter owns injection, reset, gating and the covariance; models never touch them.
//! Measurements wait until the samples of the driving sensor reach their time. The filter then
//! splits the driving interval there, so that every update happens at its own time.

use crate::compose::Composition;
use crate::compose::draw::Draw;
use crate::compose::truth::TrueState;
use crate::filter::course::guide::{Guide, Offset};
use crate::filter::judge::signature::Signatures;
use crate::filter::judge::slot::SensorSlot;
use crate::filter::past::clones::Clones;
use crate::filter::past::delay::History;
use crate::filter::propagate::cadence::Cadence;
use crate::filter::propagate::held::Held;
use crate::filter::propagate::inputs::Corrected;
use crate::filter::propagate::passage::Passage;
use crate::filter::propagate::pooled::PooledSteps;
use crate::filter::screen::screening::Screen;
use crate::filter::start::stage::Stage;
use crate::filter::transients::presence::Presence;
use crate::filter::update::points::SigmaPoints;
use crate::filter::update::refine::Refinement;
use crate::model::process::ProcessModel;
use crate::model::process::monitor::Monitor;
use crate::model::process::start::InitialAlignment;
use crate::model::record::{Epoch, Outcome, Rejection, Truth, UpdateRecord};
use crate::model::sensor::Role;
use crate::model::sensor::detector::Detector;
use crate::model::sensor::roster::Changes;
use crate::model::simulate::Random;
use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::dynamics::BlockDynamics;
use crate::state::{Block, Layout, Mode, State};
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::Time;
use std::collections::VecDeque;
use std::sync::Arc;

/// Largest number of measurements that wait for the driving sensor.
pub(super) const MAX_PENDING: usize = 1024;

/// An error-state EKF, which takes samples in order of time.
pub struct Ekf {
    pub(super) composition: Composition,
    pub(super) layout: Arc<Layout>,
    /// Sensor that drives the first driven process.
    pub(super) driver: Option<usize>,
    pub(super) considered: Vec<bool>,
    /// Work space for a Cholesky factor.
    pub(super) lower: Vec<f64>,
    pub(super) update: Update,
    pub(super) points: SigmaPoints,
    pub(super) refinement: Refinement,
    /// Driving sensors with input models.
    pub(super) corrected: Vec<Corrected>,
    /// Set for the unscented filter.
    pub(super) passage: Option<Box<Passage>>,
    /// Work space for the blocks that come and go.
    pub(super) changes: Changes,
    /// Trajectory at which a further pass of the smoother linearises.
    pub(super) guide: Option<Box<Guide>>,
    pub(super) memory: Memory,
}

/// Everything that changes while the filter runs; a clone is a snapshot.
#[derive(Clone)]
pub(super) struct Memory {
    pub(super) stage: Stage,
    pub(super) draws: Option<Random>,
    pub(super) state: State,
    pub(super) covariance: Covariance,
    /// Estimate relative to the state, where the state is that of a given trajectory.
    pub(super) offset: Option<Offset>,
    pub(super) transition: Transition,
    /// Steps that the covariance has not taken yet, where it has a rate of its own.
    pub(super) pool: Option<PooledSteps>,
    pub(super) dynamics: BlockDynamics,
    pub(super) processes: Vec<Box<dyn ProcessModel>>,
    /// Initial alignments, one place per process.
    pub(super) alignments: Vec<Option<Box<dyn InitialAlignment>>>,
    pub(super) sensors: Vec<SensorSlot>,
    /// Detectors of the pseudo-measurements, each with the index of its sensor.
    pub(super) detectors: Vec<(usize, Box<dyn Detector>)>,
    /// Driving sensors beside the first.
    pub(super) held: Vec<Held>,
    /// Blocks that come and go.
    pub(super) presence: Presence,
    /// Past states that sensors read.
    pub(super) clones: Vec<Clones>,
    /// Recent states, kept where some sensor has a time offset.
    pub(super) history: Option<History>,
    /// Score tests for errors that nothing models; `None` where they do not hold, or hold no longer.
    pub(super) signatures: Option<Signatures>,
    /// Time of the last driving sample.
    pub(super) input: Option<Time>,
    pub(super) cadence: Cadence,
    /// Screening of the driving sensor.
    pub(super) screen: Option<Screen>,
    /// Monitor of the driven process.
    pub(super) monitor: Option<Box<dyn Monitor>>,
    /// Measurements ahead of the driving sensor, in order of time.
    pub(super) pending: VecDeque<Sample>,
    /// Truth of the blocks that no reference gives.
    pub(super) constants: TrueState,
    pub(super) truth: State,
    pub(super) known: Vec<bool>,
    /// Slot of a block without an initial value, which the latest reference did not give either.
    pub(super) lacking: Option<usize>,
}

/// A complete filter at one time, to return to.
#[derive(Clone)]
pub struct Snapshot(pub(super) Memory);

impl Snapshot {
    /// Estimate at the time of the snapshot.
    pub(crate) fn state(&self) -> &State {
        &self.0.state
    }

    /// Estimate relative to the state in a further pass of the smoother; empty otherwise.
    pub(crate) fn offset(&self) -> &[f64] {
        self.0.offset.as_ref().map_or(&[], |offset| &offset.d)
    }
}

impl Ekf {
    /// Creates a filter for the composition, which waits for its start.
    pub fn new(composition: Composition) -> Self {
        let layout = Arc::clone(&composition.layout);
        let n = layout.tangent;
        let mut considered = vec![false; n];
        for block in layout.blocks.iter().filter(|b| b.spec.mode == Mode::Consider) {
            considered[block.tangent_range()].fill(true);
        }
        let start = composition.start();
        let from_reference = composition.estimator.from_reference();
        let constants = TrueState::of(&composition);
        let mut transition = composition.transition.clone();
        let detectors = composition.sensors.iter().enumerate();
        let detectors = detectors.filter_map(|(k, s)| Some((k, s.detector.clone()?))).collect();
        let dynamics = BlockDynamics::new(&layout, &mut transition);
        Self {
            driver: composition.processes.iter().find_map(|p| p.input),
            considered,
            lower: Vec::with_capacity(MAX_CHANNELS * MAX_CHANNELS),
            update: Update::with_capacity(n, MAX_CHANNELS),
            points: SigmaPoints::default(),
            refinement: Refinement::default(),
            corrected: Corrected::of(&composition),
            passage: None,
            changes: Changes::default(),
            guide: None,
            memory: Memory {
                stage: if from_reference { Stage::FromReference(start) } else { Stage::At(start) },
                draws: (composition.estimator.draw != Draw::Nothing)
                    .then(|| Random::new(composition.seed, "initial")),
                state: layout.initial_state(),
                covariance: Covariance::zero(n),
                offset: None,
                held: Held::of(&composition),
                clones: Clones::of(&composition),
                presence: Presence::new(layout.labels),
                history: History::new(&composition),
                pool: PooledSteps::new(&composition, &transition),
                signatures: Signatures::new(&composition, &transition),
                transition,
                dynamics,
                processes: composition.processes.iter().map(|p| p.model.boxed_clone()).collect(),
                alignments: composition.processes.iter().map(|p| p.alignment.clone()).collect(),
                sensors: composition.sensors.iter().map(|s| SensorSlot::new(s, n)).collect(),
                detectors,
                input: None,
                cadence: Cadence::default(),
                screen: screen(&composition),
                monitor: composition.processes.iter().find_map(|p| p.monitor.clone()),
                pending: VecDeque::with_capacity(MAX_PENDING),
                truth: constants.state.clone(),
                known: constants.known.clone(),
                constants,
                lacking: None,
            },
            layout,
            composition,
        }
    }

    /// The estimate.
    pub fn state(&self) -> &State {
        &self.memory.state
    }

    /// Covariance of the estimate.
    pub fn covariance(&self) -> &Covariance {
        &self.memory.covariance
    }

    /// Layout of state and covariance.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Marks the considered error states.
    pub(crate) fn considered(&self) -> &[bool] {
        &self.considered
    }

    /// Composition that the filter runs.
    pub fn composition(&self) -> &Composition {
        &self.composition
    }

    /// Returns `true` once the filter has started.
    pub fn running(&self) -> bool {
        matches!(self.memory.stage, Stage::Running)
    }

    /// Block without an initial value for which the filter waits, although there were references.
    pub(crate) fn lacking(&self) -> Option<&Block> {
        self.memory.lacking.map(|slot| &self.layout.blocks[slot])
    }

    pub(crate) fn searching(&self) -> bool {
        matches!(self.memory.stage, Stage::Searching(_))
    }

    pub(super) fn has_reference(&self) -> bool {
        self.composition.sensors.iter().any(|s| matches!(s.role, Role::Reference(_)))
    }

    /// Copies the complete filter.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot(self.memory.clone())
    }

    /// Returns to a snapshot of a filter of the same composition.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.memory.clone_from(&snapshot.0);
    }

    /// Approximate size of a snapshot, bytes.
    pub(crate) fn snapshot_size(&self) -> usize {
        let m = &self.memory;
        let history = m.history.as_ref().map_or(0, History::size);
        let waiting = m.pending.len() * size_of::<Sample>();
        size_of::<Memory>() + m.covariance.size() + m.transition.size() + history + waiting
    }

    /// Last truth that a reference gave or the scenario states.
    pub fn truth(&self) -> Truth<'_> {
        Truth { state: &self.memory.truth, known: &self.memory.known }
    }

    /// Estimate at the current time, with the truth where the scenario states it and no reference
    /// gives it.
    pub fn epoch(&mut self) -> Epoch<'_> {
        let referenced = self.has_reference();
        let m = &mut self.memory;
        let stated = !referenced && m.constants.known.contains(&true);
        if stated {
            m.constants.advance(&self.layout, m.state.time);
            m.truth.values.copy_from_slice(&m.constants.state.values);
            m.truth.time = m.state.time;
        }
        let truth = stated.then_some(Truth { state: &m.truth, known: &m.known });
        Epoch { layout: &self.layout, state: &m.state, covariance: &m.covariance, truth }
    }

    pub(super) fn refuse(&self, sample: &Sample, is_input: bool) -> Option<Rejection> {
        let slot = &self.memory.sensors[sample.sensor.0];
        if let Some(channel) = sample.not_finite() {
            return Some(Rejection::NotFinite(channel));
        }
        if slot.is_out_of_order(sample) {
            return Some(Rejection::OutOfOrder);
        }
        let present = sample.present() & slot.channels;
        let missing = if is_input { present != slot.channels } else { present == 0 };
        if missing {
            return Some(Rejection::Missing);
        }
        let excluded = self.composition.sensors[sample.sensor.0].excludes(sample.time);
        if excluded {
            return Some(Rejection::Excluded);
        }
        slot.implausible(sample)
    }
}

pub(super) fn rejected(sample: &Sample, rejection: Rejection) -> UpdateRecord<'static> {
    UpdateRecord {
        time: sample.time,
        sensor: sample.sensor,
        outcome: Outcome::Rejected(rejection),
        nis: f64::NAN,
        threshold: f64::NAN,
        present: sample.present(),
        innovation: &[],
        covariance: &[],
    }
}

/// Screening of the driving sensor; none for a simulated sensor without noise, whose channels
/// repeat themselves without a fault.
fn screen(composition: &Composition) -> Option<Screen> {
    let process = composition.processes.iter().find(|p| p.input.is_some())?;
    let driver = process.input.map(|index| &composition.sensors[index])?;
    if composition.simulated && driver.is_noise_free() {
        return None;
    }
    process.screening.as_ref().map(Screen::new)
}
