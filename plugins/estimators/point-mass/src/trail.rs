//! The track of the filter without the curved sensors, and a displaced copy of it as the trajectory at
//! which the filter linearises.

use navfuse_core::compose::course::Course;
use navfuse_core::model::record::Observer;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::{Layout, State};
use navfuse_core::units::time::Time;
use std::io;
use std::sync::Arc;

/// The states after each step.
#[derive(Clone, Default)]
pub(crate) struct Trail {
    times: Vec<Time>,
    values: Vec<f64>,
}

impl Trail {
    pub fn clear(&mut self) {
        self.times.clear();
        self.values.clear();
    }

    fn push(&mut self, state: &State) {
        self.times.push(state.time);
        self.values.extend_from_slice(&state.values);
    }

    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }
}

/// A trail whose positions are displaced to the north and to the east.
pub(crate) struct Displaced {
    pub trail: Arc<Trail>,
    pub layout: Arc<Layout>,
    pub places: Arc<[usize]>,
    pub offset: [f64; 2],
}

impl Course for Displaced {
    fn read(&mut self, mut place: u64, time: Time, values: &mut [f64]) -> io::Result<Option<u64>> {
        let times = &self.trail.times;
        while let Some(at) = times.get(place as usize).filter(|at| **at <= time) {
            let row = place as usize * values.len();
            place += 1;
            if *at == time {
                values.copy_from_slice(&self.trail.values[row..row + values.len()]);
                displace(&self.layout, &self.places, values, self.offset);
                return Ok(Some(place));
            }
        }
        Ok(None)
    }
}

/// Displaces the track to the north and to the east, m: the blocks of the position now and at the times
/// of past states.
pub(crate) fn displace(
    layout: &Layout,
    places: &[usize],
    values: &mut [f64],
    [north, east]: [f64; 2],
) {
    for block in places.iter().map(|slot| &layout.blocks[*slot]) {
        (block.operations.retract)(&mut values[block.range()], &[north, east, 0.0]);
    }
}

/// Follows the filter into a trail, and shows everything to the observer of the run.
pub(crate) struct Following<'a> {
    pub trail: &'a mut Trail,
    pub observer: &'a mut dyn Observer,
}

impl Observer for Following<'_> {
    fn behind(&mut self) -> Option<&mut dyn Observer> {
        Some(self.observer)
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.trail.push(state);
        self.observer.moved(state, covariance, offset);
    }
}
