//! The clones that the sensors take: pairs of source and past, and the transition between them.

use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::estimate::Estimate;
use crate::model::sensor::Role;
use crate::state::Layout;
use crate::state::covariance::Transition;
use nalgebra::SMatrix;

/// Clones that one sensor takes.
#[derive(Clone)]
pub(in crate::filter) struct Clones {
    pub(super) sensor: usize,
    /// Source and past, a pair of slots each.
    pairs: Vec<[usize; 2]>,
    pub(super) transition: Transition,
    /// Set once the sensor has had a sample at which to take the clones.
    pub(super) taken: bool,
    /// Set if several samples may have one time: the clones are taken after the last of them.
    pub(super) several: bool,
    /// Set if the clones are to be taken once the filter leaves the present time.
    pub(super) due: bool,
    /// Set if the filter has rejected a sample unseen at which such clones would be taken.
    pub(super) lost: bool,
}

saved!(Clones { taken, due, lost } except { sensor, pairs, transition, several });

impl Clones {
    /// Copies values and covariance of the sources to the past blocks.
    pub(super) fn take(&mut self, layout: &Layout, estimate: &mut Estimate) {
        layout.copy_past(&self.pairs, &mut estimate.state.values);
        self.transition.propagate(&mut estimate.covariance);
    }

    /// Clones of all sensors of a composition.
    pub(in crate::filter) fn of(composition: &Composition) -> Vec<Self> {
        let layout = &*composition.layout;
        let sensors = composition.sensors.iter().enumerate();
        sensors
            .filter(|(_, s)| !s.clones.is_empty())
            .map(|(sensor, s)| Self {
                sensor,
                transition: selection(layout, &s.clones),
                pairs: s.clones.clone(),
                taken: false,
                several: matches!(&s.role, Role::Measurement(model) if model.observations() > 1),
                due: false,
                lost: false,
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
