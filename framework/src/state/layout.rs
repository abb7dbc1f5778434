//! Layout of the blocks in one flat vector, and the state in that layout.

use crate::checkpoint::saved;
use crate::state::block::{Block, Mode};
use crate::state::manifold::{Manifold, Position, Rotation, Vector};
use crate::state::transient::Pool;
use crate::units::time::Time;
use std::marker::PhantomData;

/// A typed reference to a state block, resolved once when the scenario is composed.
#[derive(Debug)]
pub struct Handle<M> {
    pub(crate) slot: usize,
    pub(crate) manifold: PhantomData<fn() -> M>,
}

/// A reference to a state block whose manifold the program does not know: see
/// [`crate::compose::Composer::find_any`].
#[derive(Clone, Copy, Debug)]
pub struct AnyHandle {
    pub(crate) slot: usize,
    pub(crate) ambient: usize,
}

impl AnyHandle {
    /// Number of components of the value, which [`crate::state::View::read`] copies.
    pub const fn components(self) -> usize {
        self.ambient
    }
}

impl<M> Clone for Handle<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Handle<M> {}

impl<M> Handle<M> {
    /// The block's index in [`Layout::blocks`].
    pub fn slot(self) -> usize {
        self.slot
    }
}

/// A clone of a block, taken at the samples of a sensor: see `Composer::past`.
#[derive(Debug)]
pub struct Past<M>(pub(crate) Handle<M>);

impl<M> Clone for Past<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Past<M> {}

impl<M> Past<M> {
    /// The block that holds the clone.
    pub fn handle(self) -> Handle<M> {
        self.0
    }
}

/// A known time-varying input of `N` numbers that a process model publishes for measurement models,
/// such as the angular rate of the body. It has no error state.
#[derive(Clone, Copy, Debug)]
pub struct Signal<const N: usize> {
    pub(crate) offset: usize,
}

/// What the blocks of a process mean for the motion of a body. A process declares it with
/// [`crate::compose::Composer::moves`]; viewers, logs and the summary read it from
/// [`Layout::vehicle`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Vehicle {
    /// Geodetic position.
    pub position: Option<Handle<Position>>,
    /// Attitude: body (forward, right, down) to navigation frame (north, east, down).
    pub attitude: Option<Handle<Rotation>>,
    /// Earth-referenced velocity, north, east, down, m/s.
    pub velocity: Option<Handle<Vector<3>>>,
}

/// A body beside the vehicle: its name, and the sensor that has its pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BodyInfo {
    /// Name of the process that declares it.
    pub name: String,
    /// Driving sensor whose first channels are the pose: latitude, longitude (rad), height (m), roll,
    /// pitch and heading (rad).
    pub sensor: String,
}

/// Blocks of a composition and their places.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// Blocks in order.
    pub blocks: Vec<Block>,
    /// Length of [`State::values`].
    pub ambient: usize,
    /// Dimension of the error state.
    pub tangent: usize,
    /// Length of [`State::signals`].
    pub signals: usize,
    /// Of each signal that has an earlier value: its place, that of the earlier value, and their length.
    pub(crate) earlier: Vec<[usize; 3]>,
    /// Source and past of each clone, a pair of slots.
    pub(crate) clones: Vec<[usize; 2]>,
    /// Pools of blocks that come and go.
    pub(crate) pools: Vec<Pool>,
    /// Length of [`State::labels`].
    pub(crate) labels: usize,
    /// Velocities that turn with the heading.
    pub(crate) turning: Vec<Turning>,
    /// Attitudes and velocities that are carried along with a position.
    pub(crate) carried: Vec<Carried>,
    /// The bodies whose motion processes declare, in the order of composition.
    pub vehicles: Vec<Vehicle>,
    /// The bodies beside the vehicle.
    pub bodies: Vec<BodyInfo>,
}

impl Layout {
    /// Finds the block with a full name.
    pub fn find(&self, name: &str) -> Option<&Block> {
        self.blocks.iter().find(|b| b.name == name)
    }

    /// Handle of the block with a full name, if it lives on the manifold.
    pub fn handle<M: Manifold>(&self, name: &str) -> Option<Handle<M>> {
        let kind = std::any::TypeId::of::<M>();
        let slot = self.blocks.iter().position(|b| b.name == name && b.operations.kind == kind)?;
        Some(Handle { slot, manifold: PhantomData })
    }

