//! Past states: clones of blocks, taken at the samples of a sensor (stochastic cloning, Roumeliotis
//! & Burdick, ICRA 2002).
//!
//! A clone is a linear map of the error state, `dx_past := dx`. The filter therefore applies it as
//! a transition without noise, which observers receive like any other:
//! ```text
//! P := C P C',   C = identity, except that the rows of the past block select those of its source
//! ```
//! The past then keeps its value, and its correlation with every other block.

use super::filter::Ekf;
use crate::compose::Composition;
use crate::model::record::Observer;
use crate::state::Layout;
use crate::state::covariance::{Covariance, Transition};
use nalgebra::SMatrix;

/// Clones that one sensor takes.
#[derive(Clone)]
pub(super) struct Clones {
    sensor: usize,
    /// Source and past, a pair of slots each.
    pairs: Vec<[usize; 2]>,
    transition: Transition,
    /// Set once a sample of the sensor was there to take the clones at.
    taken: bool,
}

impl Clones {
    /// Copies values and covariance of the sources to the past blocks.
    fn take(&mut self, layout: &Layout, values: &mut [f64], covariance: &mut Covariance) {
        layout.copy_past(&self.pairs, values);
        self.transition.propagate(covariance);
    }

    /// Clones of all sensors of a composition.
    pub(super) fn of(composition: &Composition) -> Vec<Self> {
        let layout = &*composition.layout;
        let sensors = composition.sensors.iter().enumerate();
        sensors
            .filter(|(_, s)| !s.clones.is_empty())
            .map(|(sensor, s)| Self {
                sensor,
                transition: selection(layout, &s.clones),
                pairs: s.clones.clone(),
                taken: false,
            })
            .collect()
    }
}

/// Transition that sets the errors of the past blocks to those of their sources.
fn selection(layout: &Layout, pairs: &[[usize; 2]]) -> Transition {
    let mut transition = Transition::default();
    for pair in pairs {
        let [source, past] = pair.map(|slot| layout.blocks[slot].tangent_range());
        for (row, column) in past.zip(source) {
            let place = transition.phi::<1, 1>(Some(row), Some(column));
            transition.set(place, &SMatrix::from([[1.0]]));
        }
    }
    transition.compile(layout);
    transition
}

impl Ekf {
    /// Returns `true` if the past that the sensor's model reads is there, or it reads none.
    pub(super) fn has_past(&self, sensor: usize) -> bool {
        self.memory.clones.iter().all(|c| c.sensor != sensor || c.taken)
    }

    /// Takes the clones of a sensor at the state's time.
    pub(super) fn take_past(&mut self, sensor: usize, observer: &mut dyn Observer) {
        let m = &mut self.memory;
        let Some(clones) = m.clones.iter_mut().find(|c| c.sensor == sensor) else { return };
        clones.take(&self.layout, &mut m.state.values, &mut m.covariance);
        clones.taken = true;
        observer.transition(&clones.transition);
        for slot in m.sensors.iter_mut().filter(|slot| !slot.reach.is_empty()) {
            clones.transition.carry_reach(&mut slot.reach);
        }
    }

    /// Gives every past block the value of its source when the filter begins; it is no frame of a
    /// sensor yet.
    pub(super) fn begin_past(&mut self) {
        let m = &mut self.memory;
        for clones in &mut m.clones {
            clones.take(&self.layout, &mut m.state.values, &mut m.covariance);
            clones.taken = false;
        }
    }

    /// Forgets the past of a sensor, since the filter cannot use the sample at which the next one
    /// begins.
    pub(super) fn lose_past(&mut self, sensor: usize) {
        let clones = self.memory.clones.iter_mut();
        clones.filter(|c| c.sensor == sensor).for_each(|c| c.taken = false);
    }
}
