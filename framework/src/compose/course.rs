//! A given trajectory, at which an estimator linearises.

use crate::units::time::Time;
use std::io;

/// A trajectory of the state, read in order of time.
///
/// ```
/// use navfuse_core::compose::course::Course;
/// use navfuse_core::units::time::Time;
/// /// The same state at all times.
/// struct AtRest(Vec<f64>);
/// impl Course for AtRest {
///     fn read(&mut self, place: u64, _: Time, values: &mut [f64]) -> std::io::Result<Option<u64>> {
///         values.copy_from_slice(&self.0);
///         Ok(Some(place + 1))
///     }
/// }
/// ```
pub trait Course: Send {
    /// Reads the values of the state at a time. The search begins at `place`; the place after the
    /// state is returned, or `None` if the trajectory has no state of this time.
    ///
    /// # Errors
    /// When the trajectory cannot be read.
    fn read(&mut self, place: u64, time: Time, values: &mut [f64]) -> io::Result<Option<u64>>;
}
