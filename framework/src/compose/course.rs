//! A given trajectory, at which an estimator linearises.

use crate::units::time::Time;
use std::io;

/// A trajectory of the state, read in order of time.
pub trait Course: Send {
    /// Reads the values of the state at a time. The search begins at `place`; the place after the
    /// state is returned, or `None` if the trajectory has no state of this time.
    ///
    /// # Errors
    /// When the trajectory cannot be read.
    fn read(&mut self, place: u64, time: Time, values: &mut [f64]) -> io::Result<Option<u64>>;
}
