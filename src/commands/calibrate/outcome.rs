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

/// Factor from `k` (1) or an angle (rad) to what is printed: degrees for angles.
pub fn unit(i: usize) -> f64 {
    if i == 0 { 1.0 } else { 1_f64.to_degrees() }
}

/// Decimals of `k`, and of an angle in degrees.
pub fn decimals(i: usize) -> usize {
    if i == 0 { 5 } else { 3 }
}
