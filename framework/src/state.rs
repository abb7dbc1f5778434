//! State blocks, their layout in one flat vector, and the typed views that models read them through.

use crate::Real;
use crate::manifold::{MAX_TANGENT, Manifold, Operations};
use crate::sample::Sample;
use crate::time::Time;
use crate::turning::Turning;
use nalgebra::DMatrix;
use std::cell::Cell;
use std::marker::PhantomData;

/// The largest number of blocks of one composition.
pub const MAX_BLOCKS: usize = 128;

/// A typed reference to a state block: resolved once, when the scenario is composed.
#[derive(Debug)]
pub struct Handle<M> {
    pub(crate) slot: usize,
    pub(crate) manifold: PhantomData<fn() -> M>,
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

/// A known time-varying input of `N` numbers that a process model publishes for measurement models, such as the angular
/// rate of the body. It has no error state.
#[derive(Clone, Copy, Debug)]
pub struct Signal<const N: usize> {
    pub(crate) offset: usize,
}

/// What the filter does with a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Estimated: part of the error state, corrected by every update.
    #[default]
    Estimate,
    /// Held at its initial value, which is taken as exact.
    Fixed,
    /// Held at its initial value, whose uncertainty the other states carry (Schmidt's consider filter).
    Consider,
}

/// How a block moves when no process model propagates it.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Dynamics {
    /// It does not move.
    #[default]
    Constant,
    /// It wanders: power spectral density of the rate along each tangent axis, unit^2/s.
    RandomWalk(Vec<f64>),
    /// First-order Gauss-Markov about the initial value: stationary sigma of each tangent axis, correlation time in s.
    GaussMarkov {
        /// Stationary sigma of each tangent axis.
        sigma: Vec<f64>,
        /// Correlation time, s.
        time: f64,
    },
}

/// How the numbers of a block are shown: SI coordinates divided by `scale` are in `unit`.
#[derive(Clone, Debug, PartialEq)]
pub struct Display {
    /// The unit of sigma and error, such as `deg/h`; empty for a ratio.
    pub unit: &'static str,
    /// SI per `unit`.
    pub scale: f64,
    /// One name a component: `roll`, `pitch`, `yaw`.
    pub components: &'static [&'static str],
}

/// A state block before it has a place: value, uncertainty and motion.
#[derive(Clone, Debug)]
pub struct BlockSpec {
    /// What the filter does with it.
    pub mode: Mode,
    /// Initial value, in coordinates (SI).
    pub initial: Vec<f64>,
    /// Prior sigma of each *coordinate*, except for a position, where it is of the tangent (SI).
    pub sigma: Vec<f64>,
    /// The value that a simulation gives it, in coordinates (SI).
    pub truth: Option<Vec<f64>>,
    /// How it moves.
    pub dynamics: Dynamics,
    /// How it is shown.
    pub display: Display,
}

/// A state block in its place.
#[derive(Clone, Debug)]
pub struct Block {
    /// `owner.name`, such as `dvl.scale`.
    pub name: String,
    /// Value, uncertainty and motion.
    pub spec: BlockSpec,
    /// The manifold.
    pub operations: Operations,
    /// Where its value starts in [`State::values`].
    pub offset: usize,
    /// Where its error starts in the error state; `None` when fixed.
    pub tangent: Option<usize>,
    /// Whether its truth moves as the dynamics say.
    pub wanders: bool,
}

impl Block {
    /// The range of its value in [`State::values`].
    pub fn range(&self) -> std::ops::Range<usize> {
        self.offset..self.offset + self.operations.ambient
    }

    /// The range of its error in the error state, empty when fixed.
    pub fn tangent_range(&self) -> std::ops::Range<usize> {
        self.tangent.map_or(0..0, |t| t..t + self.operations.tangent)
    }

    /// Whether updates correct it.
    pub fn estimated(&self) -> bool {
        self.tangent.is_some() && self.spec.mode == Mode::Estimate
    }

