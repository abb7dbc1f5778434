//! The unscented Kalman filter.

use super::ekf::Ekf;
use super::update::ukf::Unscented;
use crate::compose::Composition;
use crate::compose::covariance_rate::CovarianceRate;
use crate::compose::estimator::Linearised;
use crate::compose::estimator::{Estimator, EstimatorType};
use crate::model::error::ComposeError;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::start::AlignmentReport;
use crate::model::record::{Corrected, Epoch, Event, Observer, Truth};
use crate::model::sensor::rule::UpdateRule;
use crate::state::covariance::Covariance;
use crate::state::{Block, State};
use crate::units::sample::Sample;
use std::borrow::Cow;

/// An unscented Kalman filter: sigma points of the uncertainty pass through the processes, and
/// every sensor has the update rule `ukf`. Gates, recovery, screening, alignments, past states and
/// late samples are those of [`Ekf`]. A time offset and the smoother need the transition of a
/// linearised step, which it does not have.
pub struct Ukf(Ekf);

impl Ukf {
    /// Creates a filter for the composition, which waits for its start.
    pub fn new(mut composition: Composition) -> Self {
        let rule = UpdateRule::of::<Unscented>();
        composition.sensors.iter_mut().for_each(|sensor| sensor.update = rule);
        Self(Ekf::with_sigma_points(composition))
    }

    /// The filter that keeps samples, state and covariance.
    pub(crate) fn filter(&self) -> &Ekf {
        &self.0
    }

    /// The filter, to be changed.
    pub(crate) fn filter_mut(&mut self) -> &mut Ekf {
        &mut self.0
    }
}

/// Implements [`Estimator`] by the functions of the filter.
macro_rules! estimator {
    ($estimator:ty, |$e:ident| $filter:expr, |$m:ident| $mutable:expr) => {
        impl Estimator for $estimator {
            fn composition(&self) -> &Composition {
                let $e = self;
                $filter.composition()
            }
            fn process(
                &mut self,
                sample: &Sample,
                observer: &mut dyn Observer,
            ) -> Result<(), EstimatorError> {
                let $m = self;
                $mutable.process(sample, observer)
            }
            fn finish(&mut self, observer: &mut dyn Observer) {
                let $m = self;
                $mutable.finish(observer);
            }
            fn running(&self) -> bool {
                let $e = self;
                $filter.running()
            }
            fn state(&self) -> &State {
                let $e = self;
                $filter.state()
            }
            fn covariance(&self) -> Cow<'_, Covariance> {
                let $e = self;
                $filter.covariance()
            }
            fn settle(&mut self, observer: &mut dyn Observer) {
                let $m = self;
                $mutable.settle(observer);
            }
            fn epoch(&mut self) -> Epoch<'_> {
                let $m = self;
                $mutable.epoch()
            }
            fn truth(&self) -> Truth<'_> {
                let $e = self;
                $filter.truth()
            }
            fn unfinished(&self) -> Vec<Event> {
                let $e = self;
                $filter.unfinished().collect()
            }
            fn lacking(&self) -> Option<&Block> {
                let $e = self;
                $filter.lacking()
            }
            fn linearised(&mut self) -> Option<&mut dyn Linearised> {
                Some(self)
            }
            fn corrected(&self) -> Vec<Corrected> {
                let $e = self;
                $filter.corrected()
            }
            fn alignments(&self) -> Vec<(String, AlignmentReport)> {
                let $e = self;
                $filter.alignments().map(|(name, report)| (name.to_owned(), report)).collect()
            }
        }
    };
}

estimator!(Ekf, |e| e, |e| e);
estimator!(Ukf, |e| e.0, |e| e.0);

impl EstimatorType for Ekf {
    const TYPE: &'static str = "ekf";
    const LINEARISES: bool = true;

    fn check(composition: &Composition) -> Result<(), ComposeError> {
        let transient = composition.layout.blocks.iter().find(|block| block.label.is_some());
        match transient.filter(|_| composition.estimator.smooths()) {
            None => Ok(()),
            Some(block) => {
                let message = format!(
                    "the smoother does not support blocks that come and go, such as {}; remove \
                     `smooth` and `lag`, or the sensor that has them",
                    block.name
                );
                Err(ComposeError::new("smooth", message))
            }
        }
    }

    fn create(composition: Composition) -> Box<dyn Estimator> {
        Box::new(Self::new(composition))
    }
}

impl EstimatorType for Ukf {
    const TYPE: &'static str = "ukf";
    const LINEARISES: bool = true;
    const SMOOTHS: bool = false;

    fn check(composition: &Composition) -> Result<(), ComposeError> {
        if composition.estimator.smooths() {
            let message = "the smoother needs a linearised step, which the unscented filter does \
                           not have; remove `smooth`, `lag` and `passes`, or set type = \"ekf\"";
            return Err(ComposeError::new("smooth", message));
        }
        if matches!(composition.estimator.covariance_rate(), CovarianceRate::Least(_)) {
            let message = "the unscented filter propagates the covariance with every sample; \
                           remove `covariance_rate`, or set type = \"ekf\"";
            return Err(ComposeError::new("covariance_rate", message));
        }
        match composition.sensors.iter().find(|sensor| sensor.time_offset.is_some()) {
            None => Ok(()),
            Some(sensor) => Err(ComposeError::new(
                "type",
                format!(
                    "the unscented filter has no time offsets; remove `time_offset` of \
                     [sensor.{}], or set type = \"ekf\"",
                    sensor.info.name
                ),
            )),
        }
    }

    fn create(composition: Composition) -> Box<dyn Estimator> {
        Box::new(Self::new(composition))
    }
}
