//! Reasons why an estimator cannot continue.

use crate::model::process::ProcessError;
use crate::units::time::Time;

/// Reason why an estimator cannot continue.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum EstimatorError {
    /// A process model failed.
    #[error("at {time}: {process}: {error}")]
    Process {
        /// Time of the failure.
        time: Time,
        /// Name of the process.
        process: String,
        /// Reason.
        #[source]
        error: ProcessError,
    },
    /// The covariance is not positive any more.
    #[error(
        "at {time}: the variance of {block} is not a positive number: its prior sigma and the noise of \
         the sensors that see it differ by too many orders of magnitude, or a model gives a wrong \
         Jacobian"
    )]
    Covariance {
        /// Time of the failure.
        time: Time,
        /// Block whose variance is not positive.
        block: String,
    },
}
