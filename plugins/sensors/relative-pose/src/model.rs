//! The measurement model.

use crate::keys::KEYFRAME;
use crate::logarithm::rotation_vector;
use navfuse_core::Real;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::simulate::Scene;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3};
use navfuse_core::state::manifold::{Position, Rotation, Scalar, Vector};
use navfuse_core::state::{Handle, Past, View};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Span;
use navfuse_ins::Navigation;

/// The measurement model of a [`crate::RelativePose`].
#[derive(Clone, Debug)]
pub struct RelativePoseModel {
    pub(crate) navigation: Navigation,
    pub(crate) past: (Past<Rotation>, Past<Position>),
    pub(crate) scale: Handle<Scalar>,
    pub(crate) c_b_s: Handle<Rotation>,
    pub(crate) lever_arm: Handle<Vector<3>>,
    /// 1-sigma, m.
    pub(crate) translation: Vector3<f64>,
    /// 1-sigma, rad.
    pub(crate) rotation: Vector3<f64>,
    /// Time between simulated keyframes.
    pub(crate) keyframes: Option<Span>,
}

impl MeasurementModel<6> for RelativePoseModel {
    /// The equations of the crate, with north, east and down taken as the same axes at both poses.
    /// They turn by the distance over the radius of the Earth, 1.6e-7 rad per metre.
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 6> {
        let (c_b_n, c_b_s, arm) =
            (x.get(self.navigation.attitude), x.get(self.c_b_s), x.get(self.lever_arm));
        let (past_c_b_n, past_position) = (x.then(self.past.0), x.then(self.past.1));
        let moved = x.get(self.navigation.position).ned_from(&past_position) + c_b_n * arm
            - past_c_b_n * arm;
        let to_past = past_c_b_n.inverse();
        let translation = c_b_s * (to_past * moved) * x.get(self.scale);
        let rotation = rotation_vector(&(c_b_s * to_past * c_b_n * c_b_s.inverse()));
        SVector::from_fn(|k, _| if k < 3 { translation[k] } else { rotation[k - 3] })
    }

    /// A sample without the channel `keyframe` is one.
    fn keyframe(&self, sample: &Sample) -> bool {
        sample.get(KEYFRAME) != Some(0.0)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 6, 6> {
        let sigma = |k| if k < 3 { self.translation[k] } else { self.rotation[k - 3] };
        SMatrix::from_diagonal(&SVector::from_fn(|k, _| sigma(k) * sigma(k)))
    }

    /// The first sample after a multiple of the time between keyframes is one.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(self, sample);
        if let Some(every) = self.keyframes {
            let first = scene.to >= scene.from.next_multiple(every);
            sample.set(KEYFRAME, f64::from(u8::from(first)));
        }
    }
}
