//! A further pass of the smoother: the filter follows a given trajectory, see [`super::guide`].

use crate::compose::course::Course;
use crate::filter::course::guide::{Guide, Offset};
use crate::filter::ekf::Ekf;
use crate::filter::estimate::Estimate;
use crate::filter::parts::Parts;
use std::io;

impl Ekf {
    /// Linearises at a trajectory from the start on. The caller must do this before the filter
    /// starts. A snapshot of the filter does not contain the trajectory.
    pub(crate) fn follow_course(&mut self, course: Box<dyn Course>) {
        self.guide = Some(Box::new(Guide::new(&self.layout, course)));
        self.parts.estimate.offset = Some(Offset::zero(&self.layout));
    }

    /// Returns to linearisation at the estimate.
    pub(crate) fn leave_course(&mut self) {
        self.guide = None;
        self.parts.estimate.offset = None;
    }

    /// Leaves the trajectory: the state becomes the estimate, and the filter linearises at it from
    /// now on. Returns the injected error.
    pub(crate) fn join_course(&mut self) -> Vec<f64> {
        self.guide = None;
        let Parts { estimate, history, .. } = &mut self.parts;
        let Some(mut offset) = estimate.offset.take() else { return Vec::new() };
        self.layout.inject(&mut estimate.state, &mut offset.d, &mut estimate.covariance);
        if let Some(history) = history {
            history.corrected(&offset.d);
        }
        offset.d
    }

    /// Error of the trajectory, if it could not be read.
    pub(crate) fn course_failed(&mut self) -> Option<io::Error> {
        self.guide.as_mut().and_then(|guide| guide.failed())
    }

    /// Moves from the prior to the trajectory.
    pub(in crate::filter) fn begin_course(&mut self) {
        let Estimate { state, covariance, offset, .. } = &mut self.parts.estimate;
        if let Some((guide, offset)) = self.guide.as_mut().zip(offset.as_mut()) {
            guide.begin(&self.layout, state, covariance, offset);
        }
    }
}
