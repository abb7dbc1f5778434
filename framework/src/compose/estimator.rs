//! The seam between an estimator and what runs it: the runner, campaigns, the bound and the sinks.

use crate::checkpoint::Io;
use crate::compose::Composition;
use crate::compose::course::Course;
use crate::compose::snapshot::Snapshot;
use crate::model::error::ComposeError;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::start::AlignmentReport;
use crate::model::record::{Corrected, Epoch, Event, Observer, Rejection, Truth};
use crate::model::sensor::Role;
use crate::state::covariance::Covariance;
use crate::state::{Block, State};
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::borrow::Cow;
use std::io;

/// An estimator: takes samples in order of time, and gives estimates with their uncertainty.
///
/// An estimator reports everything that happens to its [`Observer`]: updates, comparisons with a
/// reference, events and findings. The framework has two, [`crate::filter::Ekf`] and
/// [`crate::filter::Ukf`]; a plugin registers others with
/// [`crate::plugin::Registry::estimator`].
///
/// One that changes what another gives, and hands the rest over. With [`Linearised`] it can also be
/// smoothed and take late samples:
/// ```
/// use navfuse_core::compose::estimator::{Estimator, EstimatorType};
/// use navfuse_core::filter::{Ekf, EstimatorError};
/// use navfuse_core::model::record::{Epoch, Observer, Truth};
/// use navfuse_core::plugin::Registry;
/// use navfuse_core::prelude::*;
/// use navfuse_core::compose::Composition;
/// use navfuse_core::state::covariance::Covariance;
/// use std::borrow::Cow;
///
/// /// Leaves out every other sample.
/// struct Sparing(Ekf, bool);
///
/// impl EstimatorType for Sparing {
///     const TYPE: &'static str = "sparing"; // [estimator] type = "sparing"
///     fn create(composition: Composition) -> Box<dyn Estimator> {
///         Box::new(Self(Ekf::new(composition), false))
///     }
/// }
///
/// impl Estimator for Sparing {
///     fn composition(&self) -> &Composition {
///         self.0.composition()
///     }
///     fn process(
///         &mut self,
///         sample: &Sample,
///         observer: &mut dyn Observer,
///     ) -> Result<(), EstimatorError> {
///         self.1 = !self.1;
///         if self.1 { self.0.process(sample, observer) } else { Ok(()) }
///     }
///     fn finish(&mut self, observer: &mut dyn Observer) {
///         self.0.finish(observer);
///     }
///     fn running(&self) -> bool {
///         self.0.running()
///     }
///     fn state(&self) -> &State {
///         self.0.state()
///     }
///     fn covariance(&self) -> Cow<'_, Covariance> {
///         self.0.covariance()
///     }
///     fn epoch(&mut self) -> Epoch<'_> {
///         self.0.epoch()
///     }
///     fn truth(&self) -> Truth<'_> {
///         self.0.truth()
///     }
/// }
/// Registry::new().estimator::<Sparing>();
/// ```
pub trait Estimator: Send {
    /// Composition that the estimator runs.
    fn composition(&self) -> &Composition;

    /// Takes a sample.
    ///
    /// # Errors
    /// When the estimator cannot continue. The estimate before the sample stays.
    fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError>;

    /// Reports what is left after the last sample, such as samples that nobody used.
    fn finish(&mut self, observer: &mut dyn Observer);

    /// Returns `true` once there is an estimate.
    fn running(&self) -> bool;

    /// Estimate; before the start, the initial values as far as they are known.
    fn state(&self) -> &State;

    /// Covariance of the estimate.
    fn covariance(&self) -> Cow<'_, Covariance>;

    /// Time of the estimate.
    fn time(&self) -> Time {
        self.state().time
    }

    /// Brings a covariance that is computed less often than the estimate to the estimate's time,
    /// and shows the observer how, for an epoch that is recorded.
    fn settle(&mut self, _observer: &mut dyn Observer) {}

    /// Estimate at that time, with the truth where the scenario states it and no reference gives
    /// it.
    fn epoch(&mut self) -> Epoch<'_>;

    /// Last truth that a reference gave or the scenario states.
    fn truth(&self) -> Truth<'_>;

    /// Events about processes that have not found their initial values at the end.
    fn unfinished(&self) -> Vec<Event> {
        Vec::new()
    }

    /// Block without an initial value for which the estimator waits, although there were
    /// references.
    fn lacking(&self) -> Option<&Block> {
        None
    }

    /// Reports of the initial alignments, each with the name of its process.
    fn alignments(&self) -> Vec<(String, AlignmentReport)> {
        Vec::new()
    }

    /// Fixed blocks that were found to be wrong, and that the estimator estimates since then.
    fn corrected(&self) -> Vec<Corrected> {
        Vec::new()
    }

    /// The estimator with the functions that smoother and late samples need, if it has them. An
    /// estimator that gives itself states [`EstimatorType::LINEARISES`].
    fn linearised(&mut self) -> Option<&mut dyn Linearised> {
        None
    }

