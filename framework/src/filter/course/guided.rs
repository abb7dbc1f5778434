//! A further pass of the smoother: the filter follows a given trajectory, see `guide.rs`.

use crate::filter::course::guide::{Course, Guide, Offset};
use crate::filter::ekf::Ekf;
use std::io;

impl Ekf {
    /// Linearises at a trajectory from the start on. The caller must do this before the filter
    /// starts. A snapshot of the filter does not contain the trajectory.
    pub(crate) fn follow_course(&mut self, course: Box<dyn Course>) {
        self.guide = Some(Box::new(Guide::new(&self.layout, course)));
        self.memory.offset = Some(Offset::zero(&self.layout));
    }

    /// Returns to linearisation at the estimate.
    pub(crate) fn leave_course(&mut self) {
        self.guide = None;
        self.memory.offset = None;
    }

    /// Leaves the trajectory: the state becomes the estimate, and the filter linearises at it from
    /// now on. Returns the injected error.
    pub(crate) fn join_course(&mut self) -> Vec<f64> {
        self.guide = None;
        let m = &mut self.memory;
        let Some(mut offset) = m.offset.take() else { return Vec::new() };
        self.layout.inject(&mut m.state, &mut offset.d, &mut m.covariance);
        if let Some(history) = &mut m.history {
            history.corrected(&offset.d);
        }
        offset.d
    }

    /// Returns the estimate relative to the trajectory; empty without one.
    pub(crate) fn offset(&self) -> &[f64] {
        self.memory.offset.as_ref().map_or(&[], |offset| &offset.d)
    }

    /// Error of the trajectory, if it could not be read.
    pub(crate) fn course_failed(&mut self) -> Option<io::Error> {
        self.guide.as_mut().and_then(|guide| guide.failed())
    }

    /// Moves from the prior to the trajectory.
    pub(in crate::filter) fn begin_course(&mut self) {
        let m = &mut self.memory;
        if let Some((guide, offset)) = self.guide.as_mut().zip(m.offset.as_mut()) {
            guide.begin(&self.layout, &mut m.state, &mut m.covariance, offset);
        }
    }
}