    /// The block's coordinates in its display unit; latitude and longitude in degrees.
    pub fn show(&self, values: &[f64], out: &mut [f64]) {
        let n = self.operations.tangent;
        (self.operations.coordinates)(&values[self.range()], &mut out[..n]);
        if self.operations.kind == std::any::TypeId::of::<crate::manifold::Position>() {
            out[0] = out[0].to_degrees();
            out[1] = out[1].to_degrees();
        } else {
            out[..n].iter_mut().for_each(|x| *x /= self.spec.display.scale);
        }
    }

    /// 1-sigma of the block's components in its display unit; zero when fixed.
    pub fn show_sigma(&self, values: &[f64], covariance: &crate::covariance::Covariance, out: &mut [f64]) {
        let n = self.operations.tangent;
        let Some(t) = self.tangent else {
            out[..n].fill(0.0);
            return;
        };
        let jacobian = self.coordinate_jacobian(values).unwrap_or_else(|| {
            let mut identity = [0.0; MAX_TANGENT * MAX_TANGENT];
            (0..n).for_each(|i| identity[n * i + i] = 1.0);
            identity
        });
        for i in 0..n {
            let row = &jacobian[n * i..n * i + n];
            let mut variance = 0.0;
            for (a, &ja) in row.iter().enumerate().filter(|(_, j)| **j != 0.0) {
                for (b, &jb) in row.iter().enumerate().filter(|(_, j)| **j != 0.0) {
                    variance += ja * jb * covariance.get(t + a, t + b);
                }
            }
            out[i] = variance.max(0.0).sqrt() / self.spec.display.scale;
        }
    }

    /// Estimate minus reference in the display unit.
    pub fn show_error(&self, estimate: &[f64], reference: &[f64], out: &mut [f64]) {
        use crate::manifold::Reading;
        let n = self.operations.tangent;
        let (estimate, reference) = (&estimate[self.range()], &reference[self.range()]);
        if self.operations.reading == Reading::Tangent {
            (self.operations.local)(estimate, reference, &mut out[..n]);
        } else {
            let mut r = [0.0; MAX_TANGENT];
            (self.operations.coordinates)(estimate, &mut out[..n]);
            (self.operations.coordinates)(reference, &mut r[..n]);
            for (e, r) in out[..n].iter_mut().zip(&r) {
                *e -= r;
                if self.operations.reading == Reading::Angles {
                    *e -= std::f64::consts::TAU * (*e / std::f64::consts::TAU).round();
                }
            }
        }
        out[..n].iter_mut().for_each(|x| *x /= self.spec.display.scale);
    }

    /// The prior covariance of the block's tangent about the given value.
    pub fn prior(&self, values: &[f64]) -> DMatrix<f64> {
        let n = self.operations.tangent;
        let diagonal = DMatrix::from_fn(n, n, |i, j| if i == j { self.spec.sigma[i].powi(2) } else { 0.0 });
        if self.operations.reading != crate::manifold::Reading::Angles {
            return diagonal;
        }
        let jacobian = self.coordinate_jacobian(values);
        match jacobian.and_then(|j| DMatrix::from_row_slice(n, n, &j[..n * n]).try_inverse()) {
            Some(inverse) => &inverse * diagonal * inverse.transpose(),
            None => diagonal,
        }
    }

    /// Derivative of the coordinates with respect to the tangent, row-major; `None` where sigma is read in the tangent,
    /// and where roll and yaw are one angle, at a pitch of 90 deg: that of the tangent then stands for theirs.
    fn coordinate_jacobian(&self, values: &[f64]) -> Option<[f64; MAX_TANGENT * MAX_TANGENT]> {
        use crate::manifold::Reading;
        // at 1e6 the pitch is within 0.2 arc seconds of 90 deg
        let largest = match self.operations.reading {
            Reading::Tangent => return None,
            Reading::Angles => 1e6,
            Reading::Coordinates => f64::MAX,
        };
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        (self.operations.coordinate_jacobian)(&values[self.range()], &mut jacobian);
        jacobian.iter().all(|j| j.abs() <= largest).then_some(jacobian)
    }
}

