//! One run of the filter over all samples, linearised along a displaced track.

use crate::grid::Fit;
use crate::search::Search;
use crate::trail::Displaced;
use nalgebra::{DMatrix, DVector};
use navfuse_core::compose::estimator::Linearised;
use navfuse_core::model::record::{Observer, Repetition, UpdateRecord};
use navfuse_core::state::State;
use navfuse_core::state::covariance::{Transition, Update};
use std::sync::Arc;

/// Largest number of runs along one track, each displaced to where the one before ended.
const RUNS: usize = 5;

/// Change of the place by a run, in its sigma, at which the runs have converged.
const CONVERGED: f64 = 0.3;

/// Result of the runs along one track.
pub(crate) struct Passed {
    /// Displacement at the end of the track, north and east, m, and its sigma.
    pub offset: [f64; 2],
    pub sigma: [f64; 2],
    /// Logarithm of the likelihood of all samples.
    pub likelihood: f64,
    /// Sum of the normalised innovations squared of the curved sensors, and its expectation.
    pub squared: f64,
    pub expected: usize,
}

/// Collects the likelihood of the samples, and shows the observer of the run what counts for it.
struct Evidence<'a, 'b> {
    curved: &'a [bool],
    likelihood: f64,
    squared: f64,
    expected: usize,
    observer: Option<&'b mut dyn Observer>,
}

impl Observer for Evidence<'_, '_> {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        let m = update.innovation.len();
        if update.nis.is_nan() || m == 0 {
            return;
        }
        let s = DMatrix::from_row_slice(m, m, &update.covariance[..m * m]);
        let innovation = DVector::from_column_slice(update.innovation);
        self.likelihood += Fit::of(&innovation, s).map_or(0.0, |fit| fit.likelihood);
        if self.curved[update.sensor.0] {
            self.squared += update.nis.min(crate::grid::LARGEST);
            self.expected += m;
            // the run has not seen this one
            if let Some(observer) = &mut self.observer {
                observer.update(update);
            }
        }
    }
    fn transition(&mut self, transition: &Transition) {
        if let Some(observer) = &mut self.observer {
            observer.transition(transition);
        }
    }
    fn correction(&mut self, update: &Update) {
        if let Some(observer) = &mut self.observer {
            observer.correction(update);
        }
    }
}

impl Search {
    /// Runs the filter along the track that is displaced by `offset`, until the place stays. The filter
    /// is at the end of the last run then. `None` if a run fails or the place does not settle.
    pub fn pass(&self, ekf: &mut dyn Linearised, here: &State, offset: [f64; 2]) -> Option<Passed> {
        let mut offset = offset;
        for _ in 0..RUNS {
            let (passed, moved) = self.run(ekf, here, offset, None)?;
            offset = passed.offset;
            if moved <= CONVERGED {
                return Some(passed);
            }
        }
        None
    }

    /// Runs the filter once along a track, and shows the observer what replaces the run so far.
    pub fn adopt(
        &self,
        ekf: &mut dyn Linearised,
        here: &State,
        offset: [f64; 2],
        observer: &mut dyn Observer,
    ) -> Option<Passed> {
        self.run(ekf, here, offset, Some(observer)).map(|(passed, _)| passed)
    }

    /// One run; returns its result, and by how much the place has moved, in its sigma.
    fn run(
        &self,
        ekf: &mut dyn Linearised,
        here: &State,
        offset: [f64; 2],
        mut observer: Option<&mut dyn Observer>,
    ) -> Option<(Passed, f64)> {
        ekf.restore(&self.first);
        ekf.follow_course(Box::new(Displaced {
            trail: Arc::clone(&self.trail),
            layout: Arc::clone(&self.layout),
            places: Arc::clone(&self.places),
            offset,
        }));
        if let Some(observer) = &mut observer {
            observer.repetition(Repetition::Begins);
        }
        let (likelihood, squared, expected) = (0.0, 0.0, 0);
        let mut evidence =
            Evidence { curved: &self.curved, likelihood, squared, expected, observer };
        let taken = self.samples.iter().try_for_each(|sample| ekf.take(sample, &mut evidence));
        ekf.settle(&mut evidence);
        let injected = ekf.join_course();
        let Evidence { likelihood, squared, expected, observer, .. } = evidence;
        if let Some(observer) = observer {
            observer.repetition(Repetition::Ends(&injected));
        }
        taken.ok()?;
        let layout = &self.layout;
        let place = ekf.state().get(layout, self.position);
        let moved = place.ned_from(&here.get(layout, self.position));
        let reached = [moved.x, moved.y];
        let first = layout.block(self.position).tangent_range().start;
        let covariance = ekf.covariance();
        let sigma = [0, 1].map(|k| covariance.sigma(first + k));
        let change =
            (0..2).map(|k| ((reached[k] - offset[k]) / sigma[k]).abs()).fold(0.0, f64::max);
        let passed = Passed { offset: reached, sigma, likelihood, squared, expected };
        change.is_finite().then_some((passed, change))
    }
}
