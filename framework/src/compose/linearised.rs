//! The seam of estimators that linearise: what the smoother, late samples and `relinearise` need.

use crate::compose::course::Course;
use crate::compose::estimator::Estimator;
use crate::model::estimator_error::EstimatorError;
use crate::model::record::{Observer, Rejection};
use crate::model::sensor::Role;
use crate::state::State;
use crate::units::sample::Sample;
use std::any::Any;
use std::io;

/// An estimator whose steps are linear maps of the error, which its observers receive, and which
/// returns to snapshots. The smoother, late samples and `relinearise` work with it.
///
/// Every function hands over to `base`, the filter that the estimator is built on; an estimator
/// defines the functions in which it differs. The example leaves out every other sample, and keeps
/// that one byte in its snapshots:
/// ```
/// # use navfuse_core::compose::estimator::Estimator;
/// use navfuse_core::compose::linearised::{Linearised, Snapshot};
/// # use navfuse_core::compose::Composition;
/// # use navfuse_core::filter::{Ekf, EstimatorError};
/// # use navfuse_core::model::record::{Epoch, Observer, Truth};
/// # use navfuse_core::prelude::*;
/// # use navfuse_core::state::covariance::Covariance;
/// struct Sparing(Ekf, bool);
///
/// impl Linearised for Sparing {
///     fn base(&self) -> &dyn Linearised {
///         &self.0
///     }
///     fn base_mut(&mut self) -> &mut dyn Linearised {
///         &mut self.0
///     }
///     fn take(
///         &mut self,
///         sample: &Sample,
///         observer: &mut dyn Observer,
///     ) -> Result<(), EstimatorError> {
///         self.1 = !self.1;
///         if self.1 { self.base_mut().take(sample, observer) } else { Ok(()) }
///     }
///     fn snapshot(&self) -> Snapshot {
///         self.0.snapshot().with(&[u8::from(self.1)])
///     }
///     fn restore(&mut self, snapshot: &Snapshot) {
///         self.0.restore(snapshot);
///         self.1 = snapshot.own() == [1];
///     }
/// }
///
/// impl Estimator for Sparing {
///     fn linearised(&mut self) -> Option<&mut dyn Linearised> {
///         Some(self)
///     }
///     fn process(
///         &mut self,
///         sample: &Sample,
///         observer: &mut dyn Observer,
///     ) -> Result<(), EstimatorError> {
///         self.take_all(sample, observer)
///     }
/// #   fn composition(&self) -> &Composition {
/// #       self.0.composition()
/// #   }
/// #   fn finish(&mut self, observer: &mut dyn Observer) {
/// #       self.0.finish(observer);
/// #   }
/// #   fn running(&self) -> bool {
/// #       self.0.running()
/// #   }
/// #   fn state(&self) -> &State {
/// #       self.0.state()
/// #   }
/// #   fn covariance(&self) -> &Covariance {
/// #       self.0.covariance()
/// #   }
/// #   fn epoch(&mut self) -> Epoch<'_> {
/// #       self.0.epoch()
/// #   }
/// #   fn truth(&self) -> Truth<'_> {
/// #       self.0.truth()
/// #   }
///     // the other functions hand over to the filter
/// }
/// ```
pub trait Linearised: Estimator {
    /// The filter that the estimator is built on.
    fn base(&self) -> &dyn Linearised;

    /// The filter, to be changed.
    fn base_mut(&mut self) -> &mut dyn Linearised;

    /// Takes a sample as [`Estimator::process`] does, except that the samples of a search that ends
    /// are left to the caller: see [`Self::take_found`].
    ///
    /// # Errors
    /// When the estimator cannot continue. The estimate before the sample stays.
    fn take(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        self.base_mut().take(sample, observer)
    }

    /// Samples of a search that has just ended, which the estimator has to take next, one by one.
    fn take_found(&mut self) -> Option<Vec<Sample>> {
        self.base_mut().take_found()
    }

    /// Copies everything that changes while the estimator runs.
    fn snapshot(&self) -> Snapshot {
        self.base().snapshot()
    }

    /// Returns to a snapshot of an estimator of the same type and composition.
    fn restore(&mut self, snapshot: &Snapshot) {
        self.base_mut().restore(snapshot);
    }

    /// Returns to a snapshot, which becomes that of the estimator before.
    fn exchange(&mut self, snapshot: &mut Snapshot) {
        let before = self.snapshot();
        self.restore(snapshot);
        *snapshot = before;
    }

