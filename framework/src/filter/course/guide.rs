//! A filter that linearises at a given trajectory instead of at its own estimate: the forward part
//! of a further pass of the smoother.
//!
//! The trajectory `c` is the smoothed one of the pass before. The state of the filter is `c`, its
//! covariance is that of the error about `c`, and the estimate is `c [+] d` with the offset `d`:
//! ```text
//! begin         d = G (m [-] c),  P = G P G'        prior mean m
//! propagation   d = Phi d + (f(c) [-] c'),          Phi and f at c, c' the next state of it
//! update        d = d + K (z - h(c) - H d),         H and h at c
//! ```
//! `d` obeys a linear filter, so smoothing it solves the whole run as linearised at `c`. That is one
//! Gauss-Newton step (Bell, SIAM J. Optim. 4, 1994, 626-636). The steps converge where the smoothed
//! `d` is zero. The reset by `f(c) [-] c'` is left out: it is the process noise of one step, some
//! 1e-6 rad.

use crate::compose::course::Course;
use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::{Layout, State};
use crate::units::time::Time;
use std::io;

/// The estimate relative to the trajectory.
#[derive(Clone)]
pub(in crate::filter) struct Offset {
    pub(in crate::filter) d: Vec<f64>,
    /// Place in the trajectory.
    place: u64,
}

impl Offset {
    pub(in crate::filter) fn zero(layout: &Layout) -> Self {
        Self { d: vec![0.0; layout.tangent], place: 0 }
    }

    /// `d = Phi d`.
    pub(in crate::filter) fn carry(&mut self, transition: &Transition, before: &mut Vec<f64>) {
        before.clone_from(&self.d);
        transition.elements().for_each(|(i, _, _)| self.d[i] = 0.0);
        transition.elements().for_each(|(i, j, value)| self.d[i] += value * before[j]);
    }

    /// Converts the innovation at the trajectory to that at the estimate: `z - h(c) - H d`.
    pub(in crate::filter) fn innovation(&self, update: &mut Update) {
        let rows = update.h.chunks_exact(update.columns.len().max(1));
        for (y, h) in update.innovation.iter_mut().zip(rows) {
            *y -= h.iter().zip(&update.columns).map(|(h, &c)| h * self.d[c]).sum::<f64>();
        }
    }

    /// Takes a correction. The trajectory stays, so nothing is injected.
    pub(in crate::filter) fn correct(&mut self, delta: &mut [f64]) {
        self.d.iter_mut().zip(&*delta).for_each(|(d, delta)| *d += delta);
        delta.fill(0.0);
    }
}

/// The trajectory at which a filter linearises, with its work space.
pub(in crate::filter) struct Guide {
    course: Box<dyn Course>,
    /// State of the trajectory, and the error from it.
    at: State,
    error: Vec<f64>,
    known: Vec<bool>,
    work: Vec<f64>,
    failed: Option<io::Error>,
}

impl Guide {
    pub(in crate::filter) fn new(layout: &Layout, course: Box<dyn Course>) -> Self {
        Self {
            course,
            at: layout.initial_state(),
            error: vec![0.0; layout.tangent],
            known: vec![true; layout.blocks.len()],
            work: Vec::with_capacity(layout.tangent),
            failed: None,
        }
    }

    /// Error of the trajectory, if it could not be read.
    pub(in crate::filter) fn failed(&mut self) -> Option<io::Error> {
        self.failed.take()
    }

    /// Reads the state of the trajectory at a time; `false` if there is none.
    fn find(&mut self, offset: &mut Offset, time: Time) -> bool {
        match self.course.read(offset.place, time, &mut self.at.values) {
            Ok(Some(place)) => {
                offset.place = place;
                true
            }
            Ok(None) => false,
            Err(error) => {
                self.failed.get_or_insert(error);
                false
            }
        }
    }

    /// Moves the offset across a transition, without a change of the trajectory.
    pub(in crate::filter) fn carry(&mut self, offset: &mut Offset, transition: &Transition) {
        offset.carry(transition, &mut self.work);
    }

    /// Moves the offset across a propagation, and the state from its end to the trajectory.
    pub(in crate::filter) fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        offset: &mut Offset,
        transition: &Transition,
    ) {
        self.carry(offset, transition);
        if self.find(offset, state.time) {
            layout.error(&self.at, state, &self.known, &mut self.error);
            offset.d.iter_mut().zip(&self.error).for_each(|(d, defect)| *d -= defect);
            state.values.copy_from_slice(&self.at.values);
        }
    }

    /// Moves the state and its covariance from the prior to the trajectory.
    pub(in crate::filter) fn begin(
        &mut self,
        layout: &Layout,
        state: &mut State,
        covariance: &mut Covariance,
        offset: &mut Offset,
    ) {
        if self.find(offset, state.time) {
            layout.error(&self.at, state, &self.known, &mut self.error);
            offset.d.iter_mut().zip(&self.error).for_each(|(d, error)| *d = -error);
            layout.inject(state, &mut self.error, covariance);
            layout.reset_rows(&self.error, &mut offset.d, 1);
            state.values.copy_from_slice(&self.at.values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trajectory that cannot be read.
    struct Unreadable;

    impl Course for Unreadable {
        fn read(&mut self, _: u64, time: Time, _: &mut [f64]) -> io::Result<Option<u64>> {
            Err(io::Error::other(format!("nothing at {time}")))
        }
    }

    #[test]
    fn the_first_error_of_the_trajectory_is_kept_until_it_is_taken() {
        let layout = Layout::default();
        let mut guide = Guide::new(&layout, Box::new(Unreadable));
        let mut offset = Offset::zero(&layout);
        assert!(guide.failed().is_none());
        for at in [1, 2] {
            assert!(!guide.find(&mut offset, Time::from_nanos(at * 1_000_000_000)));
        }
        let failed = guide.failed().map(|e| e.to_string());
        assert_eq!(failed.as_deref(), Some("nothing at 1.000 s"));
        assert!(guide.failed().is_none());
    }
}
