//! The outcome of a method.

use crate::error::Result;
use navfuse_calibration::Estimate;

/// The estimate of a method, or the reason why the method cannot be applied.
pub struct Outcome {
    /// Name of the method.
    pub name: String,
    /// Sensors that it uses.
    pub sensors: String,
    /// The estimate.
    pub result: Result<Estimate>,
}

impl Outcome {
    /// Name and result, for the words of a terminal or a page.
    pub fn named(&self) -> (&str, std::result::Result<&Estimate, String>) {
        (&self.name, self.result.as_ref().map_err(ToString::to_string))
    }
}
