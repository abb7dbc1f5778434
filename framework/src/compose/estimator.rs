//! The seam between an estimator and what runs it: the runner, campaigns, the bound and the sinks.

use crate::compose::Composition;
use crate::compose::linearised::Linearised;
use crate::model::error::ComposeError;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::start::AlignmentReport;
use crate::model::record::{Epoch, Event, Observer, Truth};
use crate::state::covariance::Covariance;
use crate::state::{Block, State};
use crate::units::sample::Sample;
use crate::units::time::Time;

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
///     fn covariance(&self) -> &Covariance {
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
    fn covariance(&self) -> &Covariance;

    /// Time of the estimate.
    fn time(&self) -> Time {
        self.state().time
    }

    /// Brings a covariance that is computed less often than the estimate to the estimate's time,
    /// for an epoch that is recorded.
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

    /// The estimator with the functions that smoother and late samples need, if it has them. An
    /// estimator that gives itself states [`EstimatorType::LINEARISES`].
    fn linearised(&mut self) -> Option<&mut dyn Linearised> {
        None
    }

    /// The estimator whose copies run ahead of samples that may be late.
    fn settled(&mut self) -> Option<&mut dyn Linearised> {
        self.linearised()
    }

    /// Returns `true` once after it has linearised samples again: copies of it are of the past.
    fn has_jumped(&mut self) -> bool {
        false
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
