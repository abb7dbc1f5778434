//! Many hypotheses of the position at the start: an estimator for priors within which a range or a
//! map is strongly curved.
//!
//! - [`PointMass`]: the estimator, `[estimator] type = "point-mass"`.
//!
//! An extended Kalman filter linearises a sample at one place. Within a prior of 50 m the bottom of a
//! map has several valleys, and a range has a circle; the filter decides for one place at the first
//! sample, and keeps a small sigma there. This estimator runs in three stages:
//!
//! 1. The filter runs without the curved sensors. A sensor is curved if the second-order term of its
//!    model within the uncertainty of the horizontal position is above its noise.
//! 2. Displacements of the whole track on a grid over the prior are weighted by the samples of the curved
//!    sensors, each as a small Gaussian (point masses: Bucy & Senne, *Automatica* 7, 1971; Gaussian sums:
//!    Alspach & Sorenson, *IEEE Trans. Automatic Control* 17, 1972).
//! 3. Once few places are left, the filter takes all samples again along each of these tracks, as a
//!    Gauss-Newton step does, with the prior of the scenario. The likelihood of all samples in these
//!    runs decides, and the run goes on from the best.
//!
//! The grid thus decides only where the models are linearised: the estimate that is handed over is that
//! of the filter, with all states and their covariance, and each sample counts once.

mod estimator;
mod grid;
mod pass;
mod search;
mod trail;

pub use estimator::PointMass;

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the estimator type `point-mass`.
#[derive(Clone, Copy, Debug)]
pub struct PointMassPlugin;

impl Plugin for PointMassPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.estimator::<PointMass>();
    }

    navfuse_core::named_after_crate!();
}