    /// The estimator whose copies run ahead of samples that may be late.
    fn settled(&mut self) -> Option<&mut dyn Linearised> {
        self.linearised()
    }

    /// Saves or restores everything that changes while the estimator runs. Default: the snapshot of
    /// an estimator that linearises; any other refuses.
    fn memory(&mut self, io: &mut Io<'_>) {
        let Some(filter) = self.linearised() else {
            return io.refuse("its estimator keeps its memory to itself (Estimator::memory)");
        };
        let mut snapshot = filter.snapshot();
        io.pass(&mut snapshot);
        filter.exchange(&mut snapshot);
    }

    /// Returns `true` once after it has linearised samples again: copies of it are of the past.
    fn has_jumped(&mut self) -> bool {
        false
    }
}

/// An estimator whose steps are linear maps of the error, which its observers receive, and which
/// returns to snapshots. The smoother, late samples and `relinearise` work with it.
///
/// Every function hands over to `base`, the filter that the estimator is built on; an estimator
/// defines the functions in which it differs. The example leaves out every other sample, and keeps
/// that one byte in its snapshots:
/// ```
/// # use navfuse_core::compose::estimator::Estimator;
/// use navfuse_core::compose::estimator::Linearised;
/// use navfuse_core::compose::snapshot::Snapshot;
/// # use navfuse_core::compose::Composition;
/// # use navfuse_core::filter::{Ekf, EstimatorError};
/// # use navfuse_core::model::record::{Epoch, Observer, Truth};
/// # use navfuse_core::prelude::*;
/// # use navfuse_core::state::covariance::Covariance;
/// # use std::borrow::Cow;
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
/// #   fn covariance(&self) -> Cow<'_, Covariance> {
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

    /// Number of the sensor and time of each sample that was used first and found to be wrong.
    fn wrong(&mut self) -> &mut Vec<(usize, Time)> {
        self.base_mut().wrong()
    }

    /// Reports from now on no case that is in doubt for a while, unless one is in doubt now, at the end of the run:
    /// a smoother knows the decisions.
    fn foresee(&mut self) {
        self.base_mut().foresee();
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

    /// Covariance of the last propagation, which may be behind the estimate: it costs nothing to look at.
    fn propagated(&self) -> &Covariance {
        self.base().propagated()
    }

    /// Marks the considered error states.
    fn considered(&self) -> &[bool] {
        self.base().considered()
    }

    /// Lets every sample pass its gate, until the estimator returns to a snapshot.
    fn open_gates(&mut self) {
        self.base_mut().open_gates();
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

/// A type of estimator: `[estimator] type = "..."`. The example of [`Estimator`] has one.
///
/// ```
/// # use navfuse_core::compose::estimator::{Estimator, EstimatorType};
/// # use navfuse_core::filter::Ekf;
/// # use navfuse_core::prelude::*;
/// # use navfuse_core::compose::Composition;
/// /// A filter for vehicles, not for sensors on a bench.
/// struct Careful;
/// impl EstimatorType for Careful {
///     const TYPE: &'static str = "careful";
///     fn check(composition: &Composition) -> Result<(), ComposeError> {
///         let processes = composition.processes.len();
///         let message = "this estimator needs a process; add a table [process]";
///         if processes > 0 { Ok(()) } else { Err(ComposeError::new("type", message)) }
///     }
///     fn create(composition: Composition) -> Box<dyn Estimator> {
///         Box::new(Ekf::new(composition))
///     }
/// }
/// ```
pub trait EstimatorType: 'static {
    /// The name in TOML.
    const TYPE: &'static str;

    /// Set if [`Estimator::linearised`] gives the estimator, so that its samples may be late.
    const LINEARISES: bool = false;

    /// Set if its runs can be smoothed, and its samples linearised again.
    const SMOOTHS: bool = Self::LINEARISES;

    /// Rejects a scenario that the estimator cannot run; keys of the error are those of the table
    /// `[estimator]`. Default: rejects none.
    ///
    /// # Errors
    /// When the estimator cannot run the composition.
    fn check(_composition: &Composition) -> Result<(), ComposeError> {
        Ok(())
    }

    /// Creates an estimator, which waits for its start.
    fn create(composition: Composition) -> Box<dyn Estimator>;
}

/// A registered type of estimator.
#[derive(Clone, Copy)]
pub(crate) struct Creator {
    pub(crate) name: &'static str,
    pub(crate) linearises: bool,
    pub(crate) smooths: bool,
    pub(crate) check: fn(&Composition) -> Result<(), ComposeError>,
    pub(crate) create: fn(Composition) -> Box<dyn Estimator>,
}

impl Creator {
    /// Creator of a type.
    pub(crate) fn of<E: EstimatorType>() -> Self {
        Self {
            name: E::TYPE,
            linearises: E::LINEARISES,
            smooths: E::SMOOTHS,
            check: E::check,
            create: E::create,
        }
    }
}

impl std::fmt::Debug for Creator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "estimator {}", self.name)
    }
}
