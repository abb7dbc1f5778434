//! Attitude and velocity whose errors are carried along with the position.
//!
//! North and east turn with the position: a displacement by `dp` turns them by the angle `g` about the
//! vertical, `g = dp_E tan(L) / R` to first order, which has no bound at a pole. A heading error that is
//! measured from the north at the estimate is therefore no small number where the position is uncertain
//! near a pole. The errors of such blocks refer to axes that are carried from the estimate to the truth
//! along the great circle between them, without a rotation about the vertical:
//! ```text
//! p = p^ [+] dp,   C = R_D(g) exp([phi x]) C^,   v = R_D(g) (v^ + dv),   g = turn(p^, p)
//! ```
//! The values stay in north, east, down; only the error, and with it the covariance, is another one.
//! At each estimate the components of the errors are along its own north, east and down, so that a
//! correction turns the covariance by `g`.

use crate::Real;
use crate::state::covariance::Covariance;
use crate::state::geodesy::Geodetic;
use crate::state::layout::Carried;
use crate::state::manifold::{MAX_TANGENT, Manifold, Position};
use crate::state::{Layout, State};

/// Value of a block that is carried along: an attitude has the most numbers, four.
pub(crate) type Back = [f64; 4];

impl Carried {
    fn place(&self, layout: &Layout, values: &[f64]) -> Geodetic {
        Position::load(&values[layout.blocks[self.position].range()])
    }

    /// Angle by which a displacement of the position turns what is carried along.
    pub fn turn<T: Real>(&self, layout: &Layout, values: &[f64], delta: &[T]) -> T {
        let from = Position::load::<T>(&values[layout.blocks[self.position].range()]);
        from.turn_to(&Position::retract(&from, &delta[..3]))
    }

    /// Turns attitude and velocity about the vertical.
    fn apply(&self, layout: &Layout, values: &mut [f64], turn: f64) {
        for slot in [self.attitude, self.velocity] {
            let block = &layout.blocks[slot];
            let values = &mut values[block.range()];
            let mut delta = [0.0; 3];
            self.change(slot, values, turn, &mut delta);
            (block.operations.retract)(values, &delta);
        }
    }

    /// Tangent vector of a block that a turn of `turn` makes, of its coordinates for a velocity.
    pub fn change<T: Real>(&self, slot: usize, coordinates: &[T], turn: T, delta: &mut [T]) {
        delta[..3].fill(T::zero());
        if slot == self.attitude {
            delta[2] = turn;
        } else {
            let ((sin, cos), [north, east]) = (turn.sin_cos(), [coordinates[0], coordinates[1]]);
            delta[0] = cos * north - sin * east - north;
            delta[1] = sin * north + cos * east - east;
        }
    }
}

impl Layout {
    /// The group of blocks in which a block is carried along.
    #[inline]
    pub(crate) fn carrier(&self, slot: usize) -> Option<&Carried> {
        self.carried.iter().find(|c| c.attitude == slot || c.velocity == slot)
    }

    /// Groups that a correction moves as a whole.
    fn carrying(&self) -> impl Iterator<Item = &Carried> {
        let estimated = |slot: usize| self.blocks[slot].estimated();
        let slots = |c: &Carried| [c.position, c.attitude, c.velocity];
        self.carried.iter().filter(move |c| slots(c).into_iter().all(estimated))
    }

    /// Turns attitudes and velocities that are carried along, after the positions have moved.
    pub(crate) fn carry(&self, from: &State, to: &mut State) {
        for c in &self.carried {
            let turn = c.place(self, &from.values).turn_to(&c.place(self, &to.values));
            c.apply(self, &mut to.values, turn);
        }
    }

    /// As [`Self::carry`] for a state whose blocks a correction has moved from the `places` that
    /// [`Self::places`] has given, with the covariance.
    pub(super) fn carry_corrected(
        &self,
        places: &[Geodetic],
        state: &mut State,
        covariance: &mut Covariance,
    ) {
        for (c, from) in self.carrying().zip(places) {
            let turn = from.turn_to(&c.place(self, &state.values));
            c.apply(self, &mut state.values, turn);
            let (sin, cos) = turn.sin_cos();
            let rotation = [cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0];
            for slot in [c.position, c.attitude, c.velocity] {
                covariance.transform(self.blocks[slot].tangent_range(), &rotation);
            }
        }
    }

    /// Positions that carry blocks along in a correction.
    pub(super) fn places(&self, state: &State) -> Vec<Geodetic> {
        self.carrying().map(|c| c.place(self, &state.values)).collect()
    }

    /// True value of a block in the axes of an estimate: brought back to its position if it is carried
    /// along, in `back`.
    pub(crate) fn true_value<'a>(
        &self,
        slot: usize,
        [truth, estimate]: [&'a State; 2],
        known: &[bool],
        back: &'a mut Back,
    ) -> &'a [f64] {
        let block = &self.blocks[slot];
        if self.carrier(slot).is_some() {
            let back = &mut back[..block.operations.ambient];
            if self.carried_back(slot, [truth, estimate], known, back) {
                return back;
            }
        }
        &truth.values[block.range()]
    }

    /// Brings the true value of a block back to the position of an estimate; `false` where it is not
    /// carried along, or the position is not known.
    fn carried_back(
        &self,
        slot: usize,
        [truth, estimate]: [&State; 2],
        known: &[bool],
        value: &mut [f64],
    ) -> bool {
        let Some(c) = self.carrier(slot).filter(|c| known[c.position]) else { return false };
        let block = &self.blocks[slot];
        value.copy_from_slice(&truth.values[block.range()]);
        let turn = c.place(self, &truth.values).turn_to(&c.place(self, &estimate.values));
        let mut delta = [0.0; MAX_TANGENT];
        c.change(slot, value, turn, &mut delta);
        (block.operations.retract)(value, &delta[..3]);
        true
    }
}