/// The blocks of a composition and where each stands.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// The blocks in order.
    pub blocks: Vec<Block>,
    /// Length of [`State::values`].
    pub ambient: usize,
    /// Dimension of the error state.
    pub tangent: usize,
    /// Length of [`State::signals`].
    pub signals: usize,
    /// Velocities that turn with the heading.
    pub(crate) turning: Vec<Turning>,
}

impl Layout {
    /// The block of that full name.
    pub fn find(&self, name: &str) -> Option<&Block> {
        self.blocks.iter().find(|b| b.name == name)
    }

    /// The block in the place of a handle.
    pub fn block<M>(&self, handle: Handle<M>) -> &Block {
        &self.blocks[handle.slot]
    }

    /// The state at every block's initial value, and which blocks have a `truth`, at that truth.
    pub fn initial_state(&self) -> State {
        let (values, signals) = (vec![0.0; self.ambient], vec![0.0; self.signals]);
        let mut state = State { time: Time::MIN, values, signals };
        for block in &self.blocks {
            (block.operations.from_coordinates)(&block.spec.initial, &mut state.values[block.range()]);
        }
        state
    }

    /// The state with every block at its `truth` where it has one, and the slots of those blocks.
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

/// The nominal state: every block's value, and the signals, at one time. Plain data: a snapshot is a clone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// The time of the values.
    pub time: Time,
    /// The blocks' values, laid out by [`Layout`].
    pub values: Vec<f64>,
    /// The signals that process models publish.
    pub signals: Vec<f64>,
}

impl State {
    /// The value of a block.
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

/// What a measurement function reads: typed values of scalar type `T`, one block of which may carry a derivative.
///
/// It notes which blocks were read, so that the derivative is taken with respect to exactly those.
#[derive(Debug)]
pub struct View<'a, T: Real> {
    layout: &'a Layout,
    state: &'a State,
    sample: Option<&'a Sample>,
    seeded: usize,
    delta: [T; MAX_TANGENT],
    read: Cell<u128>,
}

impl<'a> View<'a, f64> {
    /// A view without derivatives.
    pub fn new(layout: &'a Layout, state: &'a State) -> Self {
        Self { layout, state, sample: None, seeded: usize::MAX, delta: [0.0; MAX_TANGENT], read: Cell::new(0) }
    }
}

impl<'a, T: Real> View<'a, T> {
    /// A view in which the block `slot` is displaced by `delta` along its tangent.
    pub fn seeded(layout: &'a Layout, state: &'a State, slot: usize, delta: [T; MAX_TANGENT]) -> Self {
        Self { layout, state, sample: None, seeded: slot, delta, read: Cell::new(0) }
    }

    /// The view in which the sample's channels can be read too.
    #[must_use]
    pub fn with(self, sample: &'a Sample) -> Self {
        Self { sample: Some(sample), ..self }
    }

    /// A channel of the sample that is predicted, if it is there: what a sensor tells beside what it measures, such as the
    /// speed of sound that it assumed, or how good it believes to be. In a simulation, the simulator fills it first.
    pub fn channel(&self, channel: usize) -> Option<f64> {
        self.sample.and_then(|sample| sample.get(channel))
    }

    /// The value of a block.
    pub fn get<M: Manifold>(&self, handle: Handle<M>) -> M::Value<T> {
        self.read.set(self.read.get() | 1 << handle.slot);
        let value = M::load(&self.state.values[self.layout.blocks[handle.slot].range()]);
        if handle.slot == self.seeded { M::retract(&value, &self.delta[..M::TANGENT]) } else { value }
    }

    /// The value of a signal.
    pub fn signal<const N: usize>(&self, signal: Signal<N>) -> [f64; N] {
        std::array::from_fn(|i| self.state.signals[signal.offset + i])
    }

    /// The time of the state.
    pub fn time(&self) -> Time {
        self.state.time
    }

    /// The blocks read so far, one bit a slot.
    pub fn blocks_read(&self) -> u128 {
        self.read.get()
    }
}
