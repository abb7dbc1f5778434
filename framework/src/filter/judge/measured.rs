//! What a sample measures.

/// The sensor of a sample, and the channels that the sample has.
#[derive(Clone, Copy, Debug)]
pub(in crate::filter) struct Measured {
    /// Number of the sensor.
    pub(in crate::filter) sensor: usize,
    /// The channels that are present, one bit each.
    pub(in crate::filter) present: u16,
}