    /// For each error state, true if its block is only considered.
    pub fn considered(&self) -> Vec<bool> {
        let mut considered = vec![false; self.tangent];
        for block in self.blocks.iter().filter(|b| b.spec.mode == Mode::Consider) {
            considered[block.tangent_range()].fill(true);
        }
        considered
    }

    /// The motion of the vehicle: the first one that a process of the scenario declares. Empty if
    /// no process moves a body.
    pub fn vehicle(&self) -> Vehicle {
        self.vehicles.first().copied().unwrap_or_default()
    }

    /// Block of a handle.
    pub fn block<M>(&self, handle: Handle<M>) -> &Block {
        &self.blocks[handle.slot]
    }

    /// Returns `true` if the block holds a past state, which no truth is compared with.
    pub fn is_past(&self, slot: usize) -> bool {
        self.clones.iter().any(|[_, past]| *past == slot)
    }

    /// Copies the values of the sources to the past blocks; each pair holds both slots.
    pub fn copy_past(&self, pairs: &[[usize; 2]], values: &mut [f64]) {
        for pair in pairs {
            let [source, past] = pair.map(|slot| self.blocks[slot].range());
            values.copy_within(source, past.start);
        }
    }

    /// State with every block at its initial value; those that come and go are absent.
    pub fn initial_state(&self) -> State {
        let (values, signals) = (vec![0.0; self.ambient], vec![0.0; self.signals]);
        let mut state = State { time: Time::MIN, values, signals, labels: vec![None; self.labels] };
        for block in &self.blocks {
            if block.label.is_some() {
                state.values[block.range()].fill(f64::NAN);
                continue;
            }
            (block.operations.from_coordinates)(
                &block.spec.initial,
                &mut state.values[block.range()],
            );
        }
        state
    }

    /// Returns the state with every block that has a `truth` at this truth, and for each block
    /// whether it has one.
    pub fn true_state(&self) -> (State, Vec<bool>) {
        let mut state = self.initial_state();
        let mut known = vec![false; self.blocks.len()];
        for (slot, block) in self.blocks.iter().enumerate() {
            if let Some(truth) = &block.spec.truth {
                (block.operations.from_coordinates)(truth, &mut state.values[block.range()]);
                known[slot] = true;
            }
        }
        (state, known)
    }
}

/// The nominal state: every block's value, and the signals, at one time. Plain data; a snapshot is
/// a clone.
#[derive(Debug, Default, PartialEq)]
pub struct State {
    /// The time of the values.
    pub time: Time,
    /// The blocks' values, laid out by [`Layout`].
    pub values: Vec<f64>,
    /// The signals that process models publish.
    pub signals: Vec<f64>,
    /// Label of each block that comes and goes; `None` where the block is absent.
    pub labels: Vec<Option<u32>>,
}

saved!(State { time, values, signals, labels });

impl Clone for State {
    fn clone(&self) -> Self {
        let mut state = Self::default();
        state.clone_from(self);
        state
    }

    fn clone_from(&mut self, from: &Self) {
        let Self { time, values, signals, labels } = from;
        self.time = *time;
        self.values.clone_from(values);
        self.signals.clone_from(signals);
        self.labels.clone_from(labels);
    }
}

impl State {
    /// The value of a block.
    #[inline]
    pub fn get<M: Manifold>(&self, layout: &Layout, handle: Handle<M>) -> M::Value<f64> {
        M::load(&self.values[layout.blocks[handle.slot].range()])
    }

    /// Sets the value of a block.
    pub fn set<M: Manifold>(&mut self, layout: &Layout, handle: Handle<M>, value: &M::Value<f64>) {
        M::store(value, &mut self.values[layout.blocks[handle.slot].range()]);
    }

    /// Publishes a signal.
    pub fn publish<const N: usize>(&mut self, signal: Signal<N>, value: &[f64; N]) {
        self.signals[signal.offset..signal.offset + N].copy_from_slice(value);
    }
}

/// A velocity block that turns with the heading of an attitude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turning {
    pub velocity: usize,
    pub attitude: usize,
}

/// A position, and the attitude and velocity that are carried along with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carried {
    pub position: usize,
    pub attitude: usize,
    pub velocity: usize,
}
