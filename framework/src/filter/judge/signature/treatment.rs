//! What the filter does with a sample, and what it learns about those that it refuses.

use crate::model::record::finding::Finding;

/// What the filter does with a sample.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Treatment {
    /// Weight of the evidence, below one for a sample that the gate refuses.
    pub(in crate::filter) weight: f64,
    /// Set if it corrects the state.
    pub(in crate::filter) used: bool,
    /// Set while all sensors agree with the filter.
    pub(in crate::filter) calm: bool,
    /// Set if its sensor is isolated.
    pub(in crate::filter) isolated: bool,
}

/// A sample that the gate is about to refuse, after others.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Refusal {
    /// Index of the sensor.
    pub(in crate::filter) sensor: usize,
    /// Set if many were refused in a row.
    pub(in crate::filter) insists: bool,
    /// Set if the gate refuses another sensor as well: an error of the driving sensor contradicts all.
    pub(in crate::filter) shared: bool,
}

/// What explains the samples that the gate refused.
pub(in crate::filter) enum Explained {
    Nothing,
    /// An offset of the sensor's clock, or its withdrawal.
    Offset(Option<Finding>),
    /// An error of the driving sensor, which the covariance contains.
    Driver(Finding),
}
