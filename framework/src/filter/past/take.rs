//! Past states: clones of blocks, taken at the samples of a sensor (stochastic cloning, Roumeliotis
//! & Burdick, ICRA 2002).
//!
//! A clone is a linear map of the error state, `dx_past := dx`. The filter therefore applies it as
//! a transition without noise, which observers receive like any other:
//! ```text
//! P := C P C',   C = identity, except that the rows of the past block select those of its source
//! ```
//! The past then keeps its value, and its correlation with every other block.

use crate::filter::ekf::Ekf;
use crate::filter::parts::{Parts, followed};
use crate::model::record::Observer;
use crate::model::sensor::Role;
use crate::units::sample::Sample;

impl Ekf {
    /// Returns `true` if the sensor's clones have been taken, or its model reads no past.
    pub(in crate::filter) fn has_past(&self, sensor: usize) -> bool {
        self.parts.clones.iter().all(|c| c.sensor != sensor || c.taken)
    }

    /// Takes the clones of a sensor at the state's time; those of a sensor with several samples of
    /// one time once the filter leaves this time.
    pub(in crate::filter) fn take_past(&mut self, sensor: usize, observer: &mut dyn Observer) {
        let Some(at) = self.parts.clones.iter().position(|c| c.sensor == sensor) else { return };
        if self.parts.clones[at].several {
            self.parts.clones[at].due = true;
        } else {
            self.take_clones(at, observer);
        }
    }

    /// Takes the clones that are due at the state's time, before the filter leaves it.
    pub(in crate::filter) fn take_due(&mut self, observer: &mut dyn Observer) {
        for at in 0..self.parts.clones.len() {
            let clones = &mut self.parts.clones[at];
            let lost = std::mem::take(&mut clones.lost);
            if std::mem::take(&mut clones.due) {
                self.take_clones(at, observer);
            } else if lost {
                clones.taken = false;
            }
        }
    }

    fn take_clones(&mut self, at: usize, observer: &mut dyn Observer) {
        let Parts { estimate, clones, sensors, branch, firsts, .. } = &mut self.parts;
        let clones = &mut clones[at];
        clones.take(&self.layout, estimate);
        clones.taken = true;
        observer.transition(&clones.transition);
        if let Some((guide, offset)) = self.guide.as_mut().zip(estimate.offset.as_mut()) {
            guide.carry(offset, &clones.transition);
            observer.corrected(&offset.d);
        }
        clones.transition.carry_reaches(followed(sensors, branch, firsts));
    }

    /// Gives every past block the value of its source when the filter begins; no sensor has taken it
    /// yet.
    pub(in crate::filter) fn begin_past(&mut self) {
        let Parts { estimate, clones, .. } = &mut self.parts;
        for clones in clones {
            clones.take(&self.layout, estimate);
            (clones.taken, clones.due, clones.lost) = (false, false, false);
        }
    }

    /// Forgets the past of a sensor if the filter cannot use the sample at which the next past
    /// begins.
    pub(in crate::filter) fn lose_past(&mut self, sample: &Sample) {
        let sensor = sample.sensor.0;
        let role = &self.composition.sensors[sensor].role;
        if matches!(role, Role::Measurement(model) if !model.keyframe(sample)) {
            return;
        }
        for clones in self.parts.clones.iter_mut().filter(|c| c.sensor == sensor) {
            if clones.several {
                clones.lost = true;
            } else {
                clones.taken = false;
            }
        }
    }
}
