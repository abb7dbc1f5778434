//! The typed view of the state that a measurement function reads.

use crate::Real;
use crate::state::block_set::BlockSet;
use crate::state::layout::{AnyHandle, Carried, Handle, Layout, Past, Signal, State};
use crate::state::manifold::{MAX_TANGENT, Manifold};
use crate::state::transient::Transients;
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::cell::RefCell;

/// Input of a measurement function: typed values of scalar type `T`, one block of which may carry a
/// derivative.
///
/// A view that is [`View::recording`] records which blocks are read, and the derivative is taken
/// with respect to exactly those.
#[derive(Debug)]
pub struct View<'a, T: Real> {
    layout: &'a Layout,
    state: &'a State,
    sample: Option<&'a Sample>,
    seeded: usize,
    delta: [T; MAX_TANGENT],
    read: Option<&'a RefCell<BlockSet>>,
    /// Set if the state is the truth, which knows every label with a true value.
    truth: bool,
}

impl<'a> View<'a, f64> {
    /// A view without derivatives.
    pub fn new(layout: &'a Layout, state: &'a State) -> Self {
        Self {
            layout,
            state,
            sample: None,
            seeded: usize::MAX,
            delta: [0.0; MAX_TANGENT],
            read: None,
            truth: false,
        }
    }

    /// Copies the value of a block of any manifold to the first components of `values`: those of a
    /// vector; latitude, longitude and height of a position; the quaternion w, x, y, z of a
    /// rotation. All become NaN if `values` is too short, so that the sample is rejected.
    pub fn read(&self, block: AnyHandle, values: &mut [f64]) {
        if let Some(read) = self.read {
            read.borrow_mut().insert(block.slot);
        }
        let from = &self.layout.blocks[block.slot];
        let Some(value) = values.get_mut(..block.ambient) else { return values.fill(f64::NAN) };
        value.copy_from_slice(&self.state.values[from.range()]);
        if block.slot == self.seeded {
            (from.operations.retract)(value, &self.delta[..from.operations.tangent]);
        } else if let Some((carried, turn)) = self.carried(block.slot) {
            let mut delta = [0.0; 3];
            carried.change(block.slot, value, turn, &mut delta);
            (from.operations.retract)(value, &delta);
        }
    }
}

impl<'a, T: Real> View<'a, T> {
    /// A view in which the block `slot` is displaced by `delta` along its tangent.
    pub fn seeded(
        layout: &'a Layout,
        state: &'a State,
        slot: usize,
        delta: [T; MAX_TANGENT],
    ) -> Self {
        Self { layout, state, sample: None, seeded: slot, delta, read: None, truth: false }
    }

    /// Adds access to the sample's channels.
    #[must_use]
    pub fn with(self, sample: &'a Sample) -> Self {
        Self { sample: Some(sample), ..self }
    }

    /// Adds the blocks that are read to a set.
    #[must_use]
    pub fn recording(self, read: &'a RefCell<BlockSet>) -> Self {
        Self { read: Some(read), ..self }
    }

    /// Makes the state the truth: [`Self::transient`] then finds every label with a true value.
    #[must_use]
    pub(crate) fn of_truth(self) -> Self {
        Self { truth: true, ..self }
    }

    /// Channel of the predicted sample, if it is present: additional data of a sensor, such as the
    /// assumed speed of sound or its own accuracy estimate. In a simulation, the simulator fills it
    /// first.
    pub fn channel(&self, channel: usize) -> Option<f64> {
        self.sample.and_then(|sample| sample.get(channel))
    }

    /// The value of a block.
    pub fn get<M: Manifold>(&self, handle: Handle<M>) -> M::Value<T> {
        if let Some(read) = self.read {
            read.borrow_mut().insert(handle.slot);
        }
        let value = M::load(&self.state.values[self.layout.blocks[handle.slot].range()]);
        if handle.slot == self.seeded {
            return M::retract(&value, &self.delta[..M::TANGENT]);
        }
        let Some((carried, turn)) = self.carried(handle.slot) else { return value };
        let (mut coordinates, mut delta) = ([T::zero(); MAX_TANGENT], [T::zero(); MAX_TANGENT]);
        M::coordinates(&value, &mut coordinates[..M::TANGENT]);
        carried.change(handle.slot, &coordinates, turn, &mut delta);
        M::retract(&value, &delta[..M::TANGENT])
    }

    /// Turn of a block that is carried along with the position, where the position is displaced. A
    /// model that reads such a block reads the position, too.
    #[inline]
    fn carried(&self, slot: usize) -> Option<(&Carried, T)> {
        if self.layout.carried.is_empty() {
            return None;
        }
        let carried = self.layout.carrier(slot)?;
        if let Some(read) = self.read {
            read.borrow_mut().insert(carried.position);
        }
        let displaced = carried.position == self.seeded;
        displaced.then(|| (carried, carried.turn(self.layout, &self.state.values, &self.delta)))
    }

    /// The value of a block at the previous sample of the sensor: see
    /// [`crate::compose::Composer::past`].
    pub fn then<M: Manifold>(&self, past: Past<M>) -> M::Value<T> {
        self.get(past.handle())
    }

    /// The value of the block with a label in a pool of blocks that come and go; `None` while it is
    /// absent. See [`crate::compose::Composer::transients`].
    pub fn transient<M: Manifold>(&self, of: Transients<M>, label: u32) -> Option<M::Value<T>> {
        match self.layout.holder(self.state, of.pool, label) {
            Some(slot) => Some(self.get(Layout::transient::<M>(slot))),
            None if self.truth => self.layout.pools[of.pool].truth(label).map(M::load),
            None => None,
        }
    }

    /// The value of a signal.
    pub fn signal<const N: usize>(&self, signal: Signal<N>) -> [f64; N] {
        std::array::from_fn(|i| self.state.signals[signal.offset + i])
    }

    /// The time of the state.
    pub fn time(&self) -> Time {
        self.state.time
    }
}
