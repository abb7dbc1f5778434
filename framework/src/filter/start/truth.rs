//! The truth that a reference gives, or the scenario states.

use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::compose::truth::TrueState;
use crate::filter::propagate::propagation::Propagation;
use crate::model::record::Truth;
use crate::model::sensor::motion::Motion;
use crate::state::{Layout, State};
use crate::units::time::Time;

/// Last known truth.
#[derive(Clone)]
pub(in crate::filter) struct Known {
    /// Truth of the blocks that no reference gives.
    constants: TrueState,
    state: State,
    known: Vec<bool>,
}

saved!(Known { constants, state } each { known });

impl Known {
    pub(in crate::filter) fn new(composition: &Composition) -> Self {
        let constants = TrueState::of(composition);
        let (state, known) = (constants.state.clone(), constants.known.clone());
        Self { constants, state, known }
    }

    /// The truth as sinks see it.
    pub(in crate::filter) fn view(&self) -> Truth<'_> {
        Truth { state: &self.state, known: &self.known }
    }

    /// The truth at a time, if a reference of this time gave it.
    pub(in crate::filter) fn at(&self, time: Time) -> Option<Truth<'_>> {
        (self.state.time == time).then(|| self.view())
    }

    /// Returns `true` if the truth of a block is known.
    pub(in crate::filter) fn knows(&self, slot: usize) -> bool {
        self.known[slot]
    }

    /// Values of the blocks that a reference has given, but the scenario does not state.
    pub(in crate::filter) fn referenced(&self, slot: usize) -> Option<&State> {
        (self.known[slot] && !self.constants.known[slot]).then_some(&self.state)
    }

    /// Moves what the scenario states to a time; returns `false` if it states nothing.
    pub(in crate::filter) fn state_at(&mut self, layout: &Layout, time: Time) -> bool {
        let stated = self.constants.known.contains(&true);
        if stated {
            self.advance(layout, time);
        }
        stated
    }

    fn advance(&mut self, layout: &Layout, time: Time) {
        self.constants.advance(layout, time);
        self.state.values.copy_from_slice(&self.constants.state.values);
        self.state.time = time;
    }

    /// Takes the motion of a reference.
    pub(in crate::filter) fn follow(
        &mut self,
        layout: &Layout,
        motion: &Motion,
        propagation: &Propagation,
    ) {
        self.advance(layout, motion.time);
        self.known.copy_from_slice(&self.constants.known);
        propagation.follow(layout, motion, &mut self.state, &mut self.known);
        // a part that the reference does not give is NaN
        for (slot, block) in layout.blocks.iter().enumerate() {
            let range = block.range();
            if self.known[slot] && self.state.values[range.clone()].iter().any(|v| !v.is_finite()) {
                self.known[slot] = self.constants.known[slot];
                let constant = &self.constants.state.values[range.clone()];
                self.state.values[range].copy_from_slice(constant);
            }
        }
    }

    /// Takes the truth of a new block, if there is one.
    pub(in crate::filter) fn occupy(
        &mut self,
        layout: &Layout,
        slot: usize,
        truth: Option<&[f64]>,
    ) {
        let range = layout.blocks[slot].range();
        for values in [&mut self.constants.state.values, &mut self.state.values] {
            let to = &mut values[range.clone()];
            match truth {
                Some(truth) => to.copy_from_slice(truth),
                None => to.fill(f64::NAN),
            }
        }
        self.set_known(slot, truth.is_some());
    }

    /// Forgets the truth of a removed block.
    pub(in crate::filter) fn vacate(&mut self, slot: usize) {
        self.set_known(slot, false);
    }

    fn set_known(&mut self, slot: usize, known: bool) {
        self.constants.known[slot] = known;
        self.known[slot] = known;
    }
}
