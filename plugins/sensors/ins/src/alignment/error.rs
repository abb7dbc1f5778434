//! Reasons for which an alignment fails.

use navfuse_core::model::process::ProcessError;
use navfuse_core::units::time::Time;

/// A failure of the alignment, with its place in time and the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum AlignmentError {
    /// Bias and noise of the gyros hide the horizontal Earth rate.
    #[error(
        "the gyros cannot find north: with this bias and noise the heading would be {heading:.0} deg \
         wrong, 1-sigma, after {duration} s at latitude {latitude:.1} deg; give the heading \
         (alignment = \"given\"), or more time to quiet gyros"
    )]
    GyrosTooCoarse {
        /// Expected error of the heading, deg.
        heading: f64,
        /// Duration of the coarse alignment, s.
        duration: f64,
        /// Geodetic latitude, deg.
        latitude: f64,
    },
    /// The velocity sensor was silent for too long.
    #[error(
        "no velocity for {gap:.1} s from {from} on, inside an alignment in motion of {duration} s: \
         start after it (estimator.start), end before it (alignment.duration), or bridge it \
         (alignment.max_gap)"
    )]
    VelocityGap {
        /// Length of the gap, s.
        gap: f64,
        /// Beginning of the gap.
        from: Time,
        /// Duration of the alignment, s.
        duration: f64,
    },
    /// The velocities do not determine the attitude.
    #[error(
        "{count} velocities in {duration} s do not determine the attitude: a sensor that measures all \
         three components is needed, at least {least} times, away from the poles"
    )]
    TooFewVelocities {
        /// Number of velocities.
        count: usize,
        /// Duration of the alignment, s.
        duration: f64,
        /// Least number of velocities.
        least: usize,
    },
    /// Gravity and Earth rate are parallel, or zero.
    #[error(
        "gravity and Earth rate do not determine the attitude here, at a pole, or because the IMU's \
         samples are zero; give the attitude (alignment = \"given\"), or check the samples"
    )]
    NoDirection,
    /// The fixes do not determine the attitude.
    #[error(
        "{count} fixes faster than {speed} m/s in an alignment by the course of at least {duration} \
         s, {least} are needed: begin later (estimator.start), check the samples of GNSS, or give \
         the attitude (alignment = \"given\")"
    )]
    NoCourse {
        /// Number of fixes in motion.
        count: usize,
        /// Least number of fixes in motion.
        least: usize,
        /// Speed from which a fix counts, m/s.
        speed: f64,
        /// Shortest duration, s.
        duration: f64,
    },
    /// The vehicle moved during an alignment at rest.
    #[error(
        "the vehicle does not rest: its velocity is {error:.2} m/s off zero about {at}, and an \
         alignment at rest needs {duration} s from {begin} on; start at a time at rest \
         (estimator.start), raise alignment.rest_velocity if this is sway, or align in motion \
         (alignment.method = \"in-motion\")"
    )]
    NotAtRest {
        /// Error of the velocity, m/s.
        error: f64,
        /// Time of that error.
        at: Time,
        /// Duration of the alignment, s.
        duration: f64,
        /// Beginning of the alignment.
        begin: Time,
    },
    /// The vehicle moved before the heading was good enough.
    #[error(
        "the vehicle moved at {at}, {elapsed:.1} s into a static alignment: 1-sigma of the heading \
         {sigma:.3} deg, gate {gate:.3} deg; start later or stay longer at rest, align in motion \
         (alignment.method = \"in-motion\"), raise alignment.rest_velocity if that was sway, or \
         alignment.heading_gate if a wider one suffices"
    )]
    Moved {
        /// Time of the first zero-velocity update that was gated.
        at: Time,
        /// Time since the beginning of the alignment, s.
        elapsed: f64,
        /// 1-sigma of the heading, deg.
        sigma: f64,
        /// Gate of the heading, deg.
        gate: f64,
    },
}

impl From<AlignmentError> for ProcessError {
    fn from(error: AlignmentError) -> Self {
        Self::alignment(error.to_string()).with_source(error)
    }
}