    /// Rejects a sample that the estimator does not receive, such as one that is too late.
    fn reject(&mut self, sample: &Sample, rejection: Rejection, observer: &mut dyn Observer) {
        self.base_mut().reject(sample, rejection, observer);
    }

    /// Returns `true` while an alignment searches for the initial values.
    fn searching(&self) -> bool {
        self.base().searching()
    }

    /// Marks the considered error states.
    fn considered(&self) -> &[bool] {
        self.base().considered()
    }

    /// Linearises at a trajectory from the start on. The caller must do this before the filter
    /// starts. A snapshot does not contain the trajectory.
    fn follow_course(&mut self, course: Box<dyn Course>) {
        self.base_mut().follow_course(course);
    }

    /// Returns to linearisation at the estimate.
    fn leave_course(&mut self) {
        self.base_mut().leave_course();
    }

    /// Leaves the trajectory: the state becomes the estimate, and the estimator linearises at it
    /// from now on. Returns the injected error.
    fn join_course(&mut self) -> Vec<f64> {
        self.base_mut().join_course()
    }

    /// Error of the trajectory, if it could not be read.
    fn course_failed(&mut self) -> Option<io::Error> {
        self.base_mut().course_failed()
    }

    /// Estimate relative to the trajectory; empty without one.
    fn offset(&self) -> &[f64] {
        self.base().offset()
    }

    /// Takes the samples of a search, with an estimate in each period of the output rate. With a
    /// reference, its samples give the estimates.
    ///
    /// # Errors
    /// When the estimator cannot continue.
    fn catch_up(
        &mut self,
        samples: &[Sample],
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let composition = self.composition();
        let referenced = composition.sensors.iter().any(|s| matches!(s.role, Role::Reference(_)));
        let period = composition.estimator.output_period();
        let mut next = self.time().next_multiple(period);
        for sample in samples {
            let now = self.time();
            if !referenced && now >= next && sample.time > now {
                next = now.next_multiple(period);
                self.settle(observer);
                observer.epoch(&self.epoch());
            }
            self.take(sample, observer)?;
        }
        Ok(())
    }

    /// Takes a sample, and those of a search that ends with it.
    ///
    /// # Errors
    /// When the estimator cannot continue.
    fn take_all(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        self.take(sample, observer)?;
        match self.take_found() {
            Some(samples) => self.catch_up(&samples, observer),
            None => Ok(()),
        }
    }
}

/// State of a filter that its snapshot keeps.
pub trait Kept: Any + Send {
    /// Copies it.
    fn boxed_clone(&self) -> Box<dyn Kept>;
    /// Estimate of the filter.
    fn state(&self) -> &State;
    /// Estimate relative to a given trajectory; empty without one.
    fn offset(&self) -> &[f64];
    /// Approximate size, bytes.
    fn size(&self) -> usize;
}

/// A complete estimator at one time, to return to.
pub struct Snapshot {
    kept: Box<dyn Kept>,
    own: Vec<u8>,
}

impl Clone for Snapshot {
    fn clone(&self) -> Self {
        Self { kept: self.kept.boxed_clone(), own: self.own.clone() }
    }
}

impl std::fmt::Debug for Snapshot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "snapshot at {}", self.state().time)
    }
}

impl Snapshot {
    /// Snapshot of a filter.
    pub fn new(kept: impl Kept) -> Self {
        Self { kept: Box::new(kept), own: Vec::new() }
    }

    /// The snapshot with what an estimator on top of the filter keeps, in its own coding.
    #[must_use]
    pub fn with(self, own: &[u8]) -> Self {
        Self { own: own.to_vec(), ..self }
    }

    /// What the estimator on top of the filter keeps.
    pub fn own(&self) -> &[u8] {
        &self.own
    }

    /// State of the filter, if it is a filter of that type.
    pub fn kept<K: Kept>(&self) -> Option<&K> {
        let kept: &dyn Any = self.kept.as_ref();
        kept.downcast_ref()
    }

    /// The same, to be changed.
    pub fn kept_mut<K: Kept>(&mut self) -> Option<&mut K> {
        let kept: &mut dyn Any = self.kept.as_mut();
        kept.downcast_mut()
    }

    /// Estimate at the time of the snapshot.
    pub fn state(&self) -> &State {
        self.kept.state()
    }

    /// Estimate relative to the state in a further pass of the smoother; empty otherwise.
    pub(crate) fn offset(&self) -> &[f64] {
        self.kept.offset()
    }

    /// Approximate size, bytes.
    pub(crate) fn size(&self) -> usize {
        self.kept.size() + self.own.len()
    }
}
